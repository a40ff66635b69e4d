#version 460
// Pass look.background: puts a color that changes from top to bottom where the background shows. The rule is that of
// src/render/backdrop.rs.
#include "common/frame.glsl"

layout(set = 0, binding = 1) uniform sampler2D picture;

layout(location = 0) out vec4 color;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    color = texelFetch(picture, pixel, 0);
    float open = 1.0 - color.a;
    // The pattern of ordered dithering, Bayer (1973): 0 to 63.
    uint x = uint(pixel.x);
    uint y = uint(pixel.y);
    uint d = x ^ y;
    uint place = (d & 1u) << 5 | (y & 1u) << 4 | (d & 2u) << 2 | (y & 2u) << 1 | (d & 4u) >> 1 | (y & 4u) >> 2;
    float dither = ((float(place) + 0.5) / 64.0 - 0.5) / 255.0;
    float down = gl_FragCoord.y / float(textureSize(picture, 0).y);
    color.rgb += open * (frame.background_change.rgb * down + dither);
}
