// The mean color of what filtered splats deposited in a pixel. Where the surface ends, before the background or before a
// farther part, the deposited area is the covered fraction of the pixel; inside, where its noise would only hurt, the pixel
// is covered.
// Needs `float front_at(ivec2)`, the reversed depth of the first pass, `vec4 sum_at(ivec2)`, and `ivec4 bounds()`, the first
// and one past the last pixel that these know: no other is looked at.
#include "common/frame.glsl"
#include "common/distance.glsl"

const float LEAST_WEIGHT = 1e-6;

bool is_known(ivec2 pixel, ivec4 known) {
    return all(greaterThanEqual(pixel, known.xy)) && all(lessThan(pixel, known.zw));
}

// Covered fraction of a pixel that another part lies before: whole, but where that part ends too.
float coverage_of_part(ivec2 pixel, float sum, ivec4 known) {
    for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            ivec2 neighbor = pixel + ivec2(x, y);
            if (is_known(neighbor, known) && !(front_at(neighbor) > 0.0)) {
                return min(2.0 * sum, 1.0);
            }
        }
    }
    return 1.0;
}

// Nearest and farthest depth (reversed: largest and least) of the part that a pixel of depth `own`, not 0, belongs to. What
// is nearer or farther is another part.
vec2 range_of_part(float own) {
    float distance = distance_of(own);
    float width = (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? 1.0 : distance;
    float jump = FILTERED_JUMP * max(frame.splat_size_px, 1.0) * width / frame.focal_px;
    return vec2(distance > jump ? depth_of(distance - jump) : 1.0, depth_of(distance + jump));
}

// What pixels near by of the same part deposited: the color between rectangles, which are not as dense as the squares of the
// first pass. It is looked for in eight directions, at distances that each are the sum of the two before; and in squares all
// around only where nothing lies in those, since there are far more pixels in squares. One loop, of one pixel a turn: where
// lanes are masked every loop has a turn.
vec4 sum_near(ivec2 pixel, vec2 part, ivec4 known) {
    vec4 sum = vec4(0.0);
    bool is_along = true;
    int reach = 1, before = 1;
    // Around the square from its first corner; turned at each.
    ivec2 at = ivec2(-1), along = ivec2(1, 0);
    for (;;) {
        ivec2 neighbor = pixel + at;
        if (is_known(neighbor, known)) {
            float depth = front_at(neighbor);
            if (depth >= part.y && depth <= part.x) {
                sum += sum_at(neighbor);
            }
        }
        at += along;
        bool is_corner = abs(at.x) == abs(at.y);
        along = is_corner ? ivec2(-along.y, along.x) : along;
        if (is_corner && at.x < 0 && at.y < 0) {
            int next = is_along ? reach + before : reach + 1;
            bool is_last = next > int(is_along ? FILTERED_REACH_PX : FILTERED_AROUND_PX);
            if (sum.a > LEAST_WEIGHT || is_last && !is_along) {
                return sum;
            }
            before = reach;
            reach = is_last ? 2 : next;
            is_along = is_along && !is_last;
            at = ivec2(-reach);
            along = ivec2(is_along ? reach : 1, 0);
        }
    }
}

vec4 normalized(ivec2 pixel, float own) {
    vec4 color = vec4(frame.background.rgb, 0.0);
    vec4 sum = sum_at(pixel);
    ivec4 known = bounds();
    bool is_between = !(sum.a > LEAST_WEIGHT);
    if (!is_between || own > 0.0) {
        // Where the pixel has no depth nothing is another part: beyond the squares of the first pass nothing is in front of
        // anything.
        vec2 part = own > 0.0 ? range_of_part(own) : vec2(1.0, 0.0);
        float around = 0.0;
        // Which of the neighbors are other parts, farther than this one.
        uint parts = 0u;
        for (int i = 0; i < 9; ++i) {
            ivec2 neighbor = pixel + ivec2(i % 3 - 1, i / 3 - 1);
            if (i != 4 && is_known(neighbor, known)) {
                float depth = front_at(neighbor);
                bool is_part = depth > 0.0 && depth < part.y;
                around += is_part || !(depth > 0.0) ? 1.0 : 0.0;
                parts |= is_part ? 1u << i : 0u;
            }
        }
        vec4 behind = vec4(0.0);
        while (parts != 0u) {
            int i = findLSB(parts);
            parts &= parts - 1u;
            ivec2 neighbor = pixel + ivec2(i % 3 - 1, i / 3 - 1);
            vec4 there = sum_at(neighbor);
            if (there.a > LEAST_WEIGHT) {
                behind += vec4(there.rgb / there.a, 1.0) * coverage_of_part(neighbor, there.a, known);
            }
        }
        bool is_rim = !(own > 0.0) || around > 0.0;
        if (is_rim && !(sum.a >= LEAST_FILTERED_COVERAGE) && behind.a == 0.0) {
            return color;
        }
        if (is_between) {
            // At a rim nothing, else what is around.
            sum = is_rim ? vec4(0.0) : sum_near(pixel, part, known);
            if (!is_rim && !(sum.a > LEAST_WEIGHT)) {
                return color;
            }
        }
        float covered = is_rim ? min(sum.a, 1.0) : 1.0;
        vec4 beyond = behind / max(around, 1.0);
        beyond.rgb += (1.0 - beyond.a) * frame.background.rgb;
        float alpha = covered + (1.0 - covered) * beyond.a;
        vec3 own_color = sum.a > 0.0 ? sum.rgb / sum.a : vec3(0.0);
        // At least one level of coverage where anything is.
        color = vec4(mix(beyond.rgb, own_color, covered), max(alpha, 1.0 / 255.0));
    }
    return color;
}
