#version 460
// Pass lists.splats, of leaves that the device's cut listed from the end, because they may be too large for points: the
// records end the list too, in the order in which they were found. An invocation does one.
#include "common/constants.glsl"
#include "common/leaf_splat.glsl"

layout(local_size_x = 64) in;

// Counts of the cut, see `abi::CutCounters`.
layout(set = 0, binding = 7, std430) readonly buffer Counts {
    uint counts[];
};

void main() {
    uint quads = counts[QUADS_WORD];
    if (ITEM >= quads) {
        return;
    }
    // The room of the list.
    uint room = list.count;
    uvec2 named = splat_ids[room - 1u - ITEM];
    float area;
    SplatRecord splat = splat_of_leaf(named.x, named.y, area);
    write_splat(room - quads + ITEM, named.y, splat, area);
}
