#version 460
// Pass fuzzy.blend: what a footprint adds to a pixel.
#include "common/disc.glsl"

layout(location = 0) flat in vec2 center_px;
layout(location = 1) flat in vec3 form;
layout(location = 2) flat in vec2 skew;
layout(location = 3) flat in vec4 deposit;
layout(location = 4) flat in vec4 normal_deposit;

layout(location = 0) out vec4 sums;
#ifdef NORMALS
layout(location = 1) out vec4 normals;
#endif

layout(constant_id = 0) const bool IS_GAUSS = false;

void main() {
    float squared = rho_squared(form, skew, gl_FragCoord.xy - center_px);
    // Adding nothing is cheaper than a discard.
    float kernel = squared > 1.0 ? 0.0 : IS_GAUSS ? exp(-2.0 * squared) : 1.0;
    sums = deposit * kernel;
#ifdef NORMALS
    normals = normal_deposit * kernel;
#endif
}
