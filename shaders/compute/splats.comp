#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass small.splats: every square or disc leaves its depth and number in the pixels it covers; the nearest stays, of
// equals the first of the list.
#include "common/frame.glsl"
#include "common/round.glsl"
#include "common/splat_record.glsl"
#include "common/square.glsl"

layout(local_size_x = 64) in;

// Discs that face the viewer instead of squares.
layout(constant_id = 0) const bool ARE_DISCS = false;
// Look at a key before the atomic. Most squares of a dense surface lose, and where many invocations want one pixel only
// atomics make them wait for each other. On a software device the look costs more than it spares.
layout(constant_id = 1) const bool LOOKS_FIRST = false;

layout(set = 0, binding = 3, std430) buffer Nearest {
    // Reversed depth as bits (non-negative floats order like integers) above the complement of the number; 0: nothing.
    uint64_t nearest[];
};

// Clip position, without the entries that are zero in every projection: a software device takes longer to read a matrix
// than to multiply by it.
vec4 clip_of(vec3 in_view) {
    mat4 m = frame.clip_from_view;
    return vec4(
        m[0][0] * in_view.x + m[2][0] * in_view.z + m[3][0],
        m[1][1] * in_view.y + m[2][1] * in_view.z + m[3][1],
        m[2][2] * in_view.z + m[3][2],
        m[2][3] * in_view.z + m[3][3]
    );
}

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    SplatRecord splat = splats[list.begin + item];
    vec3 center = vec3(splat.center[0], splat.center[1], splat.center[2]);
    vec3 center_in_view = (frame.view_from_model * vec4(center, 1.0)).xyz;
    vec4 clip = clip_of(center_in_view);
    // The view volume in depth, and nothing that is not finite.
    if (!(clip.z >= 0.0 && clip.z <= clip.w && clip.w > 0.0)) {
        return;
    }
    float distance = (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? 1.0 : -center_in_view.z;
    float side = frame.splat_size_px;
    Disc disc = Disc(vec2(0.0), vec3(0.0), vec2(0.0), side);
    if (ARE_DISCS) {
        disc = circle(center_in_view, radius_in_view(splat.radius, center_in_view) * frame.focal_px / distance);
        side = disc.size_px;
    } else if (splat.radius > 0.0) {
        side = 2.0 * frame.focal_px * splat.radius * frame.model_scale / distance;
    }
    Square square = square_around(window_of(clip), side);
    ivec2 size = square.end - square.first;
    if (size.x <= 0 || size.y <= 0) {
        return;
    }
    float depth = clip.z / clip.w;
    uint64_t key = (uint64_t(floatBitsToUint(depth)) << 32) | uint64_t(~((list.first + item) | SPLAT_BIT));
    // One loop over all pixels, row by row.
    uint pixel = index_of(square.first);
    uint to_next_row = list.rect_px.z - list.rect_px.x - uint(size.x) + 1u;
    vec2 to_first = vec2(square.first) + 0.5 - disc.center_px;
    ivec2 at = ivec2(0);
    for (int left = size.x * size.y; left > 0; --left) {
        bool is_covered = !ARE_DISCS || !(rho_squared(disc.form, vec2(0.0), to_first + vec2(at)) > 1.0);
        if (is_covered && (!LOOKS_FIRST || nearest[pixel] < key)) {
            atomicMax(nearest[pixel], key);
        }
        bool is_end = ++at.x == size.x;
        pixel += is_end ? to_next_row : 1u;
        at = is_end ? ivec2(0, at.y + 1) : at;
    }
}
