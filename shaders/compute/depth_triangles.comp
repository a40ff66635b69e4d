#version 460
// Pass filtered.depth or fuzzy.depth by compute, triangles of a few pixels: the nearest depth of each pixel, pushed away
// beside fuzzy splats as `fuzzy/depth_triangles.vert` does. Every corner lies before the eye (the host sees to it).
#include "common/vertex_record.glsl"
#include "common/pushed_triangle.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 4, std430) buffer Front {
    // Reversed depth as bits: floats that are not negative order like integers.
    uint front[];
};

// Triangles are pushed away.
layout(constant_id = 1) const bool IS_PUSHED = false;

Small set_up_pushed(uint place) {
    uvec3 index = corners_of(place);
    vec4 clip[3];
    for (int i = 0; i < 3; ++i) {
        VertexRecord v = vertices[index[i]];
        // Alpha 0 marks a vertex without normal.
        clip[i] = clip_of_pushed_corner(position_of(v), unpackSnorm2x16(v.normal), (v.color >> 24) != 0u);
    }
    return set_up_at(index, clip);
}

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    uint place = list.begin + item;
    Small small = IS_PUSHED ? set_up_pushed(place) : set_up(place);
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
            uint at = index_of(ivec2(x, y));
            // A look first: an atomic costs more than a read.
            if (front[at] < depth) {
                atomicMax(front[at], depth);
            }
        }
    }
}
