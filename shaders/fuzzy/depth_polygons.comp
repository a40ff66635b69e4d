#version 460
// Pass fuzzy.depth by compute, splats from vertices: the nearest pushed depth of each pixel. A workgroup shares the pixels of
// one splat.
#include "common/polygon_record.glsl"
#include "common/push_polygon.glsl"
#include "common/disc_pixels.glsl"

layout(local_size_x = 32) in;

layout(set = 0, binding = 3, std430) buffer Front {
    // Reversed depth as bits: floats that are not negative order like integers.
    uint front[];
};

void main() {
    uint item = ITEM / gl_WorkGroupSize.x;
    if (item >= list.count) {
        return;
    }
    read_polygon(list.begin + item);
    DiscPlane disc = disc_plane();
    vec2 push = least_push_of(disc.middle);
    ivec4 pixels = faces_away(disc.middle) ? ivec4(0) : pixels_of_disc();
    int width = pixels.z - pixels.x;
    int count = max(width, 0) * max(pixels.w - pixels.y, 0);
    for (int i = int(gl_LocalInvocationID.x); i < count; i += int(gl_WorkGroupSize.x)) {
        ivec2 at = pixels.xy + ivec2(i % width, i / width);
        DiscPixel seen;
        bool is_covered = disc_pixel(disc, vec2(at) + 0.5, seen);
        // What is pushed beyond the far plane hides nothing.
        float depth = is_covered ? min(pushed_depth(seen.position, push), 1.0) : 0.0;
        uint pixel = index_of(at);
        // A look first: an atomic costs more than a read.
        if (depth > 0.0 && front[pixel] < floatBitsToUint(depth)) {
            atomicMax(front[pixel], floatBitsToUint(depth));
        }
    }
}
