#version 460
// Pass fuzzy.blend, splats from vertices: lit in each pixel, with a weight that falls from the vertex to the round bound.
// Pulled towards the eye: the first pass hides what lies farther behind it than surfaces of both are apart.
#include "common/polygon_shade.glsl"
#include "common/pull_depth.glsl"

layout(location = 0) in vec3 position_in_view;
layout(location = 1) in vec3 normal_in_view;
layout(location = 2) in vec3 base;
layout(location = 3) in vec2 uv;
layout(location = 4) flat in vec2 bound_and_share;
layout(location = 5) flat in vec2 reach;

layout(location = 0) out vec4 sums;
#ifdef NORMALS
layout(location = 1) out vec4 normals;
#endif

layout(constant_id = 0) const bool IS_GAUSS = false;
layout(constant_id = 4) const bool IS_DEFERRED = false;
// The frame has a lamp instead of the headlight.
layout(constant_id = 6) const bool HAS_LAMP = false;

void main() {
    float squared = dot(uv, uv) / bound_and_share.x;
    float weight = squared > 1.0 ? 0.0 : IS_GAUSS ? exp(-2.0 * squared) : 1.0;
    vec3 n = unit_or_zero(normal_in_view);
    vec3 shown = clamp(base, vec3(0.0), vec3(1.0));
    vec3 tint = vec3(1.0, 0.2, 0.2);
    if (IS_DEFERRED) {
        shown = has_flag(FLAG_COLOR_BY_PRIMITIVE) ? tint : shown;
        vec3 to_eye = has_flag(FLAG_ORTHOGRAPHIC) ? vec3(0.0, 0.0, 1.0) : -unit_or_zero(position_in_view);
        n = is_turned_when_deferred(HAS_LAMP, dot(n, to_eye)) ? -n : n;
    } else {
        shown = shade_polygon(position_in_view, n, shown, bound_and_share.y, tint);
    }
    gl_FragDepth = min(max(pulled_depth(position_in_view, reach), gl_FragCoord.z), 1.0);
    sums = vec4(shown * weight, weight);
#ifdef NORMALS
    normals = weight * vec4(n, gl_FragCoord.z);
#endif
}
