// What points and square splats share: the center decides position, depth and shade of the whole square.
#include "common/place.glsl"
#include "common/headlight.glsl"
#include "common/octahedral.glsl"

layout(location = 0) flat out vec3 shade;
layout(location = 1) flat out vec3 normal_in_model;

// Places a square of `radius` model units (0: of the frame's constant size) and shades it.
void emit_point(vec3 center, float radius, vec2 packed_normal, vec4 color) {
    vec4 center_in_view = frame.view_from_model * vec4(center, 1.0);
    float side = frame.splat_size_px;
    if (radius > 0.0) {
        float distance = has_flag(FLAG_ORTHOGRAPHIC) ? 1.0 : -center_in_view.z;
        side = 2.0 * frame.focal_px * radius * frame.model_scale / distance;
    }
    place(frame.clip_from_view * center_in_view, max(side, 1.0));
    // Alpha 0 marks a point without normal.
    normal_in_model = color.a == 0.0 ? vec3(0.0) : octahedral_decode(packed_normal);
    vec3 n = mat3(frame.view_from_model) * normal_in_model / frame.model_scale;
    shade = shade_at(center_in_view.xyz, n, color.rgb, vec3(1.0, 0.2, 0.2));
}
