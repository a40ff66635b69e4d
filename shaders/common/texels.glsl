// Images on surfaces, all in one buffer: `src/render/vulkan/device_textures.rs` writes it. First a record of each image
// (number of its levels, wrap modes, and the word of its first level), then of each level (the word of its first texel, width,
// height), then texels row by row, red in the lowest byte. What is sampled is what `src/textures/mod.rs` samples.
#ifndef TEXELS_BINDING
#define TEXELS_BINDING 3
#endif
layout(set = 0, binding = TEXELS_BINDING, std430) readonly buffer SurfaceTexels {
    uint texels[];
};

const uint NO_IMAGE = 0xffffffffu;
const uint WORDS_OF_IMAGE = 3u;
const uint WORDS_OF_LEVEL = 3u;
const uint WRAP_MIRROR = 1u;
const uint WRAP_CLAMP = 2u;

// The coordinate within 0..=1 that shows the same.
float within(float coordinate, uint wrap) {
    if (wrap == WRAP_CLAMP) {
        return clamp(coordinate, 0.0, 1.0);
    }
    if (wrap == WRAP_MIRROR) {
        float place = coordinate - 2.0 * floor(0.5 * coordinate);
        return place > 1.0 ? 2.0 - place : place;
    }
    return coordinate - floor(coordinate);
}

// The two texels whose centers are around a coordinate, and how far it is from the first to the second.
uvec2 neighbors(float coordinate, uint count, uint wrap, out float part) {
    float place = coordinate * float(count) - 0.5;
    float first = floor(place);
    part = place - first;
    uint last = count - 1u;
    bool repeats = wrap != WRAP_MIRROR && wrap != WRAP_CLAMP;
    int second = int(first) + 1;
    uint before = second <= 0 ? (repeats ? last : 0u) : min(uint(second - 1), last);
    uint after = second > int(last) ? (repeats ? 0u : last) : uint(max(second, 0));
    return uvec2(before, after);
}

vec3 bilinear(uint level, vec2 at, uvec2 wrap) {
    uint first = texels[level];
    uint width = texels[level + 1u];
    uint height = texels[level + 2u];
    vec2 part;
    uvec2 columns = neighbors(at.x, width, wrap.x, part.x);
    uvec2 rows = first + width * neighbors(at.y, height, wrap.y, part.y);
    vec3 a = unpackUnorm4x8(texels[rows.x + columns.x]).rgb;
    vec3 b = unpackUnorm4x8(texels[rows.x + columns.y]).rgb;
    vec3 c = unpackUnorm4x8(texels[rows.y + columns.x]).rgb;
    vec3 d = unpackUnorm4x8(texels[rows.y + columns.y]).rgb;
    return mix(mix(a, b, part.x), mix(c, d, part.x), part.y);
}

// The color of an image at a coordinate that changes by so much to the pixels on the right and below; that of the vertices
// without one.
vec3 surface_color(uint image, vec2 at, vec2 right, vec2 down, vec3 vertex_color) {
    if (image == NO_IMAGE) {
        return vertex_color;
    }
    uint record = WORDS_OF_IMAGE * image;
    uint count = texels[record];
    uvec2 wrap = uvec2(texels[record + 1u] & 3u, texels[record + 1u] >> 2);
    uint first = texels[record + 2u];
    vec2 size = vec2(texels[first + 1u], texels[first + 2u]);
    right *= size;
    down *= size;
    float squared = max(dot(right, right), dot(down, down));
    float level = squared > 1.0 ? min(0.5 * log2(squared), float(count - 1u)) : 0.0;
    at = vec2(within(at.x, wrap.x), within(at.y, wrap.y));
    uint lower = uint(level);
    float part = level - float(lower);
    vec3 color = bilinear(first + WORDS_OF_LEVEL * lower, at, wrap);
    if (part > 0.0) {
        color = mix(color, bilinear(first + WORDS_OF_LEVEL * (lower + 1u), at, wrap), part);
    }
    return color;
}
