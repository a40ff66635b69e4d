#version 460
// Pass fuzzy.blend, every vertex of the mesh with the frame's constant size. What a vertex stands for is unknown.
#include "common/fuzzy_blend.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec2 normal;
layout(location = 2) in vec4 color;

void main() {
    emit_blend(position, 0.0, normal, color, -1.0);
}
