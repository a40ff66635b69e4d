#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass polygons.nearest: every oriented polygon leaves its depth and number in the pixels it covers; the nearest stays, of
// equals the first of the list. A workgroup shares the pixels of one polygon.
#include "common/polygon_record.glsl"
#include "common/patch_setup.glsl"
#include "common/disc_pixels.glsl"

layout(local_size_x = 32) in;

// Patches of a cut by error; else splats from vertices.
layout(constant_id = 0) const bool ARE_PATCHES = false;
// Look at a key before the atomic; on a software device the look costs more than it spares.
layout(constant_id = 1) const bool LOOKS_FIRST = false;

layout(set = 0, binding = 3, std430) buffer Nearest {
    // Reversed depth as bits (non-negative floats order like integers) above the complement of the number; 0: nothing.
    uint64_t nearest[];
};

// Pixels of the rectangle around a patch.
ivec4 pixels_of_patch(PatchPlane own, PatchRectangle rectangle) {
    vec2 other = vec2(-rectangle.direction.y, rectangle.direction.x);
    vec2 low = vec2(ENDLESS);
    vec2 high = vec2(-ENDLESS);
    for (int i = 0; i < 4; i++) {
        vec2 at = rectangle.direction * ((i & 1) == 0 ? rectangle.ends.x : rectangle.ends.y)
            + other * ((i & 2) == 0 ? rectangle.across.x : rectangle.across.y);
        low = min(low, at);
        high = max(high, at);
    }
    // A rectangle that is widened along its sides reaches farther along the axes, at most by the root of 2.
    float margin = 1.4143 * own.limits.z;
    vec2 middle = own.shape_and_middle.zw;
    return pixels_between(middle + low - margin, middle + high + margin);
}

void main() {
    uint item = ITEM / gl_WorkGroupSize.x;
    if (item >= list.count) {
        return;
    }
    read_polygon(list.begin + item);
    PatchPlane patch_plane;
    PatchRectangle rectangle;
    DiscPlane disc;
    ivec4 pixels;
    if (ARE_PATCHES) {
        set_up_patch(patch_plane, rectangle);
        pixels = rectangle.is_gone ? ivec4(0) : pixels_of_patch(patch_plane, rectangle);
    } else {
        disc = disc_plane();
        pixels = faces_away(disc.middle) ? ivec4(0) : pixels_of_disc();
    }
    uint number = ~(list.first + item);
    int width = pixels.z - pixels.x;
    int count = max(width, 0) * max(pixels.w - pixels.y, 0);
    for (int i = int(gl_LocalInvocationID.x); i < count; i += int(gl_WorkGroupSize.x)) {
        ivec2 at = pixels.xy + ivec2(i % width, i / width);
        vec2 window = vec2(at) + 0.5;
        float depth = 0.0;
        bool is_covered;
        if (ARE_PATCHES) {
            PatchPixel seen;
            is_covered = patch_pixel(patch_plane, window, seen) && is_in_rectangle(patch_plane, rectangle, window);
            depth = seen.depth;
        } else {
            DiscPixel seen;
            is_covered = disc_pixel(disc, window, seen);
            depth = seen.depth;
        }
        uint pixel = index_of(at);
        uint64_t key = packUint2x32(uvec2(number, floatBitsToUint(depth)));
        if (is_covered && (!LOOKS_FIRST || nearest[pixel] < key)) {
            atomicMax(nearest[pixel], key);
        }
    }
}
