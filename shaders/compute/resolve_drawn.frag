#version 460
// Pass small.resolve where the host has drawn beside the rasterizer: color and depth of each pixel; the depth is tested against what
// the rasterizer drew.
#include "common/frame.glsl"
#include "common/list.glsl"

layout(set = 0, binding = 2, std430) readonly buffer Drawn {
    // Of the pixels of the rectangle red, green, blue and coverage, a byte each; then of all of them the reversed depth, as
    // bits; 0 where nothing is.
    uint drawn[];
};

layout(location = 0) out vec4 color;

void main() {
    uvec2 sides = list.rect_px.zw - list.rect_px.xy;
    uint own = index_of(ivec2(gl_FragCoord.xy));
    uint depth = drawn[sides.x * sides.y + own];
    if (depth == 0u) {
        discard;
    }
    color = unpackUnorm4x8(drawn[own]);
    gl_FragDepth = uintBitsToFloat(depth);
}
