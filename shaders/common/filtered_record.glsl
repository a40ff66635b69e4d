// One filtered splat of the draw list as storage, in words of two floats: a software device reads a word in the time of a
// float. Mirrored by `abi::FilteredSplat`.
// Requires GL_EXT_shader_explicit_arithmetic_types_int64.
#include "common/constants.glsl"
#include "common/list.glsl"

struct FilteredRecord {
    // Window position, pixels.
    uint64_t window;
    // Reversed depth in the first pass, and side of the square, pixels.
    uint64_t pushed_side;
    // Reversed depth of the center, and projected area of what faces the viewer, square pixels.
    uint64_t depth_area;
    // Width and height of the rectangle, pixels.
    uint64_t extent;
    uint64_t red_green;
    uint64_t blue_nothing;
};

layout(set = 0, binding = 2, std430) readonly buffer FilteredSplats {
    FilteredRecord splats[];
};

vec2 floats_of(uint64_t word) {
    return uintBitsToFloat(unpackUint2x32(word));
}
