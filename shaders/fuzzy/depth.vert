#version 460
// Pass fuzzy.depth, splats of the draw list.
#include "common/fuzzy_depth.glsl"

layout(location = 0) in vec3 center;
layout(location = 1) in float radius;
layout(location = 2) in vec2 normal;
layout(location = 3) in vec4 color;

void main() {
    emit_depth(center, radius, normal, color.a);
}
