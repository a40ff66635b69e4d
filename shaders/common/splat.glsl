// One splat of a draw list. Mirrored by `abi::Splat`.
struct SplatRecord {
    float center[3];
    // As `abi::SplatRadius`: model units; 0 is the size of the frame, and with the highest bit set it is too, and the other
    // bits are what the codes of normal and color leave out.
    float radius;
    // Octahedral, 2 x 16 bit signed normalized.
    uint normal;
    // Red, green, blue, alpha from the lowest byte; alpha 0 marks a splat without normal.
    uint color;
};
