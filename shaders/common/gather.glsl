// A weighted mean of the foreground around a hole.
#include "common/resolve.glsl"

// Mean of the foreground of the same surface within `radius` pixels, weighted by a Gaussian of half that deviation;
// alpha is 0 where there is none. A negative radius asks for none.
vec4 gather(ivec2 pixel, vec2 front, float radius) {
    int reach = int(floor(radius));
    float squared = radius * radius;
    ivec2 first = max(pixel - reach, ivec2(0));
    ivec2 last = min(pixel + reach, textureSize(picked, 0) - 1);
    vec4 sum = vec4(0.0);
    for (int y = first.y; y <= last.y; ++y) {
        for (int x = first.x; x <= last.x; ++x) {
            vec4 other = texelFetch(picked, ivec2(x, y), 0);
            vec2 there = texelFetch(fronts, ivec2(x, y), 0).xy;
            vec2 step = vec2(ivec2(x, y) - pixel);
            float distance = dot(step, step);
            if (is_foreground(other) && distance <= squared && is_one_surface(front, there)) {
                sum += vec4(other.rgb, 1.0) * exp(-2.0 * distance / squared);
            }
        }
    }
    return sum.a > 0.0 ? vec4(sum.rgb / sum.a, 1.0) : vec4(0.0);
}
