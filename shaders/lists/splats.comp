#version 460
// Pass lists.splats: what a draw list names becomes the records that are drawn, those that `draw::splats` would have written
// in its place. An invocation does one.
#include "common/list.glsl"
#include "common/patch.glsl"
#include "common/row.glsl"

layout(local_size_x = 64) in;

// Splats have a radius of their own.
layout(constant_id = 0) const bool ARE_ORIENTED = false;
// Records end with the area that they stand for.
layout(constant_id = 1) const bool HAVE_AREAS = false;
// Leaves are triangles, not points.
layout(constant_id = 2) const bool HAVE_TRIANGLES = false;

const uint WORDS = HAVE_AREAS ? 7u : 6u;

// Bits of the second word, see `abi::SplatId`.
const uint LEAF = 1u << 31;
const uint OF_OWN_SIZE = 1u << 30;
const uint IN_PLANE = 1u << 29;

layout(set = 0, binding = 2, std430) readonly buffer SplatIds {
    uvec2 splat_ids[];
};

layout(set = 0, binding = 3, std430) readonly buffer Nodes {
    NodeRecord nodes[];
};

layout(set = 0, binding = 4, std430) readonly buffer Attributes {
    AttributesRecord attributes[];
};

layout(set = 0, binding = 5, std430) readonly buffer Leaves {
    LeafRecord leaves[];
};

layout(set = 0, binding = 6, std430) readonly buffer Corners {
    uint corners[];
};

layout(set = 0, binding = 7, std430) readonly buffer Vertices {
    VertexRecord vertices[];
};

layout(set = 0, binding = 8, std430) writeonly buffer Records {
    uint words[];
};

void main() {
    if (ITEM >= list.count) {
        return;
    }
    uint item = list.begin + ITEM;
    uint id = splat_ids[item].x;
    uint part = splat_ids[item].y;
    SplatRecord splat;
    float area = -1.0;
    if ((part & LEAF) == 0u) {
        AttributesRecord of = attributes[id];
        uint count = part >> 16;
        if (count == 0u) {
            splat = SplatRecord(nodes[id].center, of.splat_radius, of.normal, of.color);
            area = of.area;
        } else {
            splat = splat_of_row(nodes[id], of, count, part & 0xffffu);
            precise float piece = of.area / float(count);
            area = piece;
        }
    } else if (HAVE_TRIANGLES) {
        VertexRecord own[3] = VertexRecord[3](
            vertices[corners[3u * id]],
            vertices[corners[3u * id + 1u]],
            vertices[corners[3u * id + 2u]]
        );
        Patch patch_of_leaf = patch_of(own, (part & IN_PLANE) != 0u);
        splat = SplatRecord(leaves[id].center, leaves[id].radius, patch_of_leaf.normal, patch_of_leaf.color);
        area = patch_of_leaf.area;
    } else {
        splat = SplatRecord(vertices[id].position, leaves[id].radius, vertices[id].normal, vertices[id].color);
    }
    if (!ARE_ORIENTED && (part & OF_OWN_SIZE) == 0u) {
        splat.radius = 0.0;
    }
    uint at = WORDS * item;
    words[at] = floatBitsToUint(splat.center[0]);
    words[at + 1u] = floatBitsToUint(splat.center[1]);
    words[at + 2u] = floatBitsToUint(splat.center[2]);
    words[at + 3u] = floatBitsToUint(splat.radius);
    words[at + 4u] = splat.normal;
    words[at + 5u] = splat.color;
    if (HAVE_AREAS) {
        words[at + 6u] = floatBitsToUint(area);
    }
}
