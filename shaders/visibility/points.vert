#version 460
// Passes visibility.depth and visibility.centers: every vertex of the mesh as a splat of constant size.
#include "common/visibility_splat.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec2 normal;
layout(location = 2) in vec4 color;

void main() {
    emit_splat(position, 0.0, normal, color);
}
