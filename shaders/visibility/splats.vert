#version 460
// Passes visibility.depth and visibility.centers: the splats of the draw list.
#include "common/visibility_splat.glsl"

layout(location = 0) in vec3 center;
layout(location = 1) in float radius;
layout(location = 2) in vec2 normal;
layout(location = 3) in vec4 color;

void main() {
    emit_splat(center, radius, normal, color);
}
