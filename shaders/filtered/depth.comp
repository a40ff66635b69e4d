#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass filtered.depth by compute: the nearest pushed depth of each pixel; pass filtered.surface: the nearest where it lies.
#include "common/filtered_record.glsl"
#include "common/square.glsl"

layout(local_size_x = 64) in;

layout(constant_id = 1) const bool IS_PUSHED = false;

layout(set = 0, binding = 3, std430) buffer Front {
    // Reversed depth as bits: floats that are not negative order like integers.
    uint front[];
};

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    vec2 window_px = floats_of(splats[list.begin + item].window);
    vec2 pushed_side = floats_of(splats[list.begin + item].pushed_side);
    Square square = square_around(window_px, pushed_side.y);
    ivec2 size = max(square.end - square.first, ivec2(0));
    float shown = IS_PUSHED ? pushed_side.x : floats_of(splats[list.begin + item].depth_area).x;
    // What cannot be pushed hides nothing; what is large is the rasterizer's.
    int pixels = shown > 0.0 && pushed_side.y <= LARGEST_SMALL_BLENDED_PX ? size.x * size.y : 0;
    uint depth = floatBitsToUint(shown);
    // One loop over all rows: of two, the inner one would take as many turns as the longest row of its neighbors.
    uint at = index_of(square.first);
    uint to_next_row = list.rect_px.z - list.rect_px.x - uint(size.x) + 1u;
    int left = size.x;
    for (; pixels > 0; --pixels) {
        // A look first: most squares of a dense surface lose, and an atomic costs more than a read.
        if (front[at] < depth) {
            atomicMax(front[at], depth);
        }
        --left;
        at += left == 0 ? to_next_row : 1u;
        left = left == 0 ? size.x : left;
    }
}
