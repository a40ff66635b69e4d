#version 460
// Pass cut.tree, first: nothing is chosen, and the root is to be looked at.
#include "common/cut.glsl"

layout(local_size_x = 1) in;

layout(set = 0, binding = 2, std430) writeonly buffer Root {
    uvec2 root[];
};

void main() {
    counters.splats = 0u;
    counters.splat_instances = 1u;
    counters.first_splat = 0u;
    counters.first_splat_instance = 0u;
    // Two triangles each.
    counters.quad_vertices = 6u;
    counters.quads = 0u;
    counters.first_quad_vertex = 0u;
    counters.first_quad = 0u;
    counters.indices = 0u;
    counters.index_instances = 1u;
    counters.first_index = 0u;
    counters.vertex_offset = 0;
    counters.first_index_instance = 0u;
    counters.groups_x = 1u;
    counters.groups_y = 1u;
    counters.groups_z = 1u;
    counters.groups = 1u;
    counters.opened = 0u;
    counters.visited = 0u;
    counters.outside = 0u;
    counters.facing_away = 0u;
    counters.small = 0u;
    counters.named = 0u;
    counters.named_small = 0u;
    counters.pieces_within = 0u;
    counters.pieces_beyond = 0u;
    counters.are_too_many = 0u;
    root[0] = uvec2(0u, 1u | (cut.start << COUNT_BITS));
}
