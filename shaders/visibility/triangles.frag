#version 460
// What a triangle leaves in a pixel: headlight shading of an interpolated normal.
#include "common/visibility.glsl"
#include "common/disc.glsl"

layout(location = 0) in vec3 normal_in_view;
layout(location = 1) in vec3 vertex_color;
layout(location = 2) in float view_distance;

layout(location = 0) out vec4 picked;
layout(location = 1) out vec4 fronts;
#ifdef NORMALS
layout(location = 2) out vec4 normal;
#endif

// Whether this is the pass of centers.
layout(constant_id = 0) const bool IS_CENTER = false;

void main() {
    float squared = dot(normal_in_view, normal_in_view);
    vec3 n = squared > 0.0 ? normal_in_view * inversesqrt(squared) : vec3(0.0);
    vec3 ray = vec3(gl_FragCoord.xy * frame.ray_scale + frame.ray_offset, -1.0);
    float facing = squared > 0.0 ? dot(n, to_eye(ray)) : 1.0;
    vec3 at = has_flag(FLAG_ORTHOGRAPHIC) ? vec3(ray.xy, -view_distance) : ray * view_distance;
    vec3 base = shows_data() ? ramp(1.0) : vertex_color;
    picked = vec4(shade_at(at, n, base, vec3(0.2, 0.35, 1.0)), IS_CENTER ? FOREGROUND : HOLE);
    fronts = vec4(view_distance, depth_offset(splat_radius(view_distance), facing), 0.0, 0.0);
#ifdef NORMALS
    normal = vec4(n * mat3(frame.view_from_model) / frame.model_scale, 1.0);
#endif
}
