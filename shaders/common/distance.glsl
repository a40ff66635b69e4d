// Distances along the view direction from reversed depths, and back. Needs common/frame.glsl.

// The distance of a depth that is not 0.
float distance_of(float depth) {
    float p22 = frame.clip_from_view[2][2];
    float p32 = frame.clip_from_view[3][2];
    return (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? (p32 - depth) / p22 : p32 / (depth + p22);
}

float depth_of(float distance) {
    float p22 = frame.clip_from_view[2][2];
    float p32 = frame.clip_from_view[3][2];
    return (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? p32 - p22 * distance : p32 / distance - p22;
}
