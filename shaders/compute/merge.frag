#version 460
// Pass filtered.merge: brings the front of the small primitives to the depth target, where the nearer stays.
#include "common/list.glsl"

layout(set = 0, binding = 2, std430) readonly buffer Front {
    uint front[];
};

void main() {
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    gl_FragDepth = uintBitsToFloat(front[pixel.y * list.size_px.x + pixel.x]);
}
