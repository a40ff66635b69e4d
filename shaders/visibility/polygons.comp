#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass visibility.polygons: every splat from a vertex leaves its pushed depth and number in the pixels that it covers, and the
// depth of its middle and number in one; the nearest of each stays, as in visibility.splats. A workgroup shares the pixels of
// one splat.
#include "common/polygon_record.glsl"
#include "common/polygon_center.glsl"
#include "common/disc_pixels.glsl"
#include "common/footprint_pixels.glsl"
#include "common/visible_key.glsl"

layout(local_size_x = 32) in;

// Look at a key before the atomic; on a software device the look costs more than it spares.
layout(constant_id = 0) const bool LOOKS_FIRST = false;

layout(set = 0, binding = 3, std430) buffer Footprints {
    uint64_t footprints[];
};

layout(set = 0, binding = 4, std430) buffer Centers {
    uint64_t centers[];
};

void leave_center(vec3 middle, uint number) {
    bool is_gone;
    vec4 clip = clip_of_center(center_in_view(), middle, is_gone);
    Square square = square_around(place_of(clip), 1.0);
    if (!is_gone && clip.w > 0.0 && all(lessThan(square.first, square.end))) {
        uint pixel = index_of(square.first);
        uint64_t key = key_of(clip.z / clip.w, number);
        if (!LOOKS_FIRST || centers[pixel] < key) {
            atomicMax(centers[pixel], key);
        }
    }
}

void main() {
    uint item = ITEM / gl_WorkGroupSize.x;
    if (item >= list.count) {
        return;
    }
    read_polygon(list.begin + item);
    DiscPlane own = disc_plane();
    uint number = list.first + item;
    if (gl_LocalInvocationID.x == 0u) {
        leave_center(own.middle, number);
    }
    vec2 push = push_of(own.middle);
    ivec4 pixels = faces_away(own.middle) ? ivec4(0) : pixels_of_disc();
    int width = pixels.z - pixels.x;
    int count = max(width, 0) * max(pixels.w - pixels.y, 0);
    for (int i = int(gl_LocalInvocationID.x); i < count; i += int(gl_WorkGroupSize.x)) {
        ivec2 at = pixels.xy + ivec2(i % width, i / width);
        DiscPixel seen;
        bool is_covered = disc_pixel(own, vec2(at) + 0.5, seen);
        // What is pushed beyond the far plane hides nothing.
        float depth = is_covered ? min(pushed_depth(seen.position, push), 1.0) : 0.0;
        uint pixel = index_of(at);
        uint64_t key = key_of(depth, ~number);
        if (depth > 0.0 && (!LOOKS_FIRST || footprints[pixel] < key)) {
            atomicMax(footprints[pixel], key);
        }
    }
}
