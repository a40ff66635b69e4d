// The middle of a splat from a vertex, as visibility splatting shows it: one pixel. Of the fields of
// common/polygon_parts.glsl.
#include "common/visibility.glsl"
#include "common/disc_look.glsl"
#include "common/push_polygon.glsl"

struct ShownMiddle {
    vec3 shade;
    vec3 normal_in_model;
    // Distance along the view direction, and depth offset.
    vec2 front;
};

// Place in view space.
vec3 center_in_view() {
    vec2 uv = middle_of_footprint();
    return (frame.view_from_model * vec4(center + uv.x * axis + uv.y * second_axis(), 1.0)).xyz;
}

// Clip position; `is_gone` where it is left out.
vec4 clip_of_center(vec3 at, vec3 middle, out bool is_gone) {
    vec4 clip = frame.clip_from_view * vec4(at, 1.0);
    is_gone = faces_away(middle) || clip.z > clip.w || clip.z < 0.0;
    return before_far(clip);
}

ShownMiddle shown_center(vec3 at, vec3 middle) {
    ShownMiddle shown;
    vec2 uv = middle_of_footprint();
    shown.normal_in_model = unit_or_zero(disc_normal(uv));
    vec3 n = mat3(frame.view_from_model) * shown.normal_in_model / frame.model_scale;
    shown.shade = shade_disc(at, n, uv);
    shown.front = vec2(-at.z, polygon_offset(middle));
    return shown;
}
