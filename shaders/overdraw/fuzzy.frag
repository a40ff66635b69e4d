#version 460
// Pass overdraw.count, fuzzy splats: one for every pixel of the footprint that is blended.
#include "common/disc.glsl"

layout(location = 0) flat in vec2 center_px;
layout(location = 1) flat in vec3 form;
layout(location = 2) flat in vec2 skew;

layout(location = 0) out float count;

void main() {
    count = rho_squared(form, skew, gl_FragCoord.xy - center_px) > 1.0 ? 0.0 : 1.0;
}
