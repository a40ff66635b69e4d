#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass compute.triangles: triangles of a few pixels leave their depth and number in the pixels they cover; the nearest
// stays, of equals the first of the list. Every corner lies before the eye (the host sees to it).
#include "common/vertex_record.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 4, std430) buffer Nearest {
    uint64_t nearest[];
};

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
    uint low_half = ~(list.first + item);
    for (int y = range.y; y < range.w; ++y) {
        for (int x = range.x; x < range.z; ++x) {
            ivec3 e = edges(small, ivec2(x, y));
            if (any(lessThan(e, least))) {
                continue;
            }
            uint64_t key = (uint64_t(floatBitsToUint(depth_at(small, e))) << 32) | uint64_t(low_half);
            uint pixel = index_of(ivec2(x, y));
            if (nearest[pixel] < key) {
                atomicMax(nearest[pixel], key);
            }
        }
    }
}
