// One oriented polygon of a draw list, as a vertex shader reads it. Mirrored by `abi::OrientedPolygon`.
#include "common/frame.glsl"

layout(location = 0) in vec3 center;
layout(location = 1) in float round_radius;
layout(location = 2) in vec3 normal;
layout(location = 3) in float thickness;
layout(location = 4) in vec3 axis;
// (u, v) of two corners each; those past the last repeat it.
layout(location = 5) in vec4 corners_0;
layout(location = 6) in vec4 corners_2;
layout(location = 7) in vec4 corners_4;
layout(location = 8) in vec4 corners_6;
layout(location = 9) in vec3 shading_normal;
layout(location = 10) in vec4 color;
layout(location = 11) in vec3 shape_operator;
layout(location = 12) in float spread;
// Red, green and blue; the last of the first is the exponent of both, over 127.
layout(location = 13) in vec4 slopes_u;
layout(location = 14) in vec4 slopes_v;

const int CORNERS = 8;

vec2[CORNERS] footprint() {
    return vec2[CORNERS](
        corners_0.xy, corners_0.zw, corners_2.xy, corners_2.zw, corners_4.xy, corners_4.zw, corners_6.xy, corners_6.zw
    );
}

// Direction of v, model space.
vec3 second_axis() {
    return cross(normal, axis);
}

// Change of the color along u and v, per model unit.
mat2x3 color_slopes() {
    float factor = exp2(round(slopes_u.w * 127.0));
    return mat2x3(slopes_u.xyz * factor, slopes_v.xyz * factor);
}

// Whether it is left out where only fronts are drawn.
bool faces_away(vec3 center_in_view) {
    vec3 towards = has_flag(FLAG_ORTHOGRAPHIC) ? vec3(0.0, 0.0, 1.0) : -center_in_view;
    float facing = dot(mat3(frame.view_from_model) * normal, towards) / frame.model_scale;
    return has_flag(FLAG_CULLS_BACK) && facing <= -spread * length(towards);
}

// Part of the light that the surface keeps: less than 1 where the normal averages a rough one.
float light_share() {
    float share = length(shading_normal);
    return share > 0.0 ? share : 1.0;
}
