// What discs and ellipses share, whether they come from a draw list or from the vertices of a mesh.
#include "common/place.glsl"
#include "common/round.glsl"
#include "common/headlight.glsl"
#include "common/octahedral.glsl"

// In the plane of the surface, else facing the viewer with the frame's constant size.
layout(constant_id = 1) const bool IS_ORIENTED = false;

layout(location = 0) flat out vec3 shade;
layout(location = 1) flat out vec3 normal_in_model;
layout(location = 2) flat out vec2 center_px;
layout(location = 3) flat out vec3 form;
layout(location = 4) flat out vec2 skew;
// Reversed depth of the center, its change along x and y, 1 / pixels, and what the dome takes from it per unit of the form.
layout(location = 5) flat out vec4 depth_lean_dome;

void emit_round(vec3 center, float radius, vec2 packed_normal, vec4 color) {
    vec3 center_in_view = (frame.view_from_model * vec4(center, 1.0)).xyz;
    // Alpha 0 marks what has no normal.
    normal_in_model = color.a == 0.0 ? vec3(0.0) : octahedral_decode(packed_normal);
    vec3 n = mat3(frame.view_from_model) * normal_in_model / frame.model_scale;
    vec4 clip = frame.clip_from_view * vec4(center_in_view, 1.0);
    Disc disc;
    if (IS_ORIENTED) {
        float r = radius_in_view(radius, center_in_view);
        disc = footprint(center_in_view, n, r, thickness_of(color.a), false);
    } else {
        // As compute finds them, to the bit: at the rim of a circle a last place decides.
        vec2 window = (frame.window_from_model * vec4(center, 1.0)).xy / clip.w;
        disc = circle_at(window, radius_px_of(radius, clip.w));
    }
    center_px = disc.center_px;
    form = disc.form;
    skew = disc.skew;
    depth_lean_dome = vec4(clip.z / clip.w, disc.lean, disc.dome);
    place(clip, disc.size_px);
    shade = shade_at(center_in_view, n, color.rgb, vec3(1.0, 0.2, 0.2));
}
