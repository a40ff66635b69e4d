// What light makes of a point of a splat from a vertex, of the fields of common/polygon_parts.glsl.
#include "common/polygon_shade.glsl"

// Of coloring by primitive.
const vec3 DISC_TINT = vec3(1.0, 0.2, 0.2);

// Normal at plane coordinates, model space, of any length.
vec3 disc_normal(vec2 uv) {
    vec3 s = shape_operator;
    return shading_normal + dot(s.xy, uv) * axis + dot(s.yz, uv) * second_axis();
}

// Color at a place in view space with a unit normal there, and plane coordinates.
vec3 shade_disc(vec3 position_in_view, vec3 n, vec2 uv) {
    vec3 base = clamp(color.rgb + color_slopes() * uv, vec3(0.0), vec3(1.0));
    return shade_polygon(position_in_view, n, base, light_share(), DISC_TINT);
}
