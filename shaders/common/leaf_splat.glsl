// Splats of leaves that a draw list names: the list, the records, and how one is made and written.
#include "common/leaf_buffers.glsl"
#include "common/list.glsl"
#include "common/patch.glsl"
#include "common/splat.glsl"
#include "common/splat_id.glsl"

// Splats have a radius of their own.
layout(constant_id = 0) const bool ARE_ORIENTED = false;
// Records end with the area that they stand for.
layout(constant_id = 1) const bool HAVE_AREAS = false;

const uint WORDS = HAVE_AREAS ? 7u : 6u;

layout(set = 0, binding = 2, std430) readonly buffer SplatIds {
    uvec2 splat_ids[];
};

layout(set = 0, binding = 6, std430) writeonly buffer Records {
    uint words[];
};

// A leaf by the bits of its number, and the area of surface that it stands for, model units squared; negative for points, whose
// area is unknown.
SplatRecord splat_of_leaf(uint id, uint part, out float area) {
    if (HAVE_TRIANGLES) {
        VertexRecord own[3] = VertexRecord[3](
            vertices[corners[3u * id]],
            vertices[corners[3u * id + 1u]],
            vertices[corners[3u * id + 2u]]
        );
        Patch patch_of_leaf = patch_of(own, (part & IN_PLANE) != 0u);
        area = patch_of_leaf.area;
        return SplatRecord(leaves[id].center, leaves[id].radius, patch_of_leaf.normal, patch_of_leaf.color);
    }
    area = -1.0;
    return SplatRecord(vertices[id].position, leaves[id].radius, vertices[id].normal, vertices[id].color);
}

// Writes record number `at`, of an item with these bits.
void write_splat(uint at, uint part, SplatRecord splat, float area) {
    if (!ARE_ORIENTED && (part & OF_OWN_SIZE) == 0u) {
        splat.radius = 0.0;
    }
    uint first = WORDS * at;
    words[first] = floatBitsToUint(splat.center[0]);
    words[first + 1u] = floatBitsToUint(splat.center[1]);
    words[first + 2u] = floatBitsToUint(splat.center[2]);
    words[first + 3u] = floatBitsToUint(splat.radius);
    words[first + 4u] = splat.normal;
    words[first + 5u] = splat.color;
    if (HAVE_AREAS) {
        words[first + 6u] = floatBitsToUint(area);
    }
}
