#version 460
// Pass filtered.normalize: the mean color of what was deposited. Where the surface ends, the deposited area is the
// covered fraction of the pixel; inside, where its noise would only hurt, the pixel is covered.
#include "common/frame.glsl"

layout(set = 0, binding = 1) uniform sampler2D sums;

layout(location = 0) out vec4 color;

const float LEAST_WEIGHT = 1e-6;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 sum = texelFetch(sums, pixel, 0);
    if (!(sum.a > LEAST_WEIGHT)) {
        color = vec4(frame.background.rgb, 0.0);
        return;
    }
    ivec2 last = textureSize(sums, 0) - 1;
    bool is_rim = false;
    for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            ivec2 neighbor = pixel + ivec2(x, y);
            if (all(greaterThanEqual(neighbor, ivec2(0))) && all(lessThanEqual(neighbor, last))) {
                is_rim = is_rim || !(texelFetch(sums, neighbor, 0).a > LEAST_WEIGHT);
            }
        }
    }
    float covered = is_rim ? min(sum.a, 1.0) : 1.0;
    vec3 mean = sum.rgb / sum.a;
    // At least one level of coverage where anything is.
    color = vec4(mix(frame.background.rgb, mean, covered), max(covered, 1.0 / 255.0));
}
