// Leaves of the tree for passes that make splats of ids: their spheres, and the triangles or points that they are.
#include "common/tree.glsl"
#include "common/vertex.glsl"

// Leaves are triangles, not points.
layout(constant_id = 2) const bool HAVE_TRIANGLES = false;

layout(set = 0, binding = 3, std430) readonly buffer Leaves {
    LeafRecord leaves[];
};

layout(set = 0, binding = 4, std430) readonly buffer Corners {
    uint corners[];
};

layout(set = 0, binding = 5, std430) readonly buffer Vertices {
    VertexRecord vertices[];
};
