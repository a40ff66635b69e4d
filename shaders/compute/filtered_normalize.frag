#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass filtered.normalize where small primitives were summed by compute: both sums together.
#include "common/fixed_sums.glsl"
#include "common/list.glsl"

layout(set = 0, binding = 2, std430) readonly buffer Sums {
    uint64_t sums[];
};

layout(set = 0, binding = 3) uniform sampler2D large;

vec4 sum_at(ivec2 pixel) {
    uint i = 2 * (uint(pixel.y) * list.size_px.x + uint(pixel.x));
    return texelFetch(large, pixel, 0) + from_fixed(sums[i], sums[i + 1]);
}

#include "common/normalize.glsl"

layout(location = 0) out vec4 color;

void main() {
    color = normalized(ivec2(gl_FragCoord.xy), ivec2(list.size_px));
}
