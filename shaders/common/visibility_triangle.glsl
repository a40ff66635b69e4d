// A corner of a triangle as the passes visibility.depth (pushed) and visibility.centers (in its place) draw it.
#include "common/visibility.glsl"
#include "common/octahedral.glsl"
#include "common/push.glsl"

layout(location = 0) out vec3 normal_in_view;
layout(location = 1) out vec3 vertex_color;
layout(location = 2) out float view_distance;

invariant gl_Position;

void emit_corner(vec3 position, vec2 packed_normal, vec4 color, bool is_center) {
    vec3 position_in_view = (frame.view_from_model * vec4(position, 1.0)).xyz;
    // Alpha 0 marks a vertex without normal: it leaves the others to decide.
    normal_in_view =
        color.a == 0.0 ? vec3(0.0) : mat3(frame.view_from_model) * octahedral_decode(packed_normal) / frame.model_scale;
    vertex_color = color.rgb;
    if (!is_center) {
        float facing = color.a == 0.0 ? 1.0 : dot(normal_in_view, to_viewer(position_in_view));
        float side = max(frame.splat_size_px, 1.0);
        position_in_view = push_away(position_in_view, depth_offset(side, -position_in_view.z, facing));
    }
    view_distance = -position_in_view.z;
    gl_Position = frame.clip_from_view * vec4(position_in_view, 1.0);
}
