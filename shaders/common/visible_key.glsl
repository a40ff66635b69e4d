// The key of what is nearest in a pixel of visibility splats. Requires GL_EXT_shader_explicit_arithmetic_types_int64.

// Reversed depth as bits above the number in the list: floats that are not negative order like integers. 0 is nothing.
// The number is as it is for centers, of which of equals the last of the list stays, and its complement for footprints,
// of which the first does: as the passes of the rasterizer have it.
uint64_t key_of(float depth, uint number) {
    return packUint2x32(uvec2(number, floatBitsToUint(depth)));
}
