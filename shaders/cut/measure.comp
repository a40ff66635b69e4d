#version 460
// First of pass cut.pieces: counts the large triangles by their size on the screen, and the pieces that they would become. An
// invocation does one triangle.
#include "common/cut_pieces.glsl"

layout(local_size_x = 64) in;

// Counts of a workgroup: small triangles, and pieces of those up to the limit and of the others.
shared uint own[3];

// More pieces of one triangle than any list has room for; as many of each of a workgroup are a number still.
const uint TOO_MANY = 1u << 25;

void main() {
    if (gl_LocalInvocationIndex < 3u) {
        own[gl_LocalInvocationIndex] = 0u;
    }
    barrier();
    if (ITEM < counters.named) {
        float px = diameter_of(named_triangle(ITEM));
        bool is_beyond = px > LARGEST_PIECED_PX;
        float halved_px = cut.are_pieces != 0u ? LARGEST_PIECED_PX : ANY_TRIANGLE_PX;
        uint pieces = min(1u << (2u * cuts_of(px, halved_px)), TOO_MANY);
        if (px <= SMALL_PIECED_PX) {
            atomicAdd(own[0], 1u);
        }
        atomicAdd(own[is_beyond ? 2 : 1], pieces);
    }
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        atomicAdd(counters.named_small, own[0]);
        atomicAdd(counters.pieces_within, own[1]);
        uint before = atomicAdd(counters.pieces_beyond, own[2]);
        // The sum went over its end.
        if (before + own[2] < before) {
            atomicOr(counters.are_too_many, 1u);
        }
    }
}
