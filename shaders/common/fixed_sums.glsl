// Sums in fixed point, so that they do not depend on the order of adding. A pixel has two of each: deposits of a small
// weight go to the fine ones, since in a pixel where there are no others their color must not be lost in rounding. Each is
// a word of 64 bits of two sums: (color, weight) of what is gray, else (red, green) and (blue, weight), the first of a pair
// in the low half.
// Requires GL_EXT_shader_explicit_arithmetic_types_int64.
#include "common/constants.glsl"

// Red, green and blue are the same in every deposit of the frame.
layout(constant_id = 7) const bool IS_GRAY = false;

uint64_t fixed_pair(float low, float high) {
    return packUint2x32(uvec2(uint(low + 0.5), uint(high + 0.5)));
}

vec2 from_fixed(uint64_t pair, float steps) {
    return vec2(unpackUint2x32(pair)) / steps;
}

// One deposit: where it goes and what is added there.
struct Deposit {
    uint word;
    uint64_t first;
    uint64_t second;
};

// That of `color` with `weight`, at least 0, in the pixel that `index_of` puts `at`. Only the first word where all is gray.
Deposit deposit_of(uint at, vec3 color, float weight) {
    weight = min(weight, MOST_WEIGHT);
    bool is_fine = weight < LEAST_COARSE;
    float steps = weight * (is_fine ? FINE_STEPS : COARSE_STEPS);
    if (IS_GRAY) {
        return Deposit(2u * at + uint(is_fine), fixed_pair(color.r * steps, steps), packUint2x32(uvec2(0u)));
    }
    uint word = 4u * at + 2u * uint(is_fine);
    return Deposit(word, fixed_pair(color.r * steps, color.g * steps), fixed_pair(color.b * steps, steps));
}
