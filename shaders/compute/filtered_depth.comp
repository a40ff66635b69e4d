#version 460
// Pass filtered.depth of small splats: the nearest pushed depth of each pixel.
#include "common/filtered_record.glsl"
#include "common/push.glsl"
#include "common/square.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 3, std430) buffer Front {
    // Reversed depth as bits.
    uint front[];
};

void main() {
    uint item = ITEM;
    if (item >= list.count) {
        return;
    }
    FilteredRecord splat = splats[list.begin + item];
    vec4 center_in_view = frame.view_from_model * vec4(splat.center[0], splat.center[1], splat.center[2], 1.0);
    // Near and far are those of the center itself, as in the blend pass.
    vec4 unpushed = frame.clip_from_view * center_in_view;
    if (!(unpushed.z >= 0.0 && unpushed.z <= unpushed.w && unpushed.w > 0.0)) {
        return;
    }
    vec4 clip = clip_of_pushed(push_away(center_in_view.xyz, splat.offset * frame.model_scale));
    Square square = square_around(window_of(clip), frame.splat_size_px);
    uint depth = floatBitsToUint(clip.z / clip.w);
    for (int y = square.first.y; y < square.end.y; ++y) {
        for (int x = square.first.x; x < square.end.x; ++x) {
            uint pixel = uint(y) * list.size_px.x + uint(x);
            if (front[pixel] < depth) {
                atomicMax(front[pixel], depth);
            }
        }
    }
}
