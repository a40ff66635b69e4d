// Vectors as the host has them: the same operations in the same order, nothing contracted, so that both find the same.

float sum_of(vec3 products) {
    precise float sum = (products.x + products.y) + products.z;
    return sum;
}

float dot_of(vec3 a, vec3 b) {
    precise vec3 products = a * b;
    return sum_of(products);
}

float with_sign_of(float magnitude, float v) {
    return uintBitsToFloat((floatBitsToUint(magnitude) & 0x7fffffffu) | (floatBitsToUint(v) & 0x80000000u));
}

// The point of the octahedron, of a radius of `one`, that a code stands for.
vec3 unfolded(vec2 code, float one) {
    precise float z = (one - abs(code.x)) - abs(code.y);
    float fold = max(-z, 0.0);
    precise vec2 xy = code - vec2(with_sign_of(fold, code.x), with_sign_of(fold, code.y));
    return vec3(xy, z);
}

// The unit vector of a code of signed 16-bit numbers, by a quotient as `math::octahedral::decode` has it.
vec3 unit_of(ivec2 code) {
    precise vec2 v = max(vec2(code) * (1.0 / 32767.0), vec2(-1.0));
    vec3 at = unfolded(v, 1.0);
    precise float size = sqrt(dot_of(at, at));
    precise vec3 unit = at / size;
    return unit;
}

// The two signed halves of a word, the lower one first.
ivec2 halves_of(uint word) {
    return ivec2(int(word << 16) >> 16, int(word) >> 16);
}

// The alpha that stands for a thickness over the radius, rounded to thicker.
uint alpha_of(float thickness) {
    precise float code = ceil(clamp(thickness, 0.0, 1.0) * 254.0);
    return 255u - uint(min(code, 254.0));
}
