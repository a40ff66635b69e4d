#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass filtered.depth by compute: the nearest pushed depth of each pixel.
#include "common/filtered_small.glsl"
#include "common/push.glsl"
#include "common/square.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 3, std430) buffer Front {
    // Reversed depth as bits: floats that are not negative order like integers.
    uint front[];
};

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    SmallSplat small = small_splat(list.begin + item);
    vec4 pushed = clip_of_pushed(push_away(small.center_in_view, small.offset * frame.model_scale));
    float nearness = pushed.z / pushed.w;
    Square square = square_around(small.window_px, small.side_px);
    ivec2 size = max(square.end - square.first, ivec2(0));
    // Also what cannot be pushed: it hides nothing.
    int pixels = small.is_drawn && nearness > 0.0 ? size.x * size.y : 0;
    uint depth = floatBitsToUint(min(nearness, 1.0));
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
