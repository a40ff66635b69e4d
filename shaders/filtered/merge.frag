#version 460
// Pass filtered.merge: brings the front that compute found to the depth target, where the nearer stays.
#include "common/list.glsl"

layout(set = 0, binding = 2, std430) readonly buffer Front {
    uint front[];
};

void main() {
    gl_FragDepth = uintBitsToFloat(front[index_of(ivec2(gl_FragCoord.xy))]);
}
