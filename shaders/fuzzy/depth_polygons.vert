#version 460
// Pass fuzzy.depth: splats from vertices into depth only, pushed away a little.
#include "common/pushed_polygon.glsl"

layout(location = 0) out vec2 uv;
layout(location = 1) flat out float bound;

void main() {
    int k = gl_VertexIndex % 3;
    uv = footprint()[k == 0 ? 0 : gl_VertexIndex / 3 + k];
    bound = round_radius * round_radius;
    vec3 middle = (frame.view_from_model * vec4(center, 1.0)).xyz;
    vec3 at = (frame.view_from_model * vec4(center + uv.x * axis + uv.y * second_axis(), 1.0)).xyz;
    bool is_gone = faces_away(middle);
    gl_Position = is_gone ? vec4(0.0, 0.0, 2.0, 1.0) : frame.clip_from_view * vec4(pushed(at, least_push_of(middle)), 1.0);
}
