#version 460
// Pass visibility.pull: a level of the pyramid from the level of twice its size. Of four pixels the nearest surface is
// kept: the mean of its foreground, or a hole. Colors are rounded in whole numbers, the same on every device.
#include "common/reconstruct.glsl"

layout(location = 0) out vec4 pulled;
layout(location = 1) out vec4 front;

void main() {
    ivec2 base = 2 * ivec2(gl_FragCoord.xy);
    ivec2 size = textureSize(picked, 0);
    vec4 texels[4];
    vec2 there[4];
    vec2 nearest = vec2(0.0);
    bool is_empty = true;
    for (int i = 0; i < 4; ++i) {
        ivec2 at = base + ivec2(i & 1, i >> 1);
        ivec2 inside = min(at, size - 1);
        texels[i] = at == inside ? texelFetch(picked, inside, 0) : vec4(0.0);
        there[i] = texelFetch(fronts, inside, 0).xy;
        if (texels[i].a > 0.25 && (is_empty || there[i].x < nearest.x)) {
            nearest = there[i];
            is_empty = false;
        }
    }
    uvec3 sum = uvec3(0u);
    uint colored = 0u;
    uint covered = 0u;
    vec2 colored_front = vec2(0.0);
    vec2 covered_front = vec2(0.0);
    for (int i = 0; i < 4; ++i) {
        if (texels[i].a > 0.25 && is_one_surface(nearest, there[i])) {
            covered += 1u;
            covered_front += there[i];
            if (is_foreground(texels[i])) {
                colored += 1u;
                colored_front += there[i];
                sum += uvec3(texels[i].rgb * 255.0 + 0.5);
            }
        }
    }
    uint count = max(colored, 1u);
    vec3 mean = vec3((2u * sum + count) / (2u * count)) / 255.0;
    pulled = colored > 0u ? vec4(mean, FOREGROUND) : vec4(0.0, 0.0, 0.0, covered > 0u ? HOLE : BACKGROUND);
    front = vec4(colored > 0u ? colored_front / float(colored) : covered_front / float(max(covered, 1u)), 0.0, 0.0);
}
