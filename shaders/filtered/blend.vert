#version 460
// Pass filtered.blend: squares that deposit their projected area, spread over their pixels.
#include "common/frame.glsl"

layout(location = 0) in vec3 center;
layout(location = 1) in vec3 color;
layout(location = 2) in float area_px;

layout(location = 0) flat out vec4 deposit;

invariant gl_Position;

void main() {
    gl_Position = frame.clip_from_view * (frame.view_from_model * vec4(center, 1.0));
    float side = max(frame.splat_size_px, 1.0);
    gl_PointSize = side;
    float weight = area_px / (side * side);
    deposit = vec4(color * weight, weight);
}
