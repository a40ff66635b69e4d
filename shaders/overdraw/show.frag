#version 460
// Pass overdraw.show: how many primitives cover each pixel, as color.
#include "common/falsecolor.glsl"

layout(set = 0, binding = 1) uniform sampler2D counts;

layout(location = 0) out vec4 color;

void main() {
    float count = texelFetch(counts, ivec2(gl_FragCoord.xy), 0).r;
    color = count > 0.0 ? vec4(ramp(log2(count) / log2(MOST_OVERDRAW)), 1.0) : vec4(frame.background.rgb, 0.0);
}
