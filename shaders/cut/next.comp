#version 460
// Pass cut.tree, between two levels: what was opened is looked at next.
#include "common/cut.glsl"

layout(local_size_x = 1) in;

// Workgroups in one dimension that every device takes, and groups of siblings in a workgroup.
const uint MOST_WORKGROUPS = 65535u;
const uint GROUPS = 16u;

void main() {
    uint groups = counters.opened;
    uint workgroups = (groups + GROUPS - 1u) / GROUPS;
    uint rows = max((workgroups + MOST_WORKGROUPS - 1u) / MOST_WORKGROUPS, 1u);
    counters.groups_x = (workgroups + rows - 1u) / rows;
    counters.groups_y = rows;
    counters.groups = groups;
    counters.opened = 0u;
}
