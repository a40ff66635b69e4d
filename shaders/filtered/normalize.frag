#version 460
// Pass filtered.normalize: the picture from the targets of the passes before.

layout(set = 0, binding = 1) uniform sampler2D sums;
layout(set = 0, binding = 2) uniform sampler2D front;

float front_at(ivec2 pixel) {
    return texelFetch(front, pixel, 0).r;
}

vec4 sum_at(ivec2 pixel) {
    return texelFetch(sums, pixel, 0);
}

ivec4 bounds() {
    return ivec4(ivec2(0), textureSize(sums, 0));
}

#include "common/normalize.glsl"

layout(location = 0) out vec4 color;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    color = normalized(pixel, front_at(pixel));
}
