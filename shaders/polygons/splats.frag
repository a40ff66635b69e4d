#version 460
// A splat cut at sharp edges: lit in each pixel, round where no edge cuts it.
#include "common/polygon_shade.glsl"

layout(location = 0) in vec3 position_in_view;
layout(location = 1) in vec3 normal_in_view;
layout(location = 2) in vec3 base;
layout(location = 3) in vec2 uv;
layout(location = 4) flat in vec2 bound_and_share;

layout(location = 0) out vec4 color;
#ifdef NORMALS
layout(location = 1) out vec4 normal;
#endif

void main() {
    if (dot(uv, uv) > bound_and_share.x) {
        discard;
    }
    vec3 n = unit_or_zero(normal_in_view);
    vec3 of_surface = clamp(base, vec3(0.0), vec3(1.0));
    color = vec4(shade_polygon(position_in_view, n, of_surface, bound_and_share.y, vec3(1.0, 0.2, 0.2)), 1.0);
#ifdef NORMALS
    normal = vec4(n * mat3(frame.view_from_model) / frame.model_scale, 1.0);
#endif
}
