// What compute leaves of visibility splats in the pixels of the rectangle, and how their records read.
#include "common/splat_record.glsl"
#include "common/visibility_shade.glsl"

Seen seen_record(SplatRecord splat, vec4 color) {
    vec3 center = vec3(splat.center[0], splat.center[1], splat.center[2]);
    ivec2 code = ivec2(splat.normal << 16, splat.normal) >> 16;
    return seen_splat(center, splat.radius, max(vec2(code) / 32767.0, -1.0), color);
}

// Reversed depth as bits above the number in the list: floats that are not negative order like integers. 0 is nothing.
// The number is as it is for centers, of which of equals the last of the list stays, and its complement for footprints,
// of which the first does: as the passes of the rasterizer have it.
uint64_t key_of(float depth, uint number) {
    return packUint2x32(uvec2(number, floatBitsToUint(depth)));
}
