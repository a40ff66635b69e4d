#version 460
// Headlight shading of an interpolated normal. The direction to the eye depends on the pixel alone, so no
// position is interpolated.
#include "common/headlight.glsl"

layout(location = 0) in vec3 normal_in_view;
layout(location = 1) in vec3 vertex_color;

layout(location = 0) out vec4 color;
layout(location = 1) out vec4 normal;

// Whether the pass has a target for normals.
layout(constant_id = 0) const bool WRITE_NORMALS = false;
// Whether vertices have colors.
layout(constant_id = 1) const bool HAS_COLORS = true;

void main() {
    float squared = dot(normal_in_view, normal_in_view);
    vec3 n = squared > 0.0 ? normal_in_view * inversesqrt(squared) : vec3(0.0);
    vec3 l = vec3(0.0, 0.0, 1.0);
    if ((frame.flags & FLAG_PARALLEL_LIGHT) == 0u) {
        l = -normalize(vec3(gl_FragCoord.xy * frame.ray_scale + frame.ray_offset, -1.0));
    }
    vec3 base = HAS_COLORS ? vertex_color : vec3(1.0);
    color = vec4(headlight(n, l, base, vec3(0.2, 0.35, 1.0)), 1.0);
    if (WRITE_NORMALS) {
        normal = vec4(n * mat3(frame.view_from_model) / frame.model_scale, 1.0);
    }
}
