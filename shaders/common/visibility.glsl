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

// Half the side of a pixel at a distance along the view direction, view-space units.
float pixel_radius(float distance) {
    return 0.5 * (has_flag(FLAG_ORTHOGRAPHIC) ? 1.0 : max(distance, 0.0)) / frame.focal_px;
}

// Radius of the frame's constant size there.
float splat_radius(float distance) {
    return max(frame.splat_size_px, 1.0) * pixel_radius(distance);
}

// The depth offset of a patch of surface that faces the eye by this cosine (negative: its back).
float depth_offset(float radius, float facing) {
    return frame.depth_offset * radius / max(abs(facing), 0.1);
}

// Depth must be above the cleared 0 to be drawn: what lies on the far plane, or is pushed past it, lies just before it,
// in the same order.
vec4 before_far(vec4 clip) {
    if (clip.z <= 0.0) {
        clip.z = clip.w * (1e-30 / (1.0 - clip.z / clip.w));
    }
    return clip;
}
