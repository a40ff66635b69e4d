// Sums in fixed point, so that they do not depend on the order of adding. A pixel has two of each: deposits of a small
// weight go to the fine ones, since in a pixel where there are no others their color must not be lost in rounding. Each is
// a word of 64 bits of two sums: (color, weight) of what is gray, else (red, green) and (blue, weight), the first of a pair
// in the low half.
// Requires GL_EXT_shader_explicit_arithmetic_types_int64.

// Red, green and blue are the same in every deposit of the frame.
layout(constant_id = 0) const bool IS_GRAY = false;

// Steps in a sum of 1. Sums below 4096 and below 16 fit.
const float COARSE_STEPS = 1048576.0;
const float FINE_STEPS = 268435456.0;
// Weights from here on are coarse: 1024 steps, far below a level.
const float LEAST_COARSE = 1.0 / 1024.0;
// More than this no deposit weighs, so that what is out of all bounds spoils no other pixel's sums.
const float MOST_WEIGHT = 1024.0;

uint64_t fixed_pair(float low, float high) {
    return packUint2x32(uvec2(uint(low + 0.5), uint(high + 0.5)));
}

vec2 from_fixed(uint64_t pair, float steps) {
    return vec2(unpackUint2x32(pair)) / steps;
}
