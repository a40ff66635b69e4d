#version 460
// Pass visibility.depth, splats from vertices: lit in each pixel, a hole until a center fills it.
#include "common/visibility.glsl"
#include "common/polygon_shade.glsl"

layout(location = 0) in vec3 position_in_view;
layout(location = 1) in vec3 normal_in_view;
layout(location = 2) in vec3 base;
layout(location = 3) in vec2 uv;
layout(location = 4) flat in vec3 bound_share_offset;

layout(location = 0) out vec4 picked;
layout(location = 1) out vec4 fronts;
#ifdef NORMALS
layout(location = 2) out vec4 normal;
#endif

void main() {
    if (dot(uv, uv) > bound_share_offset.x) {
        discard;
    }
    vec3 n = unit_or_zero(normal_in_view);
    vec3 of_surface = clamp(base, vec3(0.0), vec3(1.0));
    vec3 shown = shade_polygon(position_in_view, n, of_surface, bound_share_offset.y, vec3(1.0, 0.2, 0.2));
    picked = vec4(shown, HOLE);
    fronts = vec4(-position_in_view.z, bound_share_offset.z, 0.0, 0.0);
#ifdef NORMALS
    normal = vec4(n * mat3(frame.view_from_model) / frame.model_scale, 1.0);
#endif
}
