// A splat as the passes visibility.depth and visibility.centers draw it: the footprint, pushed away from the eye by its
// depth offset, or the pixel of the center alone, in its place.
#include "common/place.glsl"
#include "common/visibility.glsl"
#include "common/round.glsl"
#include "common/octahedral.glsl"
#include "common/push.glsl"

// Whether this is the pass of centers.
layout(constant_id = 0) const bool IS_CENTER = false;

layout(location = 0) flat out vec3 shade;
layout(location = 1) flat out vec3 normal_in_model;
layout(location = 2) flat out vec2 front;
layout(location = 3) flat out vec2 center_px;
layout(location = 4) flat out vec3 form;
layout(location = 5) flat out vec2 skew;

// `radius` in model units; 0 asks for the constant size of the frame.
void emit_splat(vec3 center, float radius, vec2 packed_normal, vec4 color) {
    vec3 center_in_view = (frame.view_from_model * vec4(center, 1.0)).xyz;
    float distance = -center_in_view.z;
    // Alpha 0 marks a splat without normal.
    normal_in_model = color.a == 0.0 ? vec3(0.0) : octahedral_decode(packed_normal);
    vec3 n = mat3(frame.view_from_model) * normal_in_model / frame.model_scale;
    shade = shade_at(center_in_view, n, color.rgb, vec3(1.0, 0.2, 0.2));
    float facing = color.a == 0.0 ? 1.0 : dot(n, to_eye(center_in_view));
    float r = radius_in_view(radius, center_in_view);
    front = vec2(distance, depth_offset(max(r, pixel_radius(distance)), facing));
    vec4 clip = frame.clip_from_view * vec4(center_in_view, 1.0);
    // Near and far are those of the center itself in both passes.
    bool is_outside = clip.z > clip.w || clip.z < 0.0;
    float size_px = 1.0;
    center_px = vec2(0.0);
    form = vec3(0.0);
    skew = vec2(0.0);
    if (!IS_CENTER) {
        clip = frame.clip_from_view * vec4(push_away(center_in_view, front.y), 1.0);
        Disc disc = footprint(center_in_view, n, r, thickness_of(color.a), false);
        center_px = disc.center_px;
        form = disc.form;
        skew = disc.skew;
        size_px = disc.size_px;
    }
    place(is_outside ? vec4(0.0, 0.0, 2.0, 1.0) : before_far(clip), is_outside ? 1.0 : size_px);
}
