#version 460
// Every vertex of the mesh as a disc or ellipse of constant size.
#include "common/round_splat.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec2 normal;
layout(location = 2) in vec4 color;

void main() {
    emit_round(position, 0.0, normal, color);
}
