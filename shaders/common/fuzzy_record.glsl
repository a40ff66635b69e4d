// One fuzzy splat of the draw list as storage, and what the compute passes share: a splat with its place in the picture, in
// words of two floats, since a software device reads a word in the time of a float. Mirrored by `abi::FuzzySplat`.
// Requires GL_EXT_shader_explicit_arithmetic_types_int64.
#include "common/constants.glsl"
#include "common/form.glsl"
#include "common/list.glsl"

// A square, else a quadratic form.
layout(constant_id = 3) const bool IS_SQUARE = false;

struct FuzzyRecord {
    // Window position, pixels.
    uint64_t window;
    // Reversed depth in the first pass, and xx of the inverse of the form, square pixels; of a square its side.
    uint64_t pushed_xx;
    uint64_t xy_yy;
    uint64_t skew;
    // Reversed depth of the center, and the area that it covers, square pixels.
    uint64_t depth_area;
    // See `abi::FuzzySplat::color`.
    uint64_t color;
};

layout(set = 0, binding = 2, std430) readonly buffer FuzzySplats {
    FuzzyRecord splats[];
};

vec2 floats_of(uint64_t word) {
    return uintBitsToFloat(unpackUint2x32(word));
}

struct Footprint {
    Disc disc;
    // Of the inverse of its form.
    vec3 inverse;
    // Width and height of a rectangle around the center that contains it, pixels.
    vec2 sides_px;
};

// The footprint of a record before its size is known, of a square with it.
Footprint footprint_at(uint at) {
    float xx = floats_of(splats[at].pushed_xx).y;
    Disc disc = Disc(floats_of(splats[at].window), vec3(0.0), vec2(0.0), xx, vec2(0.0), 0.0);
    if (IS_SQUARE) {
        return Footprint(disc, vec3(0.0), vec2(xx));
    }
    disc.skew = floats_of(splats[at].skew);
    return Footprint(disc, vec3(xx, floats_of(splats[at].xy_yy)), vec2(0.0));
}

// As it is: it may lie between the centers of pixels.
Footprint exact(Footprint print) {
    print.disc.form = inverse_form(print.inverse);
    // The device snaps the center; what the rectangle gains is cut off by the form.
    print.sides_px = sides_of(print.inverse, print.disc.skew) + 1.0 / 64.0;
    return print;
}

// A pixel large at least, as `bounded` has it.
Footprint at_least_a_pixel(Footprint print) {
    if (IS_SQUARE) {
        return print;
    }
    print = exact(print);
    float size_px = max(print.sides_px.x, print.sides_px.y) - 1.0 / 64.0;
    print.disc.size_px = max(size_px, 1.0);
    if (!(size_px >= LEAST_ROUND_PX)) {
        print.disc.form = vec3(0.0);
        print.disc.skew = vec2(0.0);
        print.sides_px = vec2(print.disc.size_px);
    }
    return print;
}
