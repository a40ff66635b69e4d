// What a splat of visibility splatting shows wherever it is seen, and how far it is pushed away: the same steps whether a
// rasterizer draws it or compute.
#include "common/visibility.glsl"
#include "common/round.glsl"
#include "common/octahedral.glsl"
#include "common/push.glsl"

struct Seen {
    vec3 center_in_view;
    vec3 normal_in_model;
    vec3 normal_in_view;
    // View-space units.
    float radius;
    vec3 shade;
    // Distance along the view direction, and depth offset.
    vec2 front;
};

// `radius` in model units; 0 asks for the constant size of the frame.
Seen seen_splat(vec3 center, float radius, vec2 packed_normal, vec4 color) {
    Seen seen;
    seen.center_in_view = (frame.view_from_model * vec4(center, 1.0)).xyz;
    float distance = -seen.center_in_view.z;
    // Alpha 0 marks a splat without normal.
    seen.normal_in_model = color.a == 0.0 ? vec3(0.0) : octahedral_decode(packed_normal);
    seen.normal_in_view = mat3(frame.view_from_model) * seen.normal_in_model / frame.model_scale;
    seen.shade = shade_at(seen.center_in_view, seen.normal_in_view, color.rgb, vec3(1.0, 0.2, 0.2));
    float facing = color.a == 0.0 ? 1.0 : dot(seen.normal_in_view, to_eye(seen.center_in_view));
    seen.radius = radius_in_view(radius, seen.center_in_view);
    seen.front = vec2(distance, depth_offset(max(seen.radius, pixel_radius(distance)), facing));
    return seen;
}

vec4 clip_of_center(Seen seen) {
    return frame.clip_from_view * vec4(seen.center_in_view, 1.0);
}

// Clip position of the footprint.
vec4 clip_of_footprint(Seen seen) {
    return before_far(frame.clip_from_view * vec4(push_away(seen.center_in_view, seen.front.y), 1.0));
}

// Before `bounded` ends it.
Disc unbounded_footprint_of(Seen seen, float alpha) {
    return unbounded_footprint(seen.center_in_view, seen.normal_in_view, seen.radius, thickness_of(alpha), false);
}

Disc footprint_of(Seen seen, float alpha) {
    return bounded(unbounded_footprint_of(seen, alpha));
}
