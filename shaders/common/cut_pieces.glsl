// Triangles of a cut that may become filtered splats, in pieces: what the passes know that count, choose and cut them, as
// `pack::filtered` does it.
#include "common/cut.glsl"
#include "common/splat_id.glsl"
#include "common/tree.glsl"

// Numbers of splats from the start; from the end those of large triangles.
layout(set = 0, binding = 2, std430) buffer SplatIds {
    uvec2 splat_ids[];
};

layout(set = 0, binding = 3, std430) readonly buffer Leaves {
    LeafRecord leaves[];
};

// Of this size everything that reaches the eye is, and no triangle is larger than the other; pixels.
const float AT_EYE_PX = 1e30;
const float ANY_TRIANGLE_PX = 3e38;

// The number of a large triangle.
uint named_triangle(uint item) {
    uint id = splat_ids[cut.room - 1u - item].x;
    return min(id, uint(leaves.length()) - 1u);
}

// Projected diameter of a leaf, pixels.
float diameter_of(uint id) {
    precise vec3 products = cut.view_row.xyz * vec3(leaves[id].center[0], leaves[id].center[1], leaves[id].center[2]);
    precise float along = sum_of(products) + cut.view_row.w;
    precise float diameter = cut.view_focal_px * leaves[id].radius * cut.view_scale;
    float z = -along;
    precise float at_distance = diameter / z;
    float nearby = z > 0.0 ? at_distance : AT_EYE_PX;
    return cut.is_perspective != 0u ? nearby : diameter;
}

// How often the edges of a triangle are halved, of those up to `halved_px`.
uint cuts_of(float diameter_px, float halved_px) {
    if (diameter_px > halved_px) {
        return 0u;
    }
    float piece = max(PIECE_PX, cut.threshold_px);
    uint cuts = 0u;
    while (diameter_px > piece && cuts < MOST_PIECE_CUTS) {
        piece *= 2.0;
        ++cuts;
    }
    return cuts;
}
