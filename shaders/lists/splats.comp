#version 460
// Pass lists.splats: what a draw list names becomes the records that are drawn, those that `draw::splats` would have written
// in its place. An invocation does one.
#include "common/leaf_splat.glsl"
#include "common/row.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 7, std430) readonly buffer Nodes {
    NodeRecord nodes[];
};

layout(set = 0, binding = 8, std430) readonly buffer Attributes {
    AttributesRecord attributes[];
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
    if ((part & LEAF) != 0u) {
        splat = splat_of_leaf(id, part, area);
    } else {
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
        // Its bits count a row, and say nothing of its size.
        part = 0u;
    }
    write_splat(item, part, splat, area);
}
