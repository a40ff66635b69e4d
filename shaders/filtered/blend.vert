#version 460
// Pass filtered.blend: rectangles that deposit their projected area, spread over the pixels that they overlap.
#include "common/window.glsl"

layout(location = 0) in vec2 window_px;
layout(location = 1) in vec3 color;
layout(location = 2) in float area_px;
layout(location = 3) in vec2 extent_px;
layout(location = 4) in float side_px;
layout(location = 5) in float depth;

layout(location = 0) flat out vec4 color_and_weight;
layout(location = 1) flat out vec3 extent_and_size_px;

invariant gl_Position;

// Compute draws what is small.
layout(constant_id = 8) const bool LARGE_ONLY = false;

void main() {
    gl_Position = clip_of_window(window_px, depth);
    // A whole number, so that a device whose point sizes are coarse draws what the fragment shader measures.
    float size = ceil(max(extent_px.x, extent_px.y) + 1.0);
    gl_PointSize = size;
    if (LARGE_ONLY && side_px <= LARGEST_SMALL_BLENDED_PX) {
        gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
    }
    color_and_weight = vec4(color, area_px / (extent_px.x * extent_px.y));
    extent_and_size_px = vec3(extent_px, size);
}
