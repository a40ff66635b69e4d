// What the passes of visibility splatting share. Two images hold a picture: `picked` has the color, and the class in
// alpha; `fronts` has the distance along the view direction and the depth offset of what the color belongs to.
#include "common/headlight.glsl"

// Classes, as alpha. A hole is covered by a footprint, and no center is seen in it.
const float BACKGROUND = 0.0;
const float HOLE = 128.0 / 255.0;
const float FOREGROUND = 1.0;

bool is_foreground(vec4 texel) {
    return texel.a > 0.75;
}

bool is_hole(vec4 texel) {
    return texel.a > 0.25 && texel.a <= 0.75;
}

// The depth offset of something that faces the eye by this cosine (negative: the back; 0 normal: as if it faced).
float depth_offset(float side_px, float distance, float facing) {
    float depth = (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? 1.0 : max(distance, 0.0);
    return frame.background.a * side_px * depth / (2.0 * frame.focal_px) / max(abs(facing), 0.1);
}

// Unit vector from a view-space point towards the viewer.
vec3 to_viewer(vec3 position_in_view) {
    return (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? vec3(0.0, 0.0, 1.0) : -normalize(position_in_view);
}

// Depth must be above the cleared 0 to be drawn: what lies on the far plane, or is pushed past it, lies just before it,
// in the same order.
vec4 before_far(vec4 clip) {
    if (clip.z <= 0.0) {
        clip.z = clip.w * (1e-30 / (1.0 - clip.z / clip.w));
    }
    return clip;
}
