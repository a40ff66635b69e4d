#version 460
// A triangle covers the pixel whole: its shade with weight 1.
#include "common/headlight.glsl"

layout(location = 0) in vec3 normal_in_view;
layout(location = 1) in vec3 vertex_color;

layout(location = 0) out vec4 sums;

void main() {
    float squared = dot(normal_in_view, normal_in_view);
    vec3 n = squared > 0.0 ? normal_in_view * inversesqrt(squared) : vec3(0.0);
    vec3 l = vec3(0.0, 0.0, 1.0);
    if ((frame.flags & FLAG_PARALLEL_LIGHT) == 0u) {
        l = -normalize(vec3(gl_FragCoord.xy * frame.ray_scale + frame.ray_offset, -1.0));
    }
    sums = vec4(headlight(n, l, vertex_color, vec3(0.2, 0.35, 1.0)), 1.0);
}
