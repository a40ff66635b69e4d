#version 460
// Pass filtered.depth of small triangles: the nearest pushed depth of each pixel.
#include "common/vertex_record.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 4, std430) buffer Front {
    // Reversed depth as bits.
    uint front[];
};

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    Small small = set_up(list.begin + item, true);
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
            uint depth = floatBitsToUint(depth_at(small, e));
            uint pixel = uint(y) * list.size_px.x + uint(x);
            if (front[pixel] < depth) {
                atomicMax(front[pixel], depth);
            }
        }
    }
}
