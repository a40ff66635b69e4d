#version 460
// Pass lists.places: places in images of the patches that a draw list names, copied from those of all nodes. An invocation does
// one.
#include "common/constants.glsl"
#include "common/list.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 2, std430) readonly buffer PatchIds {
    uint ids[];
};

// Mirrored by `abi::PatchTexture`: of each two vectors.
layout(set = 0, binding = 3, std430) readonly buffer NodePlaces {
    uvec4 of_nodes[];
};

layout(set = 0, binding = 4, std430) writeonly buffer Places {
    uvec4 places[];
};

void main() {
    if (ITEM >= list.count) {
        return;
    }
    uint item = list.begin + ITEM;
    uint id = ids[item];
    places[2u * item] = of_nodes[2u * id];
    places[2u * item + 1u] = of_nodes[2u * id + 1u];
}
