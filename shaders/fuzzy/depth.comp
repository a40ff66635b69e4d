#version 460
// Pass fuzzy.depth by compute: the nearest pushed depth of each pixel.
#include "common/weighted_record.glsl"
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
    Disc disc = hiding_footprint(small.surfel);
    vec4 pushed = clip_of_pushed(push_away(small.surfel.center, offset_of(small.surfel)));
    float nearness = pushed.z / pushed.w;
    Square square = square_around(small.window_px, disc.size_px);
    ivec2 size = max(square.end - square.first, ivec2(0));
    // Also what cannot be pushed: it hides nothing.
    int pixels = small.is_drawn && nearness > 0.0 ? size.x * size.y : 0;
    uint depth = floatBitsToUint(min(nearness, 1.0));
    uint at = index_of(square.first);
    uint to_next_row = list.rect_px.z - list.rect_px.x - uint(size.x) + 1u;
    vec2 from_center = vec2(square.first) + 0.5 - disc.center_px;
    float first = from_center.x;
    int left = size.x;
    for (; pixels > 0; --pixels) {
        if (rho_squared(disc.form, disc.skew, from_center) <= 1.0 && front[at] < depth) {
            atomicMax(front[at], depth);
        }
        --left;
        at += left == 0 ? to_next_row : 1u;
        from_center = left == 0 ? vec2(first, from_center.y + 1.0) : from_center + vec2(1.0, 0.0);
        left = left == 0 ? size.x : left;
    }
}
