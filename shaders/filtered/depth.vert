#version 460
// Pass filtered.depth: squares into depth only, pushed away by their offset; pass filtered.surface: where they lie.
#include "common/window.glsl"

layout(location = 0) in vec2 window_px;
layout(location = 1) in float pushed_depth;
layout(location = 2) in float side_px;
layout(location = 3) in float depth;

invariant gl_Position;

// Compute draws what is small.
layout(constant_id = 8) const bool LARGE_ONLY = false;
layout(constant_id = 1) const bool IS_PUSHED = false;

void main() {
    gl_Position = clip_of_window(window_px, IS_PUSHED ? pushed_depth : depth);
    if (LARGE_ONLY && side_px <= LARGEST_SMALL_BLENDED_PX) {
        gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
    }
    gl_PointSize = max(side_px, 1.0);
}
