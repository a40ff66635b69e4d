#version 460
// Third of pass cut.pieces: numbers of the pieces of triangles that become splats, after the other splats, and corners of the
// triangles that stay. An invocation looks at one triangle, then all of a workgroup write its pieces.
#include "common/cut_pieces.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 4, std430) readonly buffer Corners {
    uint corners[];
};

layout(set = 0, binding = 5, std430) writeonly buffer Indices {
    uint indices[];
};

// Of each triangle its number, the bits of its pieces, and where the pieces end that those up to it have.
shared uint ids[64];
shared uint bits[64];
shared uint ends[64];
// Triangles that stay such, and where they and the pieces go.
shared uint own_others;
shared uint others_at;
shared uint splats_at;

// Writes the pieces of all triangles of the workgroup, one after the other.
void write_pieces(uint lane) {
    for (uint i = lane; i < ends[63]; i += 64u) {
        // The first whose pieces end behind this one.
        uint at = 0u;
        for (uint half_size = 32u; half_size > 0u; half_size /= 2u) {
            at += ends[at + half_size - 1u] <= i ? half_size : 0u;
        }
        uint piece = i - (at > 0u ? ends[at - 1u] : 0u);
        if (splats_at + i < cut.most_splats) {
            splat_ids[splats_at + i] = uvec2(ids[at], bits[at] | piece);
        }
    }
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    if (lane == 0u) {
        own_others = 0u;
    }
    barrier();
    bool is_there = ITEM < counters.named;
    uint id = is_there ? named_triangle(ITEM) : 0u;
    float px = diameter_of(id);
    bool is_taken = is_there && px <= counters.taken_px;
    bool is_other = is_there && !is_taken;
    uint cuts = cuts_of(px, counters.halved_px);
    bool is_own = px > max(counters.halved_px, cut.threshold_px);
    ids[lane] = id;
    bits[lane] = LEAF | (is_own ? OF_OWN_SIZE : 0u) | ((cuts + 1u) << PIECE_CUTS);
    ends[lane] = is_taken ? 1u << (2u * cuts) : 0u;
    uint other = is_other ? atomicAdd(own_others, 1u) : 0u;
    // Sums of those before.
    for (uint reach = 1u; reach < 64u; reach *= 2u) {
        barrier();
        uint before = lane >= reach ? ends[lane - reach] : 0u;
        barrier();
        ends[lane] += before;
    }
    barrier();
    if (lane == 0u) {
        splats_at = atomicAdd(counters.splats, ends[63]);
        others_at = atomicAdd(counters.indices, 3u * own_others) / 3u;
    }
    barrier();
    write_pieces(lane);
    uint number = others_at + other;
    if (is_other && number < cut.most_triangles) {
        uint at = uint(indices.length()) / 3u - 1u - number;
        indices[3u * at] = corners[3u * id];
        indices[3u * at + 1u] = corners[3u * id + 1u];
        indices[3u * at + 2u] = corners[3u * id + 2u];
    }
}
