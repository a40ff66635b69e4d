// The depth offset of the first of two passes: away from the eye along the viewing ray, in view space, so that
// the position on the screen does not change.
#include "common/frame.glsl"

vec3 push_away(vec3 position_in_view, float distance) {
    if (has_flag(FLAG_ORTHOGRAPHIC)) {
        return position_in_view - vec3(0.0, 0.0, distance);
    }
    float length_in_view = length(position_in_view);
    // What lies in the eye has no direction to be pushed in.
    return length_in_view > 0.0 ? position_in_view * ((length_in_view + distance) / length_in_view) : position_in_view;
}

// Clip position of a pushed splat; what is pushed past the far plane stays on it. Not for triangles: a corner that is
// held back tilts its plane.
vec4 clip_of_pushed(vec3 pushed_in_view) {
    vec4 clip = frame.clip_from_view * vec4(pushed_in_view, 1.0);
    clip.z = max(clip.z, 0.0);
    return clip;
}
