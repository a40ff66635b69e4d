#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass small.resolve, triangles: shades the triangle that each pixel kept as `triangles/draw.frag` does.
#include "common/vertex_record.glsl"

layout(set = 0, binding = 4, std430) readonly buffer Nearest {
    uint64_t nearest[];
};

layout(location = 0) out vec4 color;
#ifdef NORMALS
layout(location = 1) out vec4 normal;
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uint64_t key = nearest[index_of(pixel)];
    uint number = ~uint(key);
    uint item = number - list.first;
    if (key == 0ul || (number & SPLAT_BIT) != 0u || item >= list.count) {
        discard;
    }
    Small small = set_up(list.begin + item);
    Surface surface = surface_at(small, edges(small, pixel));
    color = vec4(shade_pixel(false, gl_FragCoord, surface.normal, surface.color, TRIANGLE_TINT), 1.0);
#ifdef NORMALS
    normal = vec4(surface.normal * mat3(frame.view_from_model) / frame.model_scale, 1.0);
#endif
    gl_FragDepth = uintBitsToFloat(uint(key >> 32));
}
