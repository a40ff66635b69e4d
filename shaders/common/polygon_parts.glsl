// Functions of the fields of an oriented polygon. These are globals: inputs of a vertex shader (common/polygon.glsl), or read
// from storage (common/polygon_record.glsl).

const int CORNERS = 8;

vec2[CORNERS] footprint() {
    return vec2[CORNERS](
        corners_0.xy, corners_0.zw, corners_2.xy, corners_2.zw, corners_4.xy, corners_4.zw, corners_6.xy, corners_6.zw
    );
}

// Plane coordinates of a place within it for all of it: the vertex itself is in the splat, and so is what lies between it and
// the mean of the corners, within the bound.
vec2 middle_of_footprint() {
    vec2 feet[CORNERS] = footprint();
    vec2 uv = vec2(0.0);
    for (int i = 0; i < CORNERS; i++) {
        uv += feet[i] / float(CORNERS);
    }
    return uv * min(1.0, round_radius / max(length(uv), 1e-30));
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
