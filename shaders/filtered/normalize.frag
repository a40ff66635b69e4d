#version 460
// Pass filtered.normalize: see common/normalize.glsl.
layout(set = 0, binding = 1) uniform sampler2D sums;

vec4 sum_at(ivec2 pixel) {
    return texelFetch(sums, pixel, 0);
}

#include "common/normalize.glsl"

layout(location = 0) out vec4 color;

void main() {
    color = normalized(ivec2(gl_FragCoord.xy), textureSize(sums, 0));
}
