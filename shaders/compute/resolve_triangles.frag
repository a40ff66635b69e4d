#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass small.resolve, triangles: shades the triangle that each pixel kept as `triangles/draw.frag` does.
#include "common/vertex_record.glsl"

layout(set = 0, binding = 4, std430) readonly buffer Nearest {
    uint64_t nearest[];
};

// Another light than the headlight, or data.
layout(constant_id = 0) const bool HAS_LAMP = false;

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
    float depth = uintBitsToFloat(uint(key >> 32));
    vec4 frag_coord = vec4(gl_FragCoord.xy, depth, surface.inverse_w);
    color = vec4(shade_pixel(HAS_LAMP, frag_coord, surface.normal, surface.color, TRIANGLE_TINT), 1.0);
#ifdef NORMALS
    normal = vec4(surface.normal * mat3(frame.view_from_model) / frame.model_scale, 1.0);
#endif
    gl_FragDepth = depth;
}
