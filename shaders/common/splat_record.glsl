// One splat of the draw list as storage. Mirrored by `abi::Splat`.
struct SplatRecord {
    float center[3];
    // Model units; 0 asks for the constant size of the frame.
    float radius;
    // Octahedral, 2 x 16 bit signed normalized.
    uint normal;
    // Red, green, blue, alpha from the lowest byte; alpha 0 marks a splat without normal.
    uint color;
};

// What a pass over storage knows of the picture and of the part of the list that is bound. Mirrored by
// `abi::ListConstants`.
layout(set = 0, binding = 1, std140) uniform ListConstants {
    // Width and height of the picture, pixels.
    uvec2 size_px;
    // Pixels by which the viewport of `clip_from_view` reaches beyond the picture on every side.
    float guard_px;
    // The bound part of the list: number of its first splat, and how many they are.
    uint first;
    uint count;
} list;

layout(set = 0, binding = 2, std430) readonly buffer Splats {
    SplatRecord splats[];
};
