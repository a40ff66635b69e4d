#version 460
// One disc or ellipse per splat of the draw list.
#include "common/round_splat.glsl"

layout(location = 0) in vec3 center;
layout(location = 1) in float radius;
layout(location = 2) in vec2 normal;
layout(location = 3) in vec4 color;

void main() {
    emit_round(center, radius, normal, color);
}
