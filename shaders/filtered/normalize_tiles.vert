#version 460
// Pass filtered.normalize where the host drew: a point for each square of the picture that has anything in it.
#include "common/constants.glsl"
#include "common/list.glsl"

layout(location = 0) in vec2 center_px;

void main() {
    // The viewport reaches a square beyond the picture, so that no center leaves it.
    vec2 size_px = vec2(list.size_px + FILTERED_TILE_PX);
    gl_Position = vec4(center_px / size_px * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = float(FILTERED_TILE_PX);
}
