#version 460
// Each pixel of the point gets what of the rectangle lies in it; the target adds the deposits up.
layout(location = 0) flat in vec4 deposit;
layout(location = 1) flat in vec3 extent_and_size_px;

layout(location = 0) out vec4 sums;

void main() {
    vec2 extent = extent_and_size_px.xy;
    vec2 distance = abs(gl_PointCoord - 0.5) * extent_and_size_px.z;
    // Overlap of the pixel, a unit wide, and the rectangle, `distance` from center to center.
    vec2 overlap = clamp(0.5 * (extent + 1.0) - distance, vec2(0.0), min(extent, 1.0));
    sums = deposit * (overlap.x * overlap.y);
}
