#version 460
// Shading of an interpolated normal, in the color of an image.
#include "common/headlight.glsl"
#include "common/texels.glsl"

layout(location = 0) in vec3 normal_in_view;
layout(location = 1) in vec3 vertex_color;
layout(location = 2) in vec2 place;
layout(location = 3) flat in uint image;

layout(location = 0) out vec4 color;
#ifdef NORMALS
layout(location = 1) out vec4 normal;
#endif

// Whether vertices have colors.
layout(constant_id = 1) const bool HAS_COLORS = true;
// Whether a lamp lights the surface instead of the headlight.
layout(constant_id = 2) const bool HAS_LAMP = false;

void main() {
    float squared = dot(normal_in_view, normal_in_view);
    vec3 n = squared > 0.0 ? normal_in_view * inversesqrt(squared) : vec3(0.0);
    vec3 own = surface_color(image, place, dFdx(place), dFdy(place), vertex_color);
    vec3 base = HAS_COLORS ? own : vec3(1.0);
    color = vec4(shade_pixel(HAS_LAMP, gl_FragCoord, n, base, vec3(0.2, 0.35, 1.0)), 1.0);
#ifdef NORMALS
    normal = vec4(n * mat3(frame.view_from_model) / frame.model_scale, 1.0);
#endif
}
