#version 460
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
    FilteredRecord splat = splats[list.begin + item];
    SmallSplat small = small_splat(splat);
    if (!small.is_drawn) {
        return;
    }
    vec4 pushed = clip_of_pushed(push_away(small.center_in_view, splat.offset * frame.model_scale));
    float nearness = pushed.z / pushed.w;
    // Also what cannot be pushed: it hides nothing.
    if (!(nearness > 0.0)) {
        return;
    }
    uint depth = floatBitsToUint(min(nearness, 1.0));
    Square square = square_around(small.window_px, splat.extent_and_side_px[2]);
    for (int y = square.first.y; y < square.end.y; ++y) {
        uint at = index_of(ivec2(square.first.x, y));
        for (int x = square.first.x; x < square.end.x; ++x) {
            // A look first: most squares of a dense surface lose, and an atomic costs more than a read.
            if (front[at] < depth) {
                atomicMax(front[at], depth);
            }
            ++at;
        }
    }
}
