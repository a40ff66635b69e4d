// A splat as the passes visibility.depth and visibility.centers draw it: the footprint, pushed away from the eye by its
// depth offset, or the center alone in its place.
#include "common/visibility.glsl"
#include "common/octahedral.glsl"
#include "common/push.glsl"

layout(location = 0) flat out vec3 shade;
layout(location = 1) flat out vec3 normal_in_model;
layout(location = 2) flat out vec2 front;

invariant gl_Position;

// `radius` in model units; 0 asks for the constant size of the frame.
void emit_splat(vec3 center, float radius, vec2 packed_normal, vec4 color, bool is_center) {
    vec3 center_in_view = (frame.view_from_model * vec4(center, 1.0)).xyz;
    float distance = -center_in_view.z;
    float side = frame.splat_size_px;
    if (radius > 0.0) {
        float depth = (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? 1.0 : distance;
        side = 2.0 * frame.focal_px * radius * frame.model_scale / depth;
    }
    side = max(side, 1.0);
    // Alpha 0 marks a splat without normal.
    normal_in_model = color.a == 0.0 ? vec3(0.0) : octahedral_decode(packed_normal);
    vec3 n = mat3(frame.view_from_model) * normal_in_model / frame.model_scale;
    shade = headlight(n, to_light(center_in_view), color.rgb, vec3(1.0, 0.2, 0.2));
    float facing = color.a == 0.0 ? 1.0 : dot(n, to_viewer(center_in_view));
    front = vec2(distance, depth_offset(side, distance, facing));
    // Near and far are those of the center itself in both passes.
    vec4 unpushed = frame.clip_from_view * vec4(center_in_view, 1.0);
    if (unpushed.z > unpushed.w || unpushed.z < 0.0) {
        gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
    } else if (is_center) {
        gl_Position = before_far(unpushed);
    } else {
        gl_Position = before_far(frame.clip_from_view * vec4(push_away(center_in_view, front.y), 1.0));
    }
    gl_PointSize = is_center ? 1.0 : side;
}
