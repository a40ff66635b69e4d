#version 460
// Pass overlay: tint times texture, both premultiplied and in the encoding of the screen. The sampler of this
// program reads single texels, so the four around a place are mixed here.
layout(set = 0, binding = 0) uniform sampler2D glyphs;

layout(location = 0) in vec2 place_in_texture;
layout(location = 1) in vec4 tint;

layout(location = 0) out vec4 color;

void main() {
    ivec2 last = textureSize(glyphs, 0) - 1;
    vec2 at = place_in_texture * vec2(last + 1) - 0.5;
    ivec2 corner = ivec2(floor(at));
    vec2 part = at - vec2(corner);
    vec4 texels[4];
    for (int i = 0; i < 4; ++i) {
        ivec2 texel = clamp(corner + ivec2(i & 1, i >> 1), ivec2(0), last);
        texels[i] = texelFetch(glyphs, texel, 0);
    }
    color = tint * mix(mix(texels[0], texels[1], part.x), mix(texels[2], texels[3], part.x), part.y);
}
