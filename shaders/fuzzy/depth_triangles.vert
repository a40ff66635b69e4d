#version 460
// Pass fuzzy.depth: triangles into depth only, pushed away.
#include "common/pushed_triangle.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec2 normal;
layout(location = 2) in vec4 color;

invariant gl_Position;

void main() {
    // Alpha 0 marks a vertex without normal.
    gl_Position = clip_of_pushed_corner(position, normal, color.a != 0.0);
}
