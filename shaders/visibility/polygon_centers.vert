#version 460
// Pass visibility.centers: the middle of each splat from a vertex, one pixel.
#include "common/visibility.glsl"
#include "common/polygon_shade.glsl"
#include "common/pushed_polygon.glsl"

layout(location = 0) flat out vec3 shade;
layout(location = 1) flat out vec3 normal_in_model;
layout(location = 2) flat out vec2 front;
layout(location = 3) flat out vec2 center_px;
layout(location = 4) flat out vec3 form;
layout(location = 5) flat out vec2 skew;

void main() {
    vec2 feet[CORNERS] = footprint();
    vec2 uv = vec2(0.0);
    for (int i = 0; i < CORNERS; i++) {
        uv += feet[i] / float(CORNERS);
    }
    // The vertex itself is in the splat, and so is what lies between it and the mean of the corners, within the bound.
    uv *= min(1.0, round_radius / max(length(uv), 1e-30));
    vec3 across = second_axis();
    vec3 middle = (frame.view_from_model * vec4(center, 1.0)).xyz;
    vec3 at = (frame.view_from_model * vec4(center + uv.x * axis + uv.y * across, 1.0)).xyz;
    vec3 s = shape_operator;
    normal_in_model = unit_or_zero(shading_normal + dot(s.xy, uv) * axis + dot(s.yz, uv) * across);
    vec3 n = mat3(frame.view_from_model) * normal_in_model / frame.model_scale;
    vec3 of_surface = clamp(color.rgb + color_slopes() * uv, vec3(0.0), vec3(1.0));
    shade = shade_polygon(at, n, of_surface, light_share(), vec3(1.0, 0.2, 0.2));
    front = vec2(-at.z, frame.depth_offset * round_radius * frame.model_scale / facing_of_plane(middle));
    center_px = vec2(0.0);
    form = vec3(0.0);
    skew = vec2(0.0);
    vec4 clip = frame.clip_from_view * vec4(at, 1.0);
    bool is_gone = faces_away(middle) || clip.z > clip.w || clip.z < 0.0;
    gl_PointSize = 1.0;
    gl_Position = is_gone ? vec4(0.0, 0.0, 2.0, 1.0) : before_far(clip);
}
