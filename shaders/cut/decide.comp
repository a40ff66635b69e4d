#version 460
// Second of pass cut.pieces: which of the large triangles become pieces, as `filtered::triangle_subdivision` has it. What the
// list has no room for stays triangles, or splats of one piece where all are splats.
#include "common/cut.glsl"

layout(local_size_x = 1) in;

const float ANY_TRIANGLE_PX = 3e38;

void main() {
    uint within = counters.pieces_within;
    uint beyond = counters.pieces_beyond;
    uint own = counters.splats;
    uint taken = min(own + counters.named, cut.most_splats);
    uint free = cut.most_splats - taken;
    bool has_room = within <= free;
    bool has_all_room = has_room && counters.are_too_many == 0u && beyond <= free - within;
    float taken_px = 0.0;
    float halved_px = LARGEST_PIECED_PX;
    if (cut.are_pieces != 0u) {
        taken_px = ANY_TRIANGLE_PX;
        halved_px = has_all_room ? LARGEST_PIECED_PX : 0.0;
    } else {
        uint some = 0u;
        precise float least = LEAST_SMALL_SHARE * float(counters.named);
        if (has_room && float(counters.named_small) >= least) {
            taken_px = LARGEST_PIECED_PX;
            some = within;
        }
        if (has_all_room && within + beyond - some <= own + some) {
            taken_px = ANY_TRIANGLE_PX;
            halved_px = ANY_TRIANGLE_PX;
        }
    }
    counters.taken_px = taken_px;
    counters.halved_px = halved_px;
}
