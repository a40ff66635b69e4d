#version 460
// Pass filtered.normalize: the mean color of what was deposited. Where the surface ends, before the background or before
// a farther part, the deposited area is the covered fraction of the pixel; inside, where its noise would only hurt, the
// pixel is covered.
#include "common/frame.glsl"

layout(set = 0, binding = 1) uniform sampler2D sums;
layout(set = 0, binding = 2) uniform sampler2D front;

layout(location = 0) out vec4 color;

const float LEAST_WEIGHT = 1e-6;
// A neighbor is another part when its front lies farther by this many pixels' (or splats') width.
const float JUMP = 3.0;

// Distance along the view direction of a depth, which is not 0.
float distance_of(float depth) {
    float p22 = frame.clip_from_view[2][2];
    float p32 = frame.clip_from_view[3][2];
    return (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? (p32 - depth) / p22 : p32 / (depth + p22);
}

// Covered fraction of a pixel that another part lies before: whole, but where that part ends too.
float coverage_of_part(ivec2 pixel, float sum, ivec2 last) {
    for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            ivec2 neighbor = pixel + ivec2(x, y);
            if (any(lessThan(neighbor, ivec2(0))) || any(greaterThan(neighbor, last))) {
                continue;
            }
            if (!(texelFetch(front, neighbor, 0).r > 0.0)) {
                return min(2.0 * sum, 1.0);
            }
        }
    }
    return 1.0;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 sum = texelFetch(sums, pixel, 0);
    if (!(sum.a > LEAST_WEIGHT)) {
        color = vec4(frame.background.rgb, 0.0);
        return;
    }
    float own = texelFetch(front, pixel, 0).r;
    // Beyond the squares of the first pass nothing is in front of anything.
    bool is_rim = !(own > 0.0);
    float limit = 0.0;
    if (!is_rim) {
        float distance = distance_of(own);
        float width = (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? 1.0 : distance;
        limit = distance + JUMP * max(frame.splat_size_px, 1.0) * width / frame.focal_px;
    }
    ivec2 last = textureSize(sums, 0) - 1;
    float around = 0.0;
    vec4 behind = vec4(0.0);
    for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            ivec2 neighbor = pixel + ivec2(x, y);
            if (any(lessThan(neighbor, ivec2(0))) || any(greaterThan(neighbor, last)) || (x == 0 && y == 0)) {
                continue;
            }
            float depth = texelFetch(front, neighbor, 0).r;
            if (!(depth > 0.0)) {
                around += 1.0;
            } else if (limit > 0.0 && distance_of(depth) > limit) {
                vec4 there = texelFetch(sums, neighbor, 0);
                around += 1.0;
                if (there.a > LEAST_WEIGHT) {
                    behind += vec4(there.rgb / there.a, 1.0) * coverage_of_part(neighbor, there.a, last);
                }
            }
        }
    }
    is_rim = is_rim || around > 0.0;
    if (is_rim && sum.a < LEAST_FILTERED_COVERAGE && behind.a == 0.0) {
        color = vec4(frame.background.rgb, 0.0);
        return;
    }
    float covered = is_rim ? min(sum.a, 1.0) : 1.0;
    vec4 beyond = behind / max(around, 1.0);
    beyond.rgb += (1.0 - beyond.a) * frame.background.rgb;
    float alpha = covered + (1.0 - covered) * beyond.a;
    // At least one level of coverage where anything is.
    color = vec4(mix(beyond.rgb, sum.rgb / sum.a, covered), max(alpha, 1.0 / 255.0));
}
