#version 460
// A triangle covers the pixel whole: its shade in the color of an image with weight 1.
#include "common/headlight.glsl"
#include "common/texels.glsl"

layout(location = 0) in vec3 normal_in_view;
layout(location = 1) in vec3 vertex_color;
layout(location = 2) in vec2 place;
layout(location = 3) flat in uint image;

layout(location = 0) out vec4 sums;

// Whether a lamp lights the surface instead of the headlight.
layout(constant_id = 0) const bool HAS_LAMP = false;

void main() {
    float squared = dot(normal_in_view, normal_in_view);
    vec3 n = squared > 0.0 ? normal_in_view * inversesqrt(squared) : vec3(0.0);
    vec3 own = surface_color(image, place, dFdx(place), dFdy(place), vertex_color);
    sums = vec4(shade_pixel(HAS_LAMP, gl_FragCoord, n, own, vec3(0.2, 0.35, 1.0)), 1.0);
}
