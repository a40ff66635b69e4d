#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass filtered.blend or fuzzy.blend by compute, triangles of a few pixels: they cover a pixel whole, with weight 1, where
// they are not behind the front. Every corner lies before the eye (the host sees to it).
#include "common/vertex_record.glsl"
#include "common/fixed_sums.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 4, std430) readonly buffer Front {
    uint front[];
};

layout(set = 0, binding = 5, std430) buffer Sums {
    uint64_t sums[];
};

// Whether a lamp lights the surface instead of the headlight.
layout(constant_id = 0) const bool HAS_LAMP = false;

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    Small small = set_up(list.begin + item);
    if (small.area == 0) {
        return;
    }
    ivec4 range = pixels_of(small);
    ivec3 least = least_edges(small);
    for (int y = range.y; y < range.w; ++y) {
        for (int x = range.x; x < range.z; ++x) {
            ivec2 pixel = ivec2(x, y);
            ivec3 e = edges(small, pixel);
            if (any(lessThan(e, least))) {
                continue;
            }
            float depth = depth_at(small, e);
            uint at = index_of(pixel);
            if (front[at] <= floatBitsToUint(depth)) {
                Surface surface = surface_at(small, e);
                vec4 frag_coord = vec4(vec2(pixel) + 0.5, depth, surface.inverse_w);
                vec3 color = shade_pixel(HAS_LAMP, frag_coord, surface.normal, surface.color, TRIANGLE_TINT);
                Deposit deposit = deposit_of(at, color, 1.0);
                atomicAdd(sums[deposit.word], deposit.first);
                if (!IS_GRAY) {
                    atomicAdd(sums[deposit.word + 1u], deposit.second);
                }
            }
        }
    }
}
