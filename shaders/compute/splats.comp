#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass small.splats: every square leaves its depth and number in the pixels it covers; the nearest stays, of equals
// the first of the list. Squares are those of the rasterizer: positions in steps of 1/256 pixel, a pixel belongs to
// the square that contains its center.
#include "common/frame.glsl"
#include "common/splat_record.glsl"

layout(local_size_x = 64) in;

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
    float side = frame.splat_size_px;
    if (splat.radius > 0.0) {
        float distance = (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? 1.0 : -center_in_view.z;
        side = 2.0 * frame.focal_px * splat.radius * frame.model_scale / distance;
    }
    vec2 size = vec2(list.size_px);
    vec2 window = window_of(clip);
    side = clamp(side, 1.0, 65536.0);
    // Too far beside the picture to reach into it; also keeps the integers below from overflowing.
    if (any(lessThan(window, vec2(-side))) || any(greaterThan(window, size + side)) || any(isnan(window))) {
        return;
    }
    int side_steps = int(roundEven(side * 256.0));
    ivec2 low = ivec2(roundEven(window * 256.0)) - side_steps / 2;
    // Center of pixel i: 256 i + 128 >= low  <=>  i >= (low + 127) >> 8.
    ivec2 first = max((low + 127) >> 8, ivec2(0));
    ivec2 end = min((low + side_steps + 127) >> 8, ivec2(list.size_px));
    float depth = clip.z / clip.w;
    uint64_t key = (uint64_t(floatBitsToUint(depth)) << 32) | uint64_t(~((list.first + item) | SPLAT_BIT));
    for (int y = first.y; y < end.y; ++y) {
        for (int x = first.x; x < end.x; ++x) {
            uint pixel = uint(y) * list.size_px.x + uint(x);
            // A look first: most squares of a dense surface lose, and an atomic costs more than a read.
            if (nearest[pixel] < key) {
                atomicMax(nearest[pixel], key);
            }
        }
    }
}
