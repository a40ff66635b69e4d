#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass small.triangles: triangles of a few pixels leave their depth and number in the pixels they cover; the nearest
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
    ivec2 low = min(min(small.second, small.third), ivec2(0)) + small.origin;
    ivec2 high = max(max(small.second, small.third), ivec2(0)) + small.origin;
    // Center of pixel i: 256 i + 128 >= low  <=>  i >= (low + 127) >> 8; at most high  <=>  i <= (high - 128) >> 8.
    ivec2 first = max((low + 127) >> 8, ivec2(0));
    ivec2 last = min((high - 128) >> 8, ivec2(list.size_px) - 1);
    ivec3 rule = ivec3(
        outside_by_rule(small.second, small.third),
        outside_by_rule(small.third, ivec2(0)),
        outside_by_rule(ivec2(0), small.second)
    );
    uint low_half = ~(list.first + item);
    for (int y = first.y; y <= last.y; ++y) {
        for (int x = first.x; x <= last.x; ++x) {
            ivec2 point = ivec2(x, y) * 256 + 128 - small.origin;
            ivec3 e = ivec3(
                edge(small.second, small.third, point),
                edge(small.third, ivec2(0), point),
                edge(ivec2(0), small.second, point)
            );
            if (any(lessThan(e, rule))) {
                continue;
            }
            float depth = clamp(dot(vec3(e) / float(small.area), small.depth), 0.0, 1.0);
            uint64_t key = (uint64_t(floatBitsToUint(depth)) << 32) | uint64_t(low_half);
            uint pixel = uint(y) * list.size_px.x + uint(x);
            if (nearest[pixel] < key) {
                atomicMax(nearest[pixel], key);
            }
        }
    }
}
