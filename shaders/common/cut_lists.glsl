// What the passes that look at sibling groups read and write, an item at a time. A workgroup asks once for room in each list.
#include "common/cut.glsl"

layout(set = 0, binding = 2, std430) readonly buffer Groups {
    uvec2 groups[];
};

// Splats by number, as `abi::SplatId` has them.
layout(set = 0, binding = 3, std430) writeonly buffer SplatIds {
    uvec2 splat_ids[];
};

// How many of a kind a workgroup has, and where they go.
shared uint own_splats;
shared uint own_others;
shared uint own_counts[3];
shared uint splats_at;
shared uint others_at;

void begin_group() {
    if (gl_LocalInvocationIndex == 0u) {
        own_splats = 0u;
        own_others = 0u;
        own_counts = uint[3](0u, 0u, 0u);
    }
    barrier();
}

// Adds what this invocation found to the counts of its workgroup.
void count(bool is_there, bool is_dropped_outside, bool is_dropped_away) {
    if (is_there) {
        atomicAdd(own_counts[0], 1u);
    }
    if (is_dropped_outside) {
        atomicAdd(own_counts[1], 1u);
    }
    if (is_dropped_away) {
        atomicAdd(own_counts[2], 1u);
    }
}

// One atomic of the device for each list and workgroup.
void add_counts() {
    atomicAdd(counters.visited, own_counts[0]);
    atomicAdd(counters.outside, own_counts[1]);
    atomicAdd(counters.facing_away, own_counts[2]);
}
