#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass visibility.splats: every splat leaves its pushed depth and number in the pixels of its footprint, and its own depth
// and number in the pixel of its center; the nearest of each stays.
//
// No center looks at a footprint here: whether the nearest center of a pixel is hidden, the next pass finds out, and where
// it is all others are.
#include "common/footprint_pixels.glsl"
#include "common/visibility_keys.glsl"

layout(local_size_x = 64) in;

// Look at a key before the atomic; on a software device the look costs more than it spares.
layout(constant_id = 0) const bool LOOKS_FIRST = false;

layout(set = 0, binding = 3, std430) buffer Footprints {
    uint64_t footprints[];
};

layout(set = 0, binding = 4, std430) buffer Centers {
    uint64_t centers[];
};

void main() {
    uint item = ITEM;
    SplatRecord splat = splats[list.begin + min(item, list.count - 1u)];
    vec4 color = unpackUnorm4x8(splat.color);
    Seen seen = seen_record(splat, color);
    vec4 clip = clip_of_center(seen);
    // Near and far are those of the center itself; nothing that is not finite.
    bool is_drawn = item < list.count && clip.z >= 0.0 && clip.z <= clip.w && clip.w > 0.0;
    clip = before_far(clip);
    uint number = list.first + item;
    Square square = square_around(place_of(clip), 1.0);
    if (is_drawn && all(lessThan(square.first, square.end))) {
        uint pixel = index_of(square.first);
        uint64_t key = key_of(clip.z / clip.w, number);
        if (!LOOKS_FIRST || centers[pixel] < key) {
            atomicMax(centers[pixel], key);
        }
    }
    clip = clip_of_footprint(seen);
    uint64_t key = key_of(clip.z / clip.w, ~number);
    Walk walk = walk_over(unbounded_footprint_of(seen, color.a), place_of(clip));
    walk.pixels = is_drawn ? walk.pixels : 0;
    for (; walk.pixels > 0; go_on(walk)) {
        if (is_covered(walk) && (!LOOKS_FIRST || footprints[walk.pixel] < key)) {
            atomicMax(footprints[walk.pixel], key);
        }
    }
}
