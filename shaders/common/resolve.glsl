// The end of a reconstruction: color and depth of the picture.
#include "common/reconstruct.glsl"

layout(location = 0) out vec4 color;

// `own` is what the pixel held, `filled` what was reconstructed for a hole; its alpha is 0 where nothing was within
// reach: then the hole shows the footprint that made it.
void resolve(vec4 own, vec2 front, vec4 filled) {
    bool is_empty = !is_foreground(own) && !is_hole(own);
    vec3 shown = is_hole(own) && filled.a > 0.0 ? filled.rgb : own.rgb;
    if (has_flag(FLAG_COLOR_BY_CLASSIFICATION)) {
        shown = is_foreground(own) ? vec3(1.0) : filled.a > 0.0 ? vec3(HOLE) : vec3(1.0, 0.0, 0.0);
    }
    color = is_empty ? vec4(frame.background.rgb, 0.0) : vec4(shown, 1.0);
    // Reversed depth of the distance; rows 2 and 3 of the matrix know z alone. The cleared 0 is background.
    vec4 clip = frame.clip_from_view * vec4(0.0, 0.0, -front.x, 1.0);
    gl_FragDepth = is_empty ? 0.0 : clamp(clip.z / clip.w, 1e-30, 1.0);
}
