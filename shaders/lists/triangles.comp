#version 460
// Pass lists.triangles: the corners of the triangles that a draw list names. An invocation does one.
#include "common/list.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 2, std430) readonly buffer TriangleIds {
    uint ids[];
};

layout(set = 0, binding = 3, std430) readonly buffer Corners {
    uint corners[];
};

layout(set = 0, binding = 4, std430) writeonly buffer Indices {
    uint indices[];
};

void main() {
    if (ITEM >= list.count) {
        return;
    }
    uint item = list.begin + ITEM;
    uint id = ids[item];
    indices[3u * item] = corners[3u * id];
    indices[3u * item + 1u] = corners[3u * id + 1u];
    indices[3u * item + 2u] = corners[3u * id + 2u];
}
