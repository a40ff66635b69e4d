#version 460
// Pass fuzzy.normalize: the weighted mean. Where Gaussians deposit areas and the surface ends, the sum of weights is
// the covered fraction of the pixel; inside, where its noise would only hurt, the pixel is covered.
#include "common/headlight.glsl"

layout(set = 0, binding = 1) uniform sampler2D sums;
// Those of normals; only looked at when lit here.
layout(set = 0, binding = 2) uniform sampler2D normals;

layout(location = 0) out vec4 color;

layout(constant_id = 4) const bool IS_DEFERRED = false;
// The weights are areas.
layout(constant_id = 5) const bool HAS_COVERAGE = false;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 sum = texelFetch(sums, pixel, 0);
    // Also for what is not a number.
    if (!(sum.a >= LEAST_FUZZY_WEIGHT)) {
        color = vec4(frame.background.rgb, 0.0);
        return;
    }
    float covered = 1.0;
    if (HAS_COVERAGE) {
        ivec2 last = textureSize(sums, 0) - 1;
        for (int y = -1; y <= 1; ++y) {
            for (int x = -1; x <= 1; ++x) {
                ivec2 neighbor = clamp(pixel + ivec2(x, y), ivec2(0), last);
                if (!(texelFetch(sums, neighbor, 0).a >= LEAST_FUZZY_WEIGHT)) {
                    covered = min(sum.a, 1.0);
                }
            }
        }
    }
    vec3 mean = sum.rgb / sum.a;
    if (IS_DEFERRED) {
        vec3 n = texelFetch(normals, pixel, 0).xyz;
        float squared = dot(n, n);
        n = squared > 0.0 ? n * inversesqrt(squared) : vec3(0.0);
        vec3 l = vec3(0.0, 0.0, 1.0);
        if ((frame.flags & FLAG_PARALLEL_LIGHT) == 0u) {
            l = -normalize(vec3(gl_FragCoord.xy * frame.ray_scale + frame.ray_offset, -1.0));
        }
        mean = headlight(n, l, mean, mean);
    }
    // At least one level of coverage where anything is.
    color = vec4(mix(frame.background.rgb, mean, covered), max(covered, 1.0 / 255.0));
}
