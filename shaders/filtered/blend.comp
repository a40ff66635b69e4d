#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass filtered.blend by compute: each splat deposits its projected area where it is not behind the front.
#include "common/filtered_record.glsl"
#include "common/fixed_sums.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 3, std430) readonly buffer Front {
    uint front[];
};

layout(set = 0, binding = 4, std430) buffer Sums {
    uint64_t sums[];
};

// Overlap of a pixel, a unit wide, and an interval, `distance` from center to center.
vec2 overlap(vec2 extent, vec2 distance) {
    return clamp(0.5 * (extent + 1.0) - distance, vec2(0.0), min(extent, 1.0));
}

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    vec2 window_px = floats_of(splats[list.begin + item].window);
    float side_px = floats_of(splats[list.begin + item].pushed_side).y;
    vec2 depth_area = floats_of(splats[list.begin + item].depth_area);
    vec2 extent = floats_of(splats[list.begin + item].extent);
    vec3 color = floats_of(splats[list.begin + item].red_green).xyy;
    if (!IS_GRAY) {
        color.z = floats_of(splats[list.begin + item].blue_nothing).x;
    }
    // In steps of 1/256 pixel, as a rasterizer has it.
    vec2 center = roundEven(window_px * 256.0) * (1.0 / 256.0);
    vec2 half_size = 0.5 * extent;
    vec2 low = clamp(floor(center - half_size), vec2(list.rect_px.xy), vec2(list.rect_px.zw));
    vec2 high = clamp(ceil(center + half_size), vec2(list.rect_px.xy), vec2(list.rect_px.zw));
    float density = depth_area.y / (extent.x * extent.y);
    uint depth = floatBitsToUint(depth_area.x);
    // What is no number lies nowhere, or weighs nothing; what is large is the rasterizer's.
    ivec2 size = ivec2(max(high - low, vec2(0.0)));
    bool is_small = side_px <= LARGEST_SMALL_BLENDED_PX;
    int pixels = is_small && min(extent.x, extent.y) > 0.0 ? size.x * size.y : 0;
    // One loop over all rows: of two, the inner one would take as many turns as the longest row of its neighbors.
    uint at = index_of(ivec2(low));
    uint to_next_row = list.rect_px.z - list.rect_px.x - uint(size.x) + 1u;
    vec2 from_center = low + 0.5 - center;
    float first = from_center.x;
    int left = size.x;
    for (; pixels > 0; --pixels) {
        vec2 own = overlap(extent, abs(from_center));
        float weight = density * (own.x * own.y);
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
