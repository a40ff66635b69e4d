// The mean color of what was deposited in a pixel. Where the surface ends, the deposited area is the covered fraction of
// the pixel; inside, where its noise would only hurt, the pixel is covered.
// Needs `vec4 sum_at(ivec2 pixel)`.
#include "common/frame.glsl"

const float LEAST_WEIGHT = 1e-6;

vec4 normalized(ivec2 pixel, ivec2 size) {
    vec4 sum = sum_at(pixel);
    if (!(sum.a > LEAST_WEIGHT)) {
        return vec4(frame.background.rgb, 0.0);
    }
    bool is_rim = false;
    for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            ivec2 neighbor = pixel + ivec2(x, y);
            if (all(greaterThanEqual(neighbor, ivec2(0))) && all(lessThan(neighbor, size))) {
                is_rim = is_rim || !(sum_at(neighbor).a > LEAST_WEIGHT);
            }
        }
    }
    float covered = is_rim ? min(sum.a, 1.0) : 1.0;
    vec3 mean = sum.rgb / sum.a;
    // At least one level of coverage where anything is.
    return vec4(mix(frame.background.rgb, mean, covered), max(covered, 1.0 / 255.0));
}
