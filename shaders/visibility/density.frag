#version 460
// Pass visibility.density: every hole from the centers within a radius that follows how dense they are around it.
#include "common/gather.glsl"

// The half sides of windows tried are 1, 2, 4, 8 and this, pixels.
const int LARGEST_WINDOW = 16;
// A window with so many centers tells a density.
const int ENOUGH = 4;
// No radius is larger, pixels; above the diagonal of the largest window.
const float LARGEST_RADIUS = 24.0;

// The radius for a hole; negative where no center is near.
float radius_at(ivec2 pixel, vec2 front) {
    ivec2 corner = textureSize(picked, 0) - 1;
    int count = 0;
    float nearest = 1e30;
    float area = 1.0;
    for (int reach = 1; reach <= LARGEST_WINDOW && count < ENOUGH; reach *= 2) {
        ivec2 first = max(pixel - reach, ivec2(0));
        ivec2 last = min(pixel + reach, corner);
        area = float((last.x - first.x + 1) * (last.y - first.y + 1));
        count = 0;
        for (int y = first.y; y <= last.y; ++y) {
            for (int x = first.x; x <= last.x; ++x) {
                vec4 other = texelFetch(picked, ivec2(x, y), 0);
                vec2 there = texelFetch(fronts, ivec2(x, y), 0).xy;
                vec2 step = vec2(ivec2(x, y) - pixel);
                if (is_foreground(other) && is_one_surface(front, there)) {
                    count += 1;
                    nearest = min(nearest, dot(step, step));
                }
            }
        }
    }
    // 1.5 times the spacing, and never less than the way to the nearest.
    return count > 0 ? min(max(1.5 * sqrt(area / float(count)), sqrt(nearest) + 1e-3), LARGEST_RADIUS) : -1.0;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 own = texelFetch(picked, pixel, 0);
    vec2 front = texelFetch(fronts, pixel, 0).xy;
    float radius = -1.0;
    // A loop, not a condition: software devices run both sides of a condition.
    for (int once = is_hole(own) ? 0 : 1; once < 1; ++once) {
        radius = radius_at(pixel, front);
    }
    resolve(own, front, gather(pixel, front, radius));
}
