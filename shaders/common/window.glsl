// Clip position of a window position in pixels, with a reversed depth.
#include "common/frame.glsl"

vec4 clip_of_window(vec2 window_px, float depth) {
    // A position in view space that is seen there.
    vec4 seen = vec4(window_px * frame.ray_scale + frame.ray_offset, -1.0, 1.0);
    vec4 clip = frame.clip_from_view * seen;
    return vec4(clip.xy / clip.w, depth, 1.0);
}
