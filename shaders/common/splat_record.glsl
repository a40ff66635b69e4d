// The draw list of splats as storage.
#include "common/list.glsl"
#include "common/splat.glsl"

layout(set = 0, binding = 2, std430) readonly buffer Splats {
    SplatRecord splats[];
};
