#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass filtered.blend by compute: each splat deposits its projected area where it is not behind the front.
#include "common/filtered_small.glsl"
#include "common/fixed_sums.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 3, std430) readonly buffer Front {
    uint front[];
};

layout(set = 0, binding = 4, std430) buffer Sums {
    uint64_t sums[];
};

// Overlap of a pixel, a unit wide, and an interval, `distance` from center to center.
float overlap(float extent, float distance) {
    return clamp(0.5 * (extent + 1.0) - distance, 0.0, min(extent, 1.0));
}

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    FilteredRecord splat = splats[list.begin + item];
    SmallSplat small = small_splat(splat);
    vec2 extent = vec2(splat.extent_and_side_px[0], splat.extent_and_side_px[1]);
    float side = splat.extent_and_side_px[2];
    // In steps of 1/256 pixel, as a rasterizer has it.
    vec2 center = roundEven(small.window_px * 256.0) * (1.0 / 256.0);
    vec2 half_size = 0.5 * max(extent, vec2(side));
    // What is no number lies nowhere.
    vec2 low = clamp(floor(center - half_size), vec2(list.rect_px.xy), vec2(list.rect_px.zw));
    vec2 high = clamp(ceil(center + half_size), vec2(list.rect_px.xy), vec2(list.rect_px.zw));
    if (!small.is_drawn || !all(lessThan(low, high))) {
        return;
    }
    float density = splat.area_px / (extent.x * extent.y);
    // No area, no skirt.
    float skirt = density > 0.0 ? FILTERED_SKIRT : 0.0;
    uint depth = floatBitsToUint(small.depth);
    for (float y = low.y + 0.5; y < high.y; y += 1.0) {
        float away_y = abs(y - center.y);
        float own_y = density * overlap(extent.y, away_y);
        float square_y = skirt * overlap(side, away_y);
        uint at = index_of(ivec2(low.x, y));
        for (float x = low.x + 0.5; x < high.x; x += 1.0) {
            float away_x = abs(x - center.x);
            float weight = min(own_y * overlap(extent.x, away_x) + square_y * overlap(side, away_x), MOST_WEIGHT);
            bool is_fine = weight < LEAST_COARSE;
            float steps = weight * (is_fine ? FINE_STEPS : COARSE_STEPS);
            // A loop of one turn or none, not a condition: software devices run both sides of a condition.
            for (bool is_seen = front[at] <= depth && weight > 0.0; is_seen; is_seen = false) {
                if (IS_GRAY) {
                    atomicAdd(sums[2u * at + uint(is_fine)], fixed_pair(splat.color[0] * steps, steps));
                } else {
                    uint word = 4u * at + 2u * uint(is_fine);
                    atomicAdd(sums[word], fixed_pair(splat.color[0] * steps, splat.color[1] * steps));
                    atomicAdd(sums[word + 1u], fixed_pair(splat.color[2] * steps, steps));
                }
            }
            ++at;
        }
    }
}
