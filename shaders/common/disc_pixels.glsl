// The pixels that an oriented polygon may cover, of the fields of common/polygon_parts.glsl. Needs common/list.glsl.
#include "common/disc_plane.glsl"

// Farther than any pixel.
const float BEYOND_PX = 1e30;

// First pixel and one past the last of what lies between two window positions, within the rectangle of the list.
ivec4 pixels_between(vec2 low, vec2 high) {
    vec2 least = vec2(list.rect_px.xy);
    vec2 most = vec2(list.rect_px.zw);
    // Half a pixel of room for rounding; comparisons of what is not finite leave all of the rectangle.
    vec2 first = floor(low - 1.0);
    vec2 end = ceil(high + 1.0);
    first = mix(least, min(first, most), greaterThan(first, least));
    end = mix(most, max(end, least), lessThan(end, most));
    return ivec4(first, end);
}

// Pixels that a splat from a vertex may cover.
ivec4 pixels_of_disc() {
    vec2[CORNERS] feet = footprint();
    mat3 turn = mat3(frame.view_from_model);
    vec3 middle = (frame.view_from_model * vec4(center, 1.0)).xyz;
    vec3 u = turn * axis;
    vec3 v = turn * second_axis();
    vec2 low = vec2(BEYOND_PX);
    vec2 high = vec2(-BEYOND_PX);
    bool is_before = true;
    bool is_behind = true;
    for (int i = 0; i < CORNERS; i++) {
        vec3 at = middle + feet[i].x * u + feet[i].y * v;
        vec4 clip = frame.clip_from_view * vec4(at, 1.0);
        bool is_near = !(clip.w > 0.0 && clip.z <= clip.w);
        is_before = is_before && !is_near;
        is_behind = is_behind && is_near;
        vec2 ray = has_flag(FLAG_ORTHOGRAPHIC) ? at.xy : at.xy / -at.z;
        vec2 window = (ray - frame.ray_offset) / frame.ray_scale;
        low = min(low, window);
        high = max(high, window);
    }
    if (is_behind) {
        return ivec4(0);
    }
    return is_before ? pixels_between(low, high) : ivec4(list.rect_px);
}
