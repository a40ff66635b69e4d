#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass visibility.resolve, splats from vertices: what compute kept of each pixel, as `visibility/resolve.frag` has it; a
// footprint is lit where the pixel sees it.
#include "common/polygon_record.glsl"
#include "common/polygon_center.glsl"
#include "common/disc_plane.glsl"

layout(set = 0, binding = 3, std430) readonly buffer Footprints {
    uint64_t footprints[];
};

layout(set = 0, binding = 4, std430) readonly buffer Centers {
    uint64_t centers[];
};

layout(location = 0) out vec4 picked;
layout(location = 1) out vec4 fronts;
#ifdef NORMALS
layout(location = 2) out vec4 normal_of_surface;
#endif

void main() {
    uint pixel = index_of(ivec2(gl_FragCoord.xy));
    uvec2 footprint_key = unpackUint2x32(footprints[pixel]);
    uvec2 center_key = unpackUint2x32(centers[pixel]);
    bool is_center = center_key.y >= footprint_key.y;
    uint item = (is_center ? center_key.x : ~footprint_key.x) - list.first;
    uint depth = is_center ? center_key.y : footprint_key.y;
    if (depth == 0u || item >= list.count) {
        discard;
    }
    read_polygon(list.begin + item);
    DiscPlane own = disc_plane();
    ShownMiddle shown;
    if (is_center) {
        shown = shown_center(center_in_view(), own.middle);
    } else {
        DiscPixel seen;
        disc_pixel(own, gl_FragCoord.xy, seen);
        vec3 n = unit_or_zero(mat3(frame.view_from_model) * disc_normal(seen.uv));
        vec2 front = vec2(-seen.position.z, polygon_offset(own.middle));
        shown = ShownMiddle(shade_disc(seen.position, n, seen.uv), n * mat3(frame.view_from_model) / frame.model_scale, front);
    }
    picked = vec4(shown.shade, is_center ? FOREGROUND : HOLE);
    fronts = vec4(shown.front, 0.0, 0.0);
#ifdef NORMALS
    normal_of_surface = vec4(shown.normal_in_model, 1.0);
#endif
    // Passes the test where it is not farther. A footprint must be nearer: a step less, so that of equals it is hidden.
    gl_FragDepth = uintBitsToFloat(is_center ? depth : depth - 1u);
}
