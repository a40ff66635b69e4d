#version 460
// Pass visibility.centers: the middle of each splat from a vertex, one pixel.
#include "common/polygon.glsl"
#include "common/polygon_center.glsl"

layout(location = 0) flat out vec3 shade;
layout(location = 1) flat out vec3 normal_in_model;
layout(location = 2) flat out vec2 front;
layout(location = 3) flat out vec2 center_px;
layout(location = 4) flat out vec3 form;
layout(location = 5) flat out vec2 skew;

void main() {
    vec3 middle = (frame.view_from_model * vec4(center, 1.0)).xyz;
    vec3 at = center_in_view();
    ShownMiddle shown = shown_center(at, middle);
    shade = shown.shade;
    normal_in_model = shown.normal_in_model;
    front = shown.front;
    center_px = vec2(0.0);
    form = vec3(0.0);
    skew = vec2(0.0);
    bool is_gone;
    vec4 clip = clip_of_center(at, middle, is_gone);
    gl_PointSize = 1.0;
    gl_Position = is_gone ? vec4(0.0, 0.0, 2.0, 1.0) : clip;
}
