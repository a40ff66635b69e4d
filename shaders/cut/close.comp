#version 460
// Last of passes cut.leaves and cut.pieces: how many workgroups expand and draw what was chosen, and where the quads and the
// large triangles begin. A dispatch has whole workgroups, so copies of the first item follow the last one: they are never nearer
// than it, and show nothing.
#include "common/cut.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 2, std430) buffer SplatIds {
    uvec2 splat_ids[];
};

layout(set = 0, binding = 3, std430) buffer Indices {
    uint indices[];
};

// Workgroups in one dimension that every device takes.
const uint MOST_WORKGROUPS = 65535u;

// A dispatch over so many items, 64 a workgroup; none for none.
uvec2 groups_of(uint items) {
    uint workgroups = (items + 63u) / 64u;
    uint rows = max((workgroups + MOST_WORKGROUPS - 1u) / MOST_WORKGROUPS, 1u);
    return uvec2((workgroups + rows - 1u) / rows, rows);
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    uvec2 of_splats = groups_of(counters.splats);
    uint end = min(of_splats.x * of_splats.y * 64u, cut.room - counters.quads - counters.named);
    for (uint i = counters.splats + lane; i < end; i += 64u) {
        splat_ids[i] = splat_ids[0];
    }
    uvec2 of_small = groups_of(counters.small);
    uint room = uint(indices.length()) / 3u;
    end = min(of_small.x * of_small.y * 64u, room - counters.indices / 3u);
    for (uint i = counters.small + lane; i < end; i += 64u) {
        indices[3u * i] = indices[0];
        indices[3u * i + 1u] = indices[1];
        indices[3u * i + 2u] = indices[2];
    }
    if (lane == 0u) {
        uvec2 of_quads = groups_of(counters.quads);
        uvec2 of_named = groups_of(counters.named);
        counters.first_quad = cut.room - counters.quads;
        counters.first_index = 3u * room - counters.indices;
        counters.splat_groups = uint[3](of_splats.x, of_splats.y, 1u);
        counters.quad_groups = uint[3](of_quads.x, of_quads.y, 1u);
        counters.small_groups = uint[3](of_small.x, of_small.y, 1u);
        counters.named_groups = uint[3](of_named.x, of_named.y, 1u);
    }
}
