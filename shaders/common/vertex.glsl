// One vertex of the mesh. Mirrored by `abi::Vertex`.
struct VertexRecord {
    float position[3];
    // Octahedral, 2 x 16 bit signed normalized.
    uint normal;
    // Red, green, blue, alpha from the lowest byte; alpha 0 marks a vertex without normal.
    uint color;
};
