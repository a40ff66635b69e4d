#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass fuzzy.blend by compute: each splat adds its color by its kernel where it is not behind the front.
#include "common/weighted_record.glsl"
#include "common/fixed_sums.glsl"
#include "common/square.glsl"

// The frame has a lamp instead of the headlight.
layout(constant_id = 6) const bool HAS_LAMP = false;
layout(constant_id = 11) const bool IS_WIDENED = false;

layout(local_size_x = 64) in;

layout(set = 0, binding = 3, std430) readonly buffer Front {
    uint front[];
};

layout(set = 0, binding = 4, std430) buffer Sums {
    uint64_t sums[];
};

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    SmallSplat small = small_splat(list.begin + item);
    Surfel surfel = small.surfel;
    Disc disc = footprint_of(surfel, IS_WIDENED);
    float middle = weight_of(surfel, disc, splats[list.begin + item].area);
    vec3 tint = vec3(1.0, 0.2, 0.2);
    vec3 color = HAS_LAMP ? phong(surfel.center, surfel.normal, small.color.rgb, tint)
                          : headlight(surfel.normal, to_light(surfel.center), small.color.rgb, tint);
    Square square = square_around(small.window_px, disc.size_px);
    ivec2 size = max(square.end - square.first, ivec2(0));
    int pixels = small.is_drawn ? size.x * size.y : 0;
    uint depth = floatBitsToUint(small.depth);
    uint at = index_of(square.first);
    uint to_next_row = list.rect_px.z - list.rect_px.x - uint(size.x) + 1u;
    vec2 from_center = vec2(square.first) + 0.5 - disc.center_px;
    float first = from_center.x;
    int left = size.x;
    for (; pixels > 0; --pixels) {
        float squared = rho_squared(disc.form, disc.skew, from_center);
        float weight = squared <= 1.0 ? middle * (IS_GAUSS ? exp(-2.0 * squared) : 1.0) : 0.0;
        if (weight > 0.0 && front[at] <= depth) {
            Deposit deposit = deposit_of(at, color, weight);
            atomicAdd(sums[deposit.word], deposit.first);
            if (!IS_GRAY) {
                atomicAdd(sums[deposit.word + 1u], deposit.second);
            }
        }
        --left;
        at += left == 0 ? to_next_row : 1u;
        from_center = left == 0 ? vec2(first, from_center.y + 1.0) : from_center + vec2(1.0, 0.0);
        left = left == 0 ? size.x : left;
    }
}
