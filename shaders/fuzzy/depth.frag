#version 460
// Pass fuzzy.depth: the outline of the footprint.
#include "common/disc.glsl"

layout(location = 0) flat in vec2 center_px;
layout(location = 1) flat in vec3 form;
layout(location = 2) flat in vec2 skew;

void main() {
    // Also for what is not a number.
    if (!(rho_squared(form, skew, gl_FragCoord.xy - center_px) <= 1.0)) {
        discard;
    }
}
