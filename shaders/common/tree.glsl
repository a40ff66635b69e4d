// What the tree has of a node and of a leaf.

// Mirrored by `tree::Node`.
struct NodeRecord {
    float center[3];
    float radius;
    uint first_child;
    // Both halves of the cone's axis.
    uint axis;
    // Sine of the cone's half angle; above it the strip's direction.
    uint sine;
    // Half length and width of the strip, number of children, flags; a byte each.
    uint shape;
};

// Mirrored by `tree::NodeAttributes`.
struct AttributesRecord {
    uint normal;
    uint color;
    float splat_radius;
    float area;
};

// Mirrored by `tree::Leaf`.
struct LeafRecord {
    float center[3];
    float radius;
};
