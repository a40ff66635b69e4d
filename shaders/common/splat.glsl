// One splat of a draw list. Mirrored by `abi::Splat`.
struct SplatRecord {
    float center[3];
    // Model units; 0 or negative asks for the constant size of the frame. The lower bits of a negative one are what the
    // normal's code leaves out, 2 x 15 bit signed, steps of 2^-14 of its own.
    float radius;
    // Octahedral, 2 x 16 bit signed normalized.
    uint normal;
    // Red, green, blue, alpha from the lowest byte; alpha 0 marks a splat without normal.
    uint color;
};
