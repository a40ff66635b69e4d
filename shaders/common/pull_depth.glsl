// Depths of a splat from a vertex where it is pulled or pushed by what `move_by` in common/push_polygon.glsl gives: a factor of
// places, and what is taken from their z.

// Reversed depth of a place at this z of view space.
float depth_at_z(float z) {
    vec2 depth = frame.clip_from_view[2].zw * z + frame.clip_from_view[3].zw;
    return depth.x / depth.y;
}

// Reversed depth of a place, pulled towards the eye.
float pulled_depth(vec3 at, vec2 reach) {
    return depth_at_z((at.z + reach.y) / reach.x);
}
