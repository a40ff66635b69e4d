#version 460
// Pass visibility.push: the holes of a level of the pyramid from the next coarser one.
#include "common/push_level.glsl"

layout(location = 0) out vec4 color;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 own = texelFetch(picked, pixel, 0);
    vec2 front = texelFetch(fronts, pixel, 0).xy;
    vec4 filled = from_coarse(pixel, own, front);
    color = filled.a > 0.0 ? filled : own;
}
