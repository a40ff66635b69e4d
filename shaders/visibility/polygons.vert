#version 460
// Pass visibility.depth: splats from vertices, pushed away.
#include "common/pushed_polygon.glsl"

layout(location = 0) out vec3 position_in_view;
layout(location = 1) out vec3 normal_in_view;
layout(location = 2) out vec3 base;
layout(location = 3) out vec2 uv;
// Radius of the round bound squared, the part of the light that is kept, and the depth offset.
layout(location = 4) flat out vec3 bound_share_offset;

void main() {
    int k = gl_VertexIndex % 3;
    uv = footprint()[k == 0 ? 0 : gl_VertexIndex / 3 + k];
    vec3 across = second_axis();
    vec3 middle = (frame.view_from_model * vec4(center, 1.0)).xyz;
    position_in_view = (frame.view_from_model * vec4(center + uv.x * axis + uv.y * across, 1.0)).xyz;
    vec3 s = shape_operator;
    vec3 n = shading_normal + dot(s.xy, uv) * axis + dot(s.yz, uv) * across;
    normal_in_view = mat3(frame.view_from_model) * n;
    base = color.rgb + color_slopes() * uv;
    bound_share_offset = vec3(round_radius * round_radius, light_share(), polygon_offset(middle));
    bool is_gone = faces_away(middle);
    vec4 clip = frame.clip_from_view * vec4(pushed(position_in_view, push_of(middle)), 1.0);
    gl_Position = is_gone ? vec4(0.0, 0.0, 2.0, 1.0) : clip;
}
