#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass fuzzy.blend by compute: each splat adds its color by its kernel where it is not behind the front.
#include "common/frame.glsl"
#include "common/fuzzy_record.glsl"
#include "common/fixed_sums.glsl"
#include "common/fuzzy_weight.glsl"
#include "common/square.glsl"

// A Gaussian in the plane of the surface, else weights of 1.
layout(constant_id = 0) const bool IS_GAUSS = false;
// The frame has a lamp instead of the headlight.
layout(constant_id = 6) const bool HAS_LAMP = false;

layout(local_size_x = 64) in;

layout(set = 0, binding = 3, std430) readonly buffer Front {
    uint front[];
};

layout(set = 0, binding = 4, std430) buffer Sums {
    uint64_t sums[];
};

vec3 color_of(uint64_t word) {
    uvec2 both = unpackUint2x32(word);
    if (HAS_LAMP) {
        return vec3(unpackUnorm2x16(both.x), unpackUnorm2x16(both.y).x);
    }
    return unpackUnorm4x8(both.x).rgb * uintBitsToFloat(both.y);
}

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    uint own = list.begin + item;
    Footprint print = footprint_at(own);
    if (IS_GAUSS) {
        print.inverse.xz += 4.0 * frame.low_pass_px * frame.low_pass_px;
    }
    print = at_least_a_pixel(print);
    Disc disc = print.disc;
    vec2 depth_area = floats_of(splats[own].depth_area);
    float middle = IS_GAUSS ? weight_in_middle(depth_area.y, disc) : 1.0;
    vec3 color = color_of(splats[own].color);
    Square square = rectangle_around(disc.center_px, print.sides_px);
    ivec2 size = max(square.end - square.first, ivec2(0));
    uint depth = floatBitsToUint(depth_area.x);
    uint at = index_of(square.first);
    uint to_next_row = list.rect_px.z - list.rect_px.x - uint(size.x) + 1u;
    vec2 from_center = vec2(square.first) + 0.5 - disc.center_px;
    float first = from_center.x;
    int left = size.x;
    for (int pixels = size.x * size.y; pixels > 0; --pixels) {
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
