// A primitive of some size around a center: a point sprite or, where that would be too large for the device, a quad.
#include "common/frame.glsl"

// Draw each record as an instance of six corners instead of as one point.
layout(constant_id = 2) const bool IS_QUAD = false;

invariant gl_Position;

// Puts the primitive of `size_px` around a center in clip space.
void place(vec4 center_in_clip, float size_px) {
    if (IS_QUAD) {
        int i = gl_VertexIndex;
        vec2 corner = vec2(i == 1 || i >= 4 ? 0.5 : -0.5, i == 2 || i == 3 || i == 5 ? 0.5 : -0.5);
        // Pixels to clip space: half the viewport is one unit.
        vec2 unit = abs(frame.ray_scale) * abs(vec2(frame.clip_from_view[0][0], frame.clip_from_view[1][1]));
        center_in_clip.xy += corner * size_px * unit * center_in_clip.w;
    } else {
        gl_PointSize = size_px;
    }
    gl_Position = center_in_clip;
}
