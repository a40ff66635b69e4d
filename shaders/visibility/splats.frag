#version 460
// What a footprint (a hole) or a center (foreground) leaves in a pixel.
#include "common/visibility.glsl"
#include "common/disc.glsl"

layout(location = 0) flat in vec3 shade;
layout(location = 1) flat in vec3 normal_in_model;
layout(location = 2) flat in vec2 front;
layout(location = 3) flat in vec2 center_px;
layout(location = 4) flat in vec3 form;
layout(location = 5) flat in vec2 skew;

layout(location = 0) out vec4 picked;
layout(location = 1) out vec4 fronts;
#ifdef NORMALS
layout(location = 2) out vec4 normal;
#endif

// Whether this is the pass of centers.
layout(constant_id = 0) const bool IS_CENTER = false;

void main() {
    if (!IS_CENTER && rho_squared(form, skew, gl_FragCoord.xy - center_px) > 1.0) {
        discard;
    }
    picked = vec4(shade, IS_CENTER ? FOREGROUND : HOLE);
    fronts = vec4(front, 0.0, 0.0);
#ifdef NORMALS
    normal = vec4(normal_in_model, 1.0);
#endif
}
