#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass visibility.splats: every splat leaves its pushed depth and number in the pixels of its footprint, and its own depth
// and number in the pixel of its center; the nearest of each stays.
//
// No center looks at a footprint here: whether the nearest center of a pixel is hidden, the next pass finds out, and where
// it is all others are.
#include "common/visibility_keys.glsl"
#include "common/square.glsl"

layout(local_size_x = 64) in;

// Look at a key before the atomic; on a software device the look costs more than it spares.
layout(constant_id = 0) const bool LOOKS_FIRST = false;

layout(set = 0, binding = 3, std430) buffer Footprints {
    uint64_t footprints[];
};

layout(set = 0, binding = 4, std430) buffer Centers {
    uint64_t centers[];
};

// Window position of a clip position, in the steps of a rasterizer's viewport: where these round decides which pixels a
// splat of a pixel covers.
vec2 place_of(vec4 clip) {
    vec2 middle = 0.5 * (vec2(list.size_px) + 2.0 * list.guard_px);
    return clip.xy * (1.0 / clip.w) * middle + (middle - list.guard_px);
}

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
    Disc disc = footprint_of(seen, color.a);
    square = square_around(place_of(clip), disc.size_px);
    ivec2 size = max(square.end - square.first, ivec2(0));
    int pixels = is_drawn ? size.x * size.y : 0;
    // One loop over all pixels, row by row: of two, the inner one would take as many turns as the longest row of its
    // neighbors.
    uint pixel = index_of(square.first);
    uint to_next_row = list.rect_px.z - list.rect_px.x - uint(size.x) + 1u;
    vec2 from_center = vec2(square.first) + 0.5 - disc.center_px;
    float first = from_center.x;
    int left = size.x;
    for (; pixels > 0; --pixels) {
        if (rho_squared(disc.form, disc.skew, from_center) <= 1.0 && (!LOOKS_FIRST || footprints[pixel] < key)) {
            atomicMax(footprints[pixel], key);
        }
        --left;
        bool is_end = left == 0;
        pixel += is_end ? to_next_row : 1u;
        from_center = is_end ? vec2(first, from_center.y + 1.0) : from_center + vec2(1.0, 0.0);
        left = is_end ? size.x : left;
    }
}
