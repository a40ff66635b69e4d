// Texels of photographs: `src/render/vulkan/photos/pool.rs` writes them, `src/projective/pyramid.rs` samples the same.
// The four texels around a place of a level, bilinear; clamped at the border.
vec4 photo_bilinear(uint table, uvec2 size, uint level, vec2 at) {
    uvec2 count = (size + (1u << level) - 1u) >> level;
    vec2 place = at * vec2(count) - 0.5;
    vec2 corner = floor(place);
    vec2 part = place - corner;
    ivec2 last = ivec2(count) - 1;
    ivec2 low = clamp(ivec2(corner), ivec2(0), last);
    ivec2 high = clamp(ivec2(corner) + 1, ivec2(0), last);
    uint first = table + photo_texels[table + level];
    uint upper = first + uint(low.y) * count.x;
    uint lower = first + uint(high.y) * count.x;
    vec4 a = unpackUnorm4x8(photo_texels[upper + uint(low.x)]);
    vec4 b = unpackUnorm4x8(photo_texels[upper + uint(high.x)]);
    vec4 c = unpackUnorm4x8(photo_texels[lower + uint(low.x)]);
    vec4 d = unpackUnorm4x8(photo_texels[lower + uint(high.x)]);
    return mix(mix(a, b, part.x), mix(c, d, part.x), part.y);
}

