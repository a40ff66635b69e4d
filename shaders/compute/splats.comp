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

layout(set = 0, binding = 3, std430) buffer Nearest {
    // Reversed depth as bits (non-negative floats order like integers) above the complement of the number; 0: nothing.
    uint64_t nearest[];
};

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    SplatRecord splat = splats[list.begin + item];
    vec3 center = vec3(splat.center[0], splat.center[1], splat.center[2]);
    vec4 center_in_view = frame.view_from_model * vec4(center, 1.0);
    vec4 clip = frame.clip_from_view * center_in_view;
    // The view volume in depth, and nothing that is not finite.
    if (!(clip.z >= 0.0 && clip.z <= clip.w && clip.w > 0.0)) {
        return;
    }
    float distance = (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? 1.0 : -center_in_view.z;
    float side = frame.splat_size_px;
    Disc disc;
    if (ARE_DISCS) {
        disc = circle(center_in_view.xyz, radius_in_view(splat.radius, center_in_view.xyz) * frame.focal_px / distance);
        side = disc.size_px;
    } else if (splat.radius > 0.0) {
        side = 2.0 * frame.focal_px * splat.radius * frame.model_scale / distance;
    }
    Square square = square_around(window_of(clip), side);
    float depth = clip.z / clip.w;
    uint64_t key = (uint64_t(floatBitsToUint(depth)) << 32) | uint64_t(~((list.first + item) | SPLAT_BIT));
    for (int y = square.first.y; y < square.end.y; ++y) {
        for (int x = square.first.x; x < square.end.x; ++x) {
            if (ARE_DISCS && rho_squared(disc.form, vec2(0.0), vec2(x, y) + 0.5 - disc.center_px) > 1.0) {
                continue;
            }
            uint pixel = index_of(ivec2(x, y));
            // A look first: most squares of a dense surface lose, and an atomic costs more than a read.
            if (nearest[pixel] < key) {
                atomicMax(nearest[pixel], key);
            }
        }
    }
}
