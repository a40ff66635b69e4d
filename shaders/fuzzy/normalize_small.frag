#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass fuzzy.normalize where compute summed small splats: the weighted mean, and the depth of the picture.
#include "common/frame.glsl"
#include "common/small_sums.glsl"

layout(location = 0) out vec4 color;

// The weights are areas.
layout(constant_id = 5) const bool HAS_COVERAGE = false;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 sum = sum_at(pixel);
    float covered = 1.0;
    if (HAS_COVERAGE) {
        ivec4 known = bounds();
        // Where something hides what is behind, something also counts; elsewhere the sums say. They take long to read.
        uint unsure = 0u;
        for (int i = 0; i < 9; ++i) {
            ivec2 neighbor = clamp(pixel + ivec2(i % 3 - 1, i / 3 - 1), known.xy, known.zw - 1);
            unsure |= front_at(neighbor) > 0.0 ? 0u : 1u << i;
        }
        while (unsure != 0u) {
            int i = findLSB(unsure);
            unsure &= unsure - 1u;
            ivec2 neighbor = clamp(pixel + ivec2(i % 3 - 1, i / 3 - 1), known.xy, known.zw - 1);
            if (!(sum_at(neighbor).a >= LEAST_FUZZY_WEIGHT)) {
                covered = min(sum.a, 1.0);
                unsure = 0u;
            }
        }
    }
    // Also what is not a number shows nothing. At least one level of coverage where anything is.
    color = sum.a >= LEAST_FUZZY_WEIGHT
        ? vec4(mix(frame.background.rgb, sum.rgb / sum.a, covered), max(covered, 1.0 / 255.0))
        : vec4(frame.background.rgb, 0.0);
    gl_FragDepth = front_at(pixel);
}
