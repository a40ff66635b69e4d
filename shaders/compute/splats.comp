#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass compute.splats: every square or disc leaves its depth and number in the pixels it covers; the nearest stays, of
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
// None has a radius of its own, and the one size, rounded up, is that many pixels: 1 to 7; else 0.
layout(constant_id = 2) const uint SIDE_PX = 0u;
// Larger ones count their pixels.
const int MOST_UNROLLED = 4;
const int SIDE = int(SIDE_PX);

layout(set = 0, binding = 3, std430) buffer Nearest {
    // Reversed depth as bits (non-negative floats order like integers) above the complement of the number; 0: nothing.
    uint64_t nearest[];
};

// Depth and last component in clip space, as the rasterizer finds them to the bit: where two splats are as near as rounding
// tells them apart, both shall show the same one. No projection has anything else in these rows.
vec4 clip_of_depth(float z_in_view) {
    mat4 m = frame.clip_from_view;
    return vec4(0.0, 0.0, m[2][2] * z_in_view + m[3][2], m[2][3] * z_in_view + m[3][3]);
}

void leave(uint pixel, uint64_t key) {
    if (!LOOKS_FIRST || nearest[pixel] < key) {
        atomicMax(nearest[pixel], key);
    }
}

// Whether an offset from the center is inside; the steps of `rho_squared`.
bool is_in(float form, vec2 offset) {
    return !ARE_DISCS || form * offset.x * offset.x + form * offset.y * offset.y <= 1.0;
}

void main() {
    uint item = ITEM;
    // One condition at the end instead of returns: each return costs a software device a nanosecond.
    uint own = list.begin + min(item, list.count - 1u);
    vec3 center = vec3(splats[own].center[0], splats[own].center[1], splats[own].center[2]);
    vec4 clip = clip_of_depth((frame.view_from_model * vec4(center, 1.0)).z);
    vec3 window = vec3((frame.window_from_model * vec4(center, 1.0)).xy, clip.z) / clip.w;
    uint64_t key = packUint2x32(uvec2(~((list.first + item) | SPLAT_BIT), floatBitsToUint(window.z)));
    // The view volume in depth, and nothing that is not finite.
    bool is_drawn = item < list.count && clip.z >= 0.0 && clip.z <= clip.w && clip.w > 0.0;
    if (SIDE == 1 && !ARE_DISCS) {
        // What square_around gives: pixel i if 256 i < the rounded 256 window <= 256 (i + 1).
        vec2 in_rect = ceil(window.xy - 1.0 / 512.0) - 1.0 - vec2(list.rect_px.xy);
        vec2 size = vec2(list.rect_px.zw - list.rect_px.xy);
        if (is_drawn && in_rect.x >= 0.0 && in_rect.y >= 0.0 && in_rect.x < size.x && in_rect.y < size.y) {
            leave(uint(in_rect.y) * uint(size.x) + uint(in_rect.x), key);
        }
        return;
    }
    float side = 2.0 * radius_px_of(SIDE > 0 ? 0.0 : splats[own].radius, clip.w);
    Square square = square_around(window.xy, side);
    // What is too small for a circle is a square, as `circle_at` has it.
    bool is_round = ARE_DISCS && (SIDE > 2 || side >= LEAST_ROUND_PX);
    float form = 0.0;
    if (ARE_DISCS) {
        form = is_round ? 4.0 / (side * side) : 0.0;
        vec2 first = clamp(ceil(window.xy - 0.5 * side - 0.5), vec2(list.rect_px.xy), vec2(list.rect_px.zw));
        vec2 end = clamp(floor(window.xy + 0.5 * side + 0.5), vec2(list.rect_px.xy), vec2(list.rect_px.zw));
        square.first = is_round ? ivec2(first) : square.first;
        square.end = is_round ? ivec2(end) : square.end;
    }
    ivec2 size = max(square.end - square.first, ivec2(0));
    uint pixel = index_of(square.first);
    uint width = list.rect_px.z - list.rect_px.x;
    vec2 to_first = vec2(square.first) + 0.5 - window.xy;
    int pixels = is_drawn ? size.x * size.y : 0;
    if (SIDE > 0 && SIDE <= MOST_UNROLLED) {
        // Pixel by pixel without counting. More than the usual ones lie at the rim of a circle between them, if at all.
        bool is_usual = pixels > 0 && max(size.x, size.y) <= SIDE;
        for (int y = 0; y < SIDE; ++y) {
            for (int x = 0; x < SIDE; ++x) {
                bool is_inside = x < size.x && y < size.y && is_in(form, to_first + vec2(x, y));
                if (is_usual && is_inside) {
                    leave(pixel + uint(x) + uint(y) * width, key);
                }
            }
        }
        pixels = is_usual ? 0 : pixels;
    }
    // One loop over all pixels, row by row.
    ivec2 step = ivec2(0);
    for (; pixels > 0; --pixels) {
        if (is_in(form, to_first + vec2(step))) {
            leave(pixel, key);
        }
        bool is_end = ++step.x == size.x;
        pixel += is_end ? width - uint(size.x) + 1u : 1u;
        step = is_end ? ivec2(0, step.y + 1) : step;
    }
}
