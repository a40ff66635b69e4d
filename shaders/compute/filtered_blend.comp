#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass filtered.blend of small splats: each deposits its projected area where it is not behind the front.
#include "common/filtered_record.glsl"
#include "common/fixed_sums.glsl"
#include "common/square.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 3, std430) buffer Sums {
    uint64_t sums[];
};

layout(set = 0, binding = 4) uniform sampler2D front;

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    FilteredRecord splat = splats[list.begin + item];
    vec4 clip = frame.clip_from_view
        * (frame.view_from_model * vec4(splat.center[0], splat.center[1], splat.center[2], 1.0));
    if (!(clip.z >= 0.0 && clip.z <= clip.w && clip.w > 0.0)) {
        return;
    }
    float side = max(frame.splat_size_px, 1.0);
    Square square = square_around(window_of(clip), side);
    float depth = clip.z / clip.w;
    float weight = splat.area_px / (side * side);
    uint64_t red_green = fixed_pair(splat.color[0] * weight, splat.color[1] * weight);
    uint64_t blue_weight = fixed_pair(splat.color[2] * weight, weight);
    for (int y = square.first.y; y < square.end.y; ++y) {
        for (int x = square.first.x; x < square.end.x; ++x) {
            uint pixel = uint(y) * list.size_px.x + uint(x);
            if (depth < texelFetch(front, ivec2(x, y), 0).r || uint(sums[2 * pixel + 1] >> 32) >= SUM_FULL) {
                continue;
            }
            atomicAdd(sums[2 * pixel], red_green);
            atomicAdd(sums[2 * pixel + 1], blue_weight);
        }
    }
}
