// What the last pass reads where compute summed small splats.
// Requires GL_EXT_shader_explicit_arithmetic_types_int64.
#include "common/fixed_sums.glsl"
#include "common/list.glsl"

// The rasterizer drew as well: what is large.
layout(constant_id = 8) const bool HAS_LARGE = false;

layout(set = 0, binding = 2, std430) readonly buffer Front {
    uint front[];
};

layout(set = 0, binding = 3, std430) readonly buffer Sums {
    uint64_t sums[];
};

layout(set = 0, binding = 4) uniform sampler2D large;

// Reversed depth of the first pass.
float front_at(ivec2 pixel) {
    return uintBitsToFloat(front[index_of(pixel)]);
}

// Sums of color times weight, and of weights.
vec4 sum_at(ivec2 pixel) {
    uint at = index_of(pixel);
    vec4 sum;
    if (IS_GRAY) {
        vec2 both = from_fixed(sums[2u * at], COARSE_STEPS) + from_fixed(sums[2u * at + 1u], FINE_STEPS);
        sum = both.xxxy;
    } else {
        sum = vec4(
            from_fixed(sums[4u * at], COARSE_STEPS) + from_fixed(sums[4u * at + 2u], FINE_STEPS),
            from_fixed(sums[4u * at + 1u], COARSE_STEPS) + from_fixed(sums[4u * at + 3u], FINE_STEPS)
        );
    }
    if (HAS_LARGE) {
        sum += texelFetch(large, pixel, 0);
    }
    return sum;
}

// The first and one past the last pixel that these know.
ivec4 bounds() {
    return ivec4(list.rect_px);
}
