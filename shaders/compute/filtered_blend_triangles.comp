#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass filtered.blend of small triangles: each covers its pixels whole, where it is not behind the front.
#include "common/fixed_sums.glsl"
#include "common/vertex_record.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 4, std430) buffer Sums {
    uint64_t sums[];
};

layout(set = 0, binding = 5) uniform sampler2D front;

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    Small small = set_up(list.begin + item, false);
    if (small.area == 0) {
        return;
    }
    ivec4 range = pixels_of(small);
    ivec3 least = least_edges(small);
    for (int y = range.y; y < range.w; ++y) {
        for (int x = range.x; x < range.z; ++x) {
            ivec3 e = edges(small, ivec2(x, y));
            if (any(lessThan(e, least))) {
                continue;
            }
            float depth = depth_at(small, e);
            uint pixel = uint(y) * list.size_px.x + uint(x);
            if (depth < texelFetch(front, ivec2(x, y), 0).r || uint(sums[2 * pixel + 1] >> 32) >= SUM_FULL) {
                continue;
            }
            vec3 color = shade(small, ivec2(x, y), e).color;
            atomicAdd(sums[2 * pixel], fixed_pair(color.r, color.g));
            atomicAdd(sums[2 * pixel + 1], fixed_pair(color.b, 1.0));
        }
    }
}
