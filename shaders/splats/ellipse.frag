#version 460
// One flat color inside a disc in the plane of the surface, at the depth of the dome over it.
#include "common/disc.glsl"

layout(location = 0) flat in vec3 shade;
layout(location = 1) flat in vec3 normal_in_model;
layout(location = 2) flat in vec2 center_px;
layout(location = 3) flat in vec3 form;
layout(location = 4) flat in vec2 skew;
layout(location = 5) flat in vec4 depth_lean_dome;

layout(location = 0) out vec4 color;
#ifdef NORMALS
layout(location = 1) out vec4 normal;
#endif

void main() {
    vec2 offset = gl_FragCoord.xy - center_px;
    if (rho_squared(form, skew, offset) > 1.0) {
        discard;
    }
    gl_FragDepth = dome_depth(depth_lean_dome.x, form, depth_lean_dome.yz, depth_lean_dome.w, offset);
    color = vec4(shade, 1.0);
#ifdef NORMALS
    normal = vec4(normal_in_model, 1.0);
#endif
}
