// One filtered splat of the draw list as storage. Mirrored by `abi::FilteredSplat`.
#include "common/frame.glsl"
#include "common/list.glsl"

struct FilteredRecord {
    float center[3];
    // Depth offset of the first pass, model units.
    float offset;
    float color[3];
    // Width and height of the rectangle, and side of the square, pixels.
    float extent_and_side_px[3];
    // Projected area of what faces the viewer, square pixels.
    float area_px;
};

layout(set = 0, binding = 2, std430) readonly buffer FilteredSplats {
    FilteredRecord splats[];
};
