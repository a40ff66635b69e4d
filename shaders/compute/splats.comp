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
// No square has a radius of its own.
layout(constant_id = 2) const bool HAS_ONE_SIZE = false;
// The one size is a pixel.
layout(constant_id = 3) const bool IS_PIXEL = false;

layout(set = 0, binding = 3, std430) buffer Nearest {
    // Reversed depth as bits (non-negative floats order like integers) above the complement of the number; 0: nothing.
    uint64_t nearest[];
};

// Clip position, without the entries that are zero in every projection.
vec4 clip_of(vec3 in_view) {
    mat4 m = frame.clip_from_view;
    return vec4(
        m[0][0] * in_view.x + m[2][0] * in_view.z + m[3][0],
        m[1][1] * in_view.y + m[2][1] * in_view.z + m[3][1],
        m[2][2] * in_view.z + m[3][2],
        m[2][3] * in_view.z + m[3][3]
    );
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
    vec3 center = vec3(splats[own].center[0], splats[own].center[1], splats[own].center[2]);
    vec3 center_in_view = vec3(0.0);
    vec4 at;
    vec3 window;
    if (ARE_DISCS) {
        // As the rasterizer finds them, to the bit: at the rim of a circle a last place decides.
        center_in_view = (frame.view_from_model * vec4(center, 1.0)).xyz;
        at = clip_of(center_in_view);
        window = vec3(window_of(at), at.z / at.w);
    } else {
        at = frame.window_from_model * vec4(center, 1.0);
        window = at.xyz / at.w;
    }
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
    Disc disc = Disc(vec2(0.0), vec3(0.0), vec2(0.0), side);
    if (ARE_DISCS) {
        float distance = has_flag(FLAG_ORTHOGRAPHIC) ? 1.0 : -center_in_view.z;
        float radius = radius_in_view(splats[own].radius, center_in_view);
        disc = circle(center_in_view, radius * frame.focal_px / distance);
        side = disc.size_px;
    } else if (!HAS_ONE_SIZE && splats[own].radius > 0.0) {
        // The last component is the distance, or 1 in an orthographic view.
        side = 2.0 * frame.focal_px * splats[own].radius * frame.model_scale / at.w;
    }
    Square square = square_around(window.xy, side);
    ivec2 size = max(square.end - square.first, ivec2(0));
    // One loop over all pixels, row by row.
    uint pixel = index_of(square.first);
    uint to_next_row = list.rect_px.z - list.rect_px.x - uint(size.x) + 1u;
    vec2 to_first = vec2(square.first) + 0.5 - disc.center_px;
    ivec2 step = ivec2(0);
    for (int left = is_drawn ? size.x * size.y : 0; left > 0; --left) {
        if (!ARE_DISCS || !(rho_squared(disc.form, vec2(0.0), to_first + vec2(step)) > 1.0)) {
            leave(pixel, key);
        }
        bool is_end = ++step.x == size.x;
        pixel += is_end ? to_next_row : 1u;
        step = is_end ? ivec2(0, step.y + 1) : step;
    }
}
