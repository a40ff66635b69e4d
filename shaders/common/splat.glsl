// One splat of a draw list. Mirrored by `abi::Splat`.
struct SplatRecord {
    float center[3];
    // Model units; 0 asks for the constant size of the frame.
    float radius;
    // Octahedral, 2 x 16 bit signed normalized.
    uint normal;
    // Red, green, blue, alpha from the lowest byte; alpha 0 marks a splat without normal.
    uint color;
};
