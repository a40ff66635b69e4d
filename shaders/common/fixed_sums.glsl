// Sums in fixed point, so that they do not depend on the order of adding: per pixel two words of 64 bits, (red, green)
// and (blue, weight), the first of each pair in the low half.
// Requires GL_EXT_shader_explicit_arithmetic_types_int64.

// Steps in a sum of 1. A sum below 4096 fits; contributions are rounded to 2^-20, far below a grey level.
const float SUM_STEPS = 1048576.0;
// Sums of weights from which on a pixel takes no more: half of what fits, so that those under way fit too.
const uint SUM_FULL = 0x80000000u;

uint64_t fixed_pair(float low, float high) {
    return uint64_t(uint(roundEven(low * SUM_STEPS))) | (uint64_t(uint(roundEven(high * SUM_STEPS))) << 32);
}

vec4 from_fixed(uint64_t red_green, uint64_t blue_weight) {
    return vec4(uint(red_green), uint(red_green >> 32), uint(blue_weight), uint(blue_weight >> 32)) / SUM_STEPS;
}
