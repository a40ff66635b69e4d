#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass small.resolve, triangles: shades the triangle that each pixel kept as `triangles/draw.frag` does.
#include "common/headlight.glsl"
#include "common/octahedral.glsl"
#include "common/vertex_record.glsl"

layout(set = 0, binding = 4, std430) readonly buffer Nearest {
    uint64_t nearest[];
};

layout(location = 0) out vec4 color;
layout(location = 1) out vec4 normal;

// Whether the pass has a target for normals.
layout(constant_id = 0) const bool WRITE_NORMALS = false;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uint64_t key = nearest[uint(pixel.y) * list.size_px.x + uint(pixel.x)];
    uint number = ~uint(key);
    uint item = number - list.first;
    if (key == 0ul || (number & SPLAT_BIT) != 0u || item >= list.count) {
        discard;
    }
    Small small = set_up(list.begin + item);
    vec3 w = weights(small, pixel) * small.inverse_w;
    w /= w.x + w.y + w.z;
    vec3 normal_in_view = vec3(0.0);
    vec3 vertex_color = vec3(0.0);
    for (int i = 0; i < 3; ++i) {
        VertexRecord v = vertices[small.index[i]];
        vec4 rgba = unpackUnorm4x8(v.color);
        // Alpha 0 marks a vertex without normal: it leaves the others to decide.
        if (rgba.a != 0.0) {
            normal_in_view += w[i] * (mat3(frame.view_from_model) * octahedral_decode(unpackSnorm2x16(v.normal)));
        }
        vertex_color += w[i] * rgba.rgb;
    }
    float squared = dot(normal_in_view, normal_in_view);
    vec3 n = squared > 0.0 ? normal_in_view * inversesqrt(squared) : vec3(0.0);
    vec3 l = vec3(0.0, 0.0, 1.0);
    if ((frame.flags & FLAG_PARALLEL_LIGHT) == 0u) {
        l = -normalize(vec3(gl_FragCoord.xy * frame.ray_scale + frame.ray_offset, -1.0));
    }
    color = vec4(headlight(n, l, vertex_color, vec3(0.2, 0.35, 1.0)), 1.0);
    if (WRITE_NORMALS) {
        normal = vec4(n * mat3(frame.view_from_model) / frame.model_scale, 1.0);
    }
    gl_FragDepth = uintBitsToFloat(uint(key >> 32));
}
