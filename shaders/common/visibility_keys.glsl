// What compute leaves of visibility splats in the pixels of the rectangle, and how their records read.
#include "common/splat_record.glsl"
#include "common/visibility_shade.glsl"
#include "common/visible_key.glsl"

Seen seen_record(SplatRecord splat, vec4 color) {
    vec3 center = vec3(splat.center[0], splat.center[1], splat.center[2]);
    ivec2 code = ivec2(splat.normal << 16, splat.normal) >> 16;
    return seen_splat(center, splat.radius, max(vec2(code) / 32767.0, -1.0), color);
}
