// A corner of a triangle beside fuzzy splats in the first pass: pushed away by the offset that the largest splat at its
// depth would have, so that neither kind cuts the other where they meet.
#include "common/push.glsl"
#include "common/octahedral.glsl"

vec4 clip_of_pushed_corner(vec3 position, vec2 normal, bool has_normal) {
    vec3 position_in_view = (frame.view_from_model * vec4(position, 1.0)).xyz;
    bool is_orthographic = has_flag(FLAG_ORTHOGRAPHIC);
    vec3 to_eye = is_orthographic ? vec3(0.0, 0.0, 1.0) : -normalize(position_in_view);
    vec3 n = mat3(frame.view_from_model) * octahedral_decode(normal) / frame.model_scale;
    float facing = has_normal ? max(abs(dot(n, to_eye)), 0.1) : 1.0;
    float depth = is_orthographic ? 1.0 : max(-position_in_view.z, 0.0);
    float radius = frame.depth_offset * max(frame.splat_size_px, 1.0) * depth / (2.0 * frame.focal_px);
    return frame.clip_from_view * vec4(push_away(position_in_view, radius / facing), 1.0);
}
