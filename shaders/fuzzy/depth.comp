#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass fuzzy.depth by compute: the nearest pushed depth of each pixel.
#include "common/fuzzy_record.glsl"
#include "common/square.glsl"

layout(local_size_x = 64) in;

// A Gaussian in the plane of the surface, else weights of 1.
layout(constant_id = 0) const bool IS_GAUSS = false;

layout(set = 0, binding = 3, std430) buffer Front {
    // Reversed depth as bits: floats that are not negative order like integers.
    uint front[];
};

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    Footprint print = footprint_at(list.begin + item);
    // A Gaussian's own footprint: wherever it hides something it also counts, since the kernel is never smaller. Small
    // ones between the centers of pixels hide nothing; what surface they stand for, their neighbors hide.
    print = IS_GAUSS ? exact(print) : at_least_a_pixel(print);
    Disc disc = print.disc;
    float pushed = floats_of(splats[list.begin + item].pushed_xx).x;
    Square square = rectangle_around(disc.center_px, print.sides_px);
    ivec2 size = max(square.end - square.first, ivec2(0));
    // What cannot be pushed hides nothing.
    int pixels = pushed > 0.0 ? size.x * size.y : 0;
    uint depth = floatBitsToUint(pushed);
    // One loop over all rows: of two, the inner one would take as many turns as the longest row of its neighbors.
    uint at = index_of(square.first);
    uint to_next_row = list.rect_px.z - list.rect_px.x - uint(size.x) + 1u;
    vec2 from_center = vec2(square.first) + 0.5 - disc.center_px;
    float first = from_center.x;
    int left = size.x;
    for (; pixels > 0; --pixels) {
        // A look first: most splats of a dense surface lose, and an atomic costs more than a read.
        if (rho_squared(disc.form, disc.skew, from_center) <= 1.0 && front[at] < depth) {
            atomicMax(front[at], depth);
        }
        --left;
        at += left == 0 ? to_next_row : 1u;
        from_center = left == 0 ? vec2(first, from_center.y + 1.0) : from_center + vec2(1.0, 0.0);
        left = left == 0 ? size.x : left;
    }
}
