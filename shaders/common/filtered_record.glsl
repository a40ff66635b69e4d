// One filtered splat of the draw list as storage, in words of two floats: a software device reads a word in the time of a
// float. Mirrored by `abi::FilteredSplat`.
// Requires GL_EXT_shader_explicit_arithmetic_types_int64.
#include "common/frame.glsl"
#include "common/list.glsl"

struct FilteredRecord {
    uint64_t center_x_y;
    // The depth offset of the first pass, model units.
    uint64_t center_z_offset;
    // Side of the square, and projected area of what faces the viewer; pixels and square pixels.
    uint64_t side_area;
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
