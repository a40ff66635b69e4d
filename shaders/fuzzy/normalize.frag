#version 460
// Pass fuzzy.normalize: the weighted mean. Where Gaussians deposit areas and the surface ends, the sum of weights is
// the covered fraction of the pixel; inside, where its noise would only hurt, the pixel is covered.
#include "common/headlight.glsl"

layout(set = 0, binding = 1) uniform sampler2D sums;
// Those of normals and depths; only looked at when there are such.
layout(set = 0, binding = 2) uniform sampler2D normals;

layout(location = 0) out vec4 color;
#ifdef NORMALS
layout(location = 1) out vec4 normal;
const bool WRITE_NORMALS = true;
#else
const bool WRITE_NORMALS = false;
#endif

layout(constant_id = 4) const bool IS_DEFERRED = false;
// The weights are areas.
layout(constant_id = 5) const bool HAS_COVERAGE = false;
// The frame has a lamp instead of the headlight.
layout(constant_id = 6) const bool HAS_LAMP = false;

// Where on the ray of the pixel a surface of that depth is, view space.
vec3 position_at(vec2 at, float depth) {
    if (has_flag(FLAG_ORTHOGRAPHIC)) {
        return vec3(at, (depth - frame.clip_from_view[3].z) / frame.clip_from_view[2].z);
    }
    return vec3(at, -1.0) * (frame.clip_from_view[3].z / (depth + frame.clip_from_view[2].z));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 sum = texelFetch(sums, pixel, 0);
    // Also for what is not a number.
    if (!(sum.a >= LEAST_FUZZY_WEIGHT)) {
        color = vec4(frame.background.rgb, 0.0);
#ifdef NORMALS
        normal = vec4(0.0);
#endif
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
    vec4 geometry = vec4(0.0);
    vec3 n = vec3(0.0);
    if (IS_DEFERRED || WRITE_NORMALS) {
        geometry = texelFetch(normals, pixel, 0);
        n = unit_or_zero(geometry.xyz);
    }
#ifdef NORMALS
    normal = vec4(n * mat3(frame.view_from_model) / frame.model_scale, 1.0);
#endif
    if (IS_DEFERRED) {
        vec2 at = gl_FragCoord.xy * frame.ray_scale + frame.ray_offset;
        if (HAS_LAMP) {
            mean = in_lamps(position_at(at, geometry.w / sum.a), n, mean, mean);
        } else {
            bool is_parallel = has_flag(FLAG_PARALLEL_LIGHT);
            mean = headlight(n, is_parallel ? vec3(0.0, 0.0, 1.0) : -normalize(vec3(at, -1.0)), mean, mean);
        }
    }
    // At least one level of coverage where anything is.
    color = vec4(mix(frame.background.rgb, mean, covered), max(covered, 1.0 / 255.0));
}
