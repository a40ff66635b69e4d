#version 460
// Pass fuzzy.blend, splats of the draw list.
#include "common/fuzzy_blend.glsl"

layout(location = 0) in vec3 center;
layout(location = 1) in float radius;
layout(location = 2) in vec2 normal;
layout(location = 3) in vec4 color;
layout(location = 4) in float area;

void main() {
    emit_blend(center, radius, normal, color, area);
}
