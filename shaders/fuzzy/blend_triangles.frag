#version 460
// Pass fuzzy.blend, triangles: they cover the pixel whole, with weight 1.
#include "common/headlight.glsl"

layout(location = 0) in vec3 normal_in_view;
layout(location = 1) in vec3 vertex_color;

layout(location = 0) out vec4 sums;
#ifdef NORMALS
layout(location = 1) out vec4 normals;
#endif

layout(constant_id = 4) const bool IS_DEFERRED = false;
// The frame has a lamp instead of the headlight.
layout(constant_id = 6) const bool HAS_LAMP = false;

void main() {
    float squared = dot(normal_in_view, normal_in_view);
    vec3 n = squared > 0.0 ? normal_in_view * inversesqrt(squared) : vec3(0.0);
    bool is_orthographic = has_flag(FLAG_ORTHOGRAPHIC);
    vec3 to_eye = is_orthographic
        ? vec3(0.0, 0.0, 1.0)
        : -normalize(vec3(gl_FragCoord.xy * frame.ray_scale + frame.ray_offset, -1.0));
    vec3 tint = vec3(0.2, 0.35, 1.0);
    if (IS_DEFERRED) {
        sums = vec4(has_flag(FLAG_COLOR_BY_PRIMITIVE) ? tint : vertex_color, 1.0);
        if (is_turned_when_deferred(HAS_LAMP, dot(n, to_eye))) {
            n = -n;
        }
    } else {
        sums = vec4(shade_pixel(HAS_LAMP, gl_FragCoord, n, vertex_color, tint), 1.0);
    }
#ifdef NORMALS
    normals = vec4(n, gl_FragCoord.z);
#endif
}
