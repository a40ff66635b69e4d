#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass visibility.resolve: shades what compute kept of each pixel, once: its nearest center where no footprint of compute
// hides it, else its nearest footprint. The depth test tells whether what the rasterizer left is nearer.
//
// That is what visibility.depth and visibility.centers would leave of all of them in turn. A center that is seen covers the
// nearest footprint, wherever that is; and a center of the rasterizer that only these footprints hide is farther than the
// nearest of them, so the depth test takes it away.
#include "common/visibility_keys.glsl"

layout(set = 0, binding = 3, std430) readonly buffer Footprints {
    uint64_t footprints[];
};

layout(set = 0, binding = 4, std430) readonly buffer Centers {
    uint64_t centers[];
};

layout(location = 0) out vec4 picked;
layout(location = 1) out vec4 fronts;
#ifdef NORMALS
layout(location = 2) out vec4 normal;
#endif

void main() {
    uint pixel = index_of(ivec2(gl_FragCoord.xy));
    uvec2 footprint = unpackUint2x32(footprints[pixel]);
    uvec2 center = unpackUint2x32(centers[pixel]);
    bool is_center = center.y >= footprint.y;
    uint item = (is_center ? center.x : ~footprint.x) - list.first;
    uint depth = is_center ? center.y : footprint.y;
    if (depth == 0u || item >= list.count) {
        discard;
    }
    SplatRecord splat = splats[list.begin + item];
    Seen seen = seen_record(splat, unpackUnorm4x8(splat.color));
    picked = vec4(seen.shade, is_center ? FOREGROUND : HOLE);
    fronts = vec4(seen.front, 0.0, 0.0);
#ifdef NORMALS
    normal = vec4(seen.normal_in_model, 1.0);
#endif
    // Passes the test where it is not farther. A footprint must be nearer: a step less, so that of equals it is hidden.
    gl_FragDepth = uintBitsToFloat(is_center ? depth : depth - 1u);
}
