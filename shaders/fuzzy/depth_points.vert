#version 460
// Pass fuzzy.depth, every vertex of the mesh with the frame's constant size.
#include "common/fuzzy_depth.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec2 normal;
layout(location = 2) in vec4 color;

void main() {
    emit_depth(position, 0.0, normal, color.a);
}
