#version 460
// Pass visibility.depth: triangles, pushed away by the offset of the largest splat at their depth.
#include "common/visibility_triangle.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec2 normal;
layout(location = 2) in vec4 color;

void main() {
    emit_corner(position, normal, color, false);
}
