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
// No splat has a radius of its own.
layout(constant_id = 2) const bool HAS_ONE_SIZE = false;
// The one size is a pixel.
layout(constant_id = 3) const bool IS_PIXEL = false;

layout(set = 0, binding = 3, std430) buffer Nearest {
    // Reversed depth as bits (non-negative floats order like integers) above the complement of the number; 0: nothing.
    uint64_t nearest[];
};

// Side of a square that contains the circle of a diameter, and the squared radius in which centers of pixels are covered.
vec2 circle_of(float diameter) {
    if (!(diameter >= LEAST_ROUND_PX)) {
        return vec2(max(diameter, 1.0), 1e9);
    }
    return vec2(diameter + 1.0 / 64.0, 0.25 * diameter * diameter);
}

void leave(uint pixel, uint64_t key) {
    if (!LOOKS_FIRST || nearest[pixel] < key) {
        atomicMax(nearest[pixel], key);
    }
}

void main() {
    uint item = ITEM;
    // One condition at the end instead of returns: each return costs a software device a nanosecond.
    uint own = list.begin + min(item, list.count - 1u);
    vec4 at = frame.window_from_model * vec4(splats[own].center[0], splats[own].center[1], splats[own].center[2], 1.0);
    vec3 window = at.xyz / at.w;
    uint64_t key = packUint2x32(uvec2(~((list.first + item) | SPLAT_BIT), floatBitsToUint(window.z)));
    // The view volume in depth, and nothing that is not finite.
    bool is_drawn = item < list.count && at.z >= 0.0 && at.z <= at.w && at.w > 0.0;
    if (IS_PIXEL) {
        // What square_around gives: pixel i if 256 i < the rounded 256 window <= 256 (i + 1).
        vec2 in_rect = ceil(window.xy - 1.0 / 512.0) - 1.0 - vec2(list.rect_px.xy);
        vec2 size = vec2(list.rect_px.zw - list.rect_px.xy);
        if (is_drawn && in_rect.x >= 0.0 && in_rect.y >= 0.0 && in_rect.x < size.x && in_rect.y < size.y) {
            leave(uint(in_rect.y) * uint(size.x) + uint(in_rect.x), key);
        }
        return;
    }
    float side = frame.splat_size_px;
    if (!HAS_ONE_SIZE && splats[own].radius > 0.0) {
        // The last component is the distance, or 1 in an orthographic view.
        side = 2.0 * frame.focal_px * splats[own].radius * frame.model_scale / at.w;
    }
    vec2 circle = circle_of(side);
    Square square = square_around(window.xy, ARE_DISCS ? circle.x : side);
    ivec2 size = max(square.end - square.first, ivec2(0));
    // One loop over all pixels, row by row.
    uint pixel = index_of(square.first);
    uint to_next_row = list.rect_px.z - list.rect_px.x - uint(size.x) + 1u;
    vec2 to_center = vec2(square.first) + 0.5 - window.xy;
    float first = to_center.x;
    int in_row = size.x;
    for (int left = is_drawn ? size.x * size.y : 0; left > 0; --left) {
        if (!ARE_DISCS || dot(to_center, to_center) <= circle.y) {
            leave(pixel, key);
        }
        bool is_end = --in_row == 0;
        pixel += is_end ? to_next_row : 1u;
        in_row = is_end ? size.x : in_row;
        if (ARE_DISCS) {
            to_center = is_end ? vec2(first, to_center.y + 1.0) : vec2(to_center.x + 1.0, to_center.y);
        }
    }
}
