#version 460
// One flat color inside the footprint, at the depth of its center.
#include "common/disc.glsl"

layout(location = 0) flat in vec3 shade;
layout(location = 1) flat in vec3 normal_in_model;
layout(location = 2) flat in vec2 center_px;
layout(location = 3) flat in vec3 form;
layout(location = 4) flat in vec2 skew;

layout(location = 0) out vec4 color;
#ifdef NORMALS
layout(location = 1) out vec4 normal;
#endif

void main() {
    if (rho_squared(form, skew, gl_FragCoord.xy - center_px) > 1.0) {
        discard;
    }
    color = vec4(shade, 1.0);
#ifdef NORMALS
    normal = vec4(normal_in_model, 1.0);
#endif
}
