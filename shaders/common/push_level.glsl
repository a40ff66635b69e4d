// A hole from the four nearest pixels of the next coarser level, by bilinear weights in whole numbers.
#include "common/reconstruct.glsl"

layout(set = 0, binding = 3) uniform sampler2D coarse_picked;
layout(set = 0, binding = 4) uniform sampler2D coarse_fronts;

// Alpha is 0 where none of the four has a color of the same surface.
vec4 from_coarse(ivec2 pixel, vec4 own, vec2 front) {
    ivec2 last = textureSize(coarse_picked, 0) - 1;
    // The pixel's middle lies a quarter of a coarse pixel off that pixel's middle: weights 3 and 1 a side.
    ivec2 near = pixel >> 1;
    ivec2 away = near + 2 * (pixel & 1) - 1;
    uvec3 sum = uvec3(0u);
    uint weights = 0u;
    // A loop of no turns, not a condition: software devices run both sides of a condition.
    int turns = is_hole(own) ? 4 : 0;
    for (int i = 0; i < turns; ++i) {
        bool is_away_x = (i & 1) != 0;
        bool is_away_y = (i & 2) != 0;
        ivec2 at = ivec2(is_away_x ? away.x : near.x, is_away_y ? away.y : near.y);
        ivec2 inside = clamp(at, ivec2(0), last);
        vec4 texel = texelFetch(coarse_picked, inside, 0);
        vec2 there = texelFetch(coarse_fronts, inside, 0).xy;
        uint weight = (is_away_x ? 1u : 3u) * (is_away_y ? 1u : 3u);
        if (at == inside && is_foreground(texel) && is_one_surface(front, there)) {
            sum += weight * uvec3(texel.rgb * 255.0 + 0.5);
            weights += weight;
        }
    }
    uint total = max(weights, 1u);
    return weights > 0u ? vec4(vec3((2u * sum + total) / (2u * total)) / 255.0, FOREGROUND) : vec4(0.0);
}
