#version 460
// Each pixel of the point gets what of the rectangle lies in it; the target adds the deposits up.

layout(location = 0) flat in vec4 color_and_weight;
layout(location = 1) flat in vec3 extent_and_size_px;

layout(location = 0) out vec4 sums;

// Overlap of a pixel, a unit wide, and an interval, `distance` from center to center.
vec2 overlap(vec2 extent, vec2 distance) {
    return clamp(0.5 * (extent + 1.0) - distance, vec2(0.0), min(extent, 1.0));
}

void main() {
    vec2 distance = abs(gl_PointCoord - 0.5) * extent_and_size_px.z;
    vec2 own = overlap(extent_and_size_px.xy, distance);
    float weight = color_and_weight.a * (own.x * own.y);
    sums = vec4(color_and_weight.rgb * weight, weight);
}
