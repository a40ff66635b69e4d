// A splat from a vertex where it is blended or hides centers: pulled towards the eye or pushed away from it by scaling around
// it, so that it stays flat and covers the same pixels. Of the fields of common/polygon_parts.glsl.
#include "common/pull_depth.glsl"

// Radii by which planes of a flat surface are kept apart.
const float LEAST_STEP = 0.01;

// |cosine| between the plane's normal and the direction to the eye, at least 0.1.
float facing_of_plane(vec3 center_in_view) {
    vec3 n = mat3(frame.view_from_model) * normal / frame.model_scale;
    vec3 towards = has_flag(FLAG_ORTHOGRAPHIC) ? vec3(0.0, 0.0, 1.0) : -center_in_view;
    float way = length(towards);
    return way > 0.0 ? max(abs(dot(n, towards)) / way, 0.1) : 1.0;
}

// Depth offset of its radius.
float polygon_offset(vec3 center_in_view) {
    return frame.depth_offset * round_radius * frame.model_scale / facing_of_plane(center_in_view);
}

// A move by this many depth offsets: factor of places, and what is taken from their z.
vec2 move_by(float offsets, vec3 center_in_view) {
    float by = polygon_offset(center_in_view) * offsets;
    if (has_flag(FLAG_ORTHOGRAPHIC)) {
        return vec2(1.0, by);
    }
    float way = length(center_in_view);
    return vec2(way > 0.0 ? 1.0 + by / way : 1.0, 0.0);
}

// Twice what a face that it stands for may lie from its plane.
vec2 reach_of(vec3 center_in_view) {
    return move_by(2.0 * spread, center_in_view);
}

// What keeps planes of a flat surface apart.
vec2 least_push_of(vec3 center_in_view) {
    return move_by(LEAST_STEP, center_in_view);
}

// Both.
vec2 push_of(vec3 center_in_view) {
    return move_by(2.0 * spread + LEAST_STEP, center_in_view);
}

vec3 pushed(vec3 at, vec2 push) {
    return at * push.x - vec3(0.0, 0.0, push.y);
}

// Reversed depth of a place, pushed.
float pushed_depth(vec3 at, vec2 push) {
    return depth_at_z(pushed(at, push).z);
}
