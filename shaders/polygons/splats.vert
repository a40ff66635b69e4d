#version 460
// A fan of eight corners for each splat cut at sharp edges.
#include "common/polygon.glsl"
#include "common/push_polygon.glsl"

layout(location = 0) out vec3 position_in_view;
layout(location = 1) out vec3 normal_in_view;
layout(location = 2) out vec3 base;
layout(location = 3) out vec2 uv;
// Radius of the round bound squared, and the part of the light that is kept.
layout(location = 4) flat out vec2 bound_and_share;
// How the blend pass pulls it.
layout(location = 5) flat out vec2 reach;

invariant gl_Position;

void main() {
    int k = gl_VertexIndex % 3;
    uv = footprint()[k == 0 ? 0 : gl_VertexIndex / 3 + k];
    vec3 across = second_axis();
    vec4 at = frame.view_from_model * vec4(center + uv.x * axis + uv.y * across, 1.0);
    position_in_view = at.xyz;
    vec3 s = shape_operator;
    vec3 n = shading_normal + dot(s.xy, uv) * axis + dot(s.yz, uv) * across;
    normal_in_view = mat3(frame.view_from_model) * n;
    base = color.rgb + color_slopes() * uv;
    bound_and_share = vec2(round_radius * round_radius, light_share());
    vec3 middle = (frame.view_from_model * vec4(center, 1.0)).xyz;
    reach = reach_of(middle);
    // Beyond the near plane where it is left out.
    bool is_gone = faces_away(middle);
    gl_Position = is_gone ? vec4(0.0, 0.0, 2.0, 1.0) : frame.clip_from_view * at;
}
