#version 460
// Pass filtered.depth: squares into depth only, pushed away by their offset.
#include "common/push.glsl"

layout(location = 0) in vec3 center;
layout(location = 1) in float offset;
layout(location = 2) in float side_px;

invariant gl_Position;

// Compute draws what is small.
layout(constant_id = 8) const bool LARGE_ONLY = false;

void main() {
    vec4 center_in_view = frame.view_from_model * vec4(center, 1.0);
    gl_Position = clip_of_pushed(push_away(center_in_view.xyz, offset * frame.model_scale));
    // Near and far are those of the center itself, as in the blend pass.
    vec4 unpushed = frame.clip_from_view * center_in_view;
    bool is_small = side_px <= LARGEST_SMALL_BLENDED_PX;
    if (unpushed.z > unpushed.w || unpushed.z < 0.0 || (LARGE_ONLY && is_small)) {
        gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
    }
    gl_PointSize = max(side_px, 1.0);
}
