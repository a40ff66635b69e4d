#version 460
// A rectangle of the picture around each patch of a cut by error, widened by what its thickness shows beside it.
//
// A pixel is in the widened patch where its signed distance from every side is at least minus the margin, and where it lies in
// this rectangle, which ends along the longest side: at sharp corners sides alone would reach far beyond. The cut sees to it that
// no patch reaches the near plane. All positions are counted from the middle, where the origin of the plane lies.
#include "common/polygon.glsl"

// Signed distances from two sides: x, y and constant of both.
layout(location = 0) flat out vec4 sides_a[6];
// Along u and v: the direction in view space over the square of the model's scale, and its product with the center.
layout(location = 6) flat out vec4 along_u;
layout(location = 7) flat out vec4 along_v;
// Inverse distance (perspective) or distance of the plane: change along x and y, and that of the middle; thickness.
layout(location = 8) flat out vec4 plane;
// Least and greatest distance, margin in pixels, part of the light that is kept.
layout(location = 9) flat out vec4 limits;
// Least and greatest (u, v).
layout(location = 10) flat out vec4 extent;
// Normal in view space at u = v = 0, and the first of the shape operator.
layout(location = 11) flat out vec4 normal_and_shape;
// Its others, and the middle in pixels.
layout(location = 12) flat out vec4 shape_and_middle;
// Color, and its change along u and v.
layout(location = 13) flat out vec4 color_a;
layout(location = 14) flat out vec4 color_b;
layout(location = 15) flat out float color_c;

const float ENDLESS = 1e30;

void main() {
    bool is_parallel = has_flag(FLAG_ORTHOGRAPHIC);
    float scale = frame.model_scale;
    mat3 turn = mat3(frame.view_from_model);
    vec3 c = (frame.view_from_model * vec4(center, 1.0)).xyz;
    vec3 u = turn * axis;
    vec3 v = turn * second_axis();
    vec3 n = turn * normal / scale;
    float near = frame.clip_from_view[3][2] / (1.0 + frame.clip_from_view[2][2]);
    float far = frame.clip_from_view[3][2] / frame.clip_from_view[2][2];
    if (is_parallel) {
        near = (frame.clip_from_view[3][2] - 1.0) / frame.clip_from_view[2][2];
        far = frame.clip_from_view[3][2] / frame.clip_from_view[2][2];
    }
    float thick = thickness * scale;
    float along_view = max(-c.z, near);
    vec2 ray = is_parallel ? c.xy : c.xy / along_view;
    vec2 middle = (ray - frame.ray_offset) / frame.ray_scale;

    // Corners on the picture, without the rounding of positions.
    vec2 feet[CORNERS] = footprint();
    vec2 places[CORNERS];
    vec2 low = vec2(0.0);
    vec2 high = vec2(0.0);
    float nearest = ENDLESS;
    float farthest = -ENDLESS;
    float sine_squared = 0.0;
    float least_cosine = 1.0;
    float off = dot(n, c);
    for (int i = 0; i < CORNERS; i++) {
        vec3 way = feet[i].x * u + feet[i].y * v;
        vec3 at = c + way;
        float other = max(-at.z, near);
        vec2 moved = is_parallel ? way.xy : (way.xy * along_view + c.xy * way.z) / (along_view * other);
        places[i] = moved / frame.ray_scale;
        low = min(low, feet[i]);
        high = max(high, feet[i]);
        nearest = min(nearest, -at.z);
        farthest = max(farthest, -at.z);
        float squared = dot(at, at);
        sine_squared = max(sine_squared, 1.0 - off * off / squared);
        least_cosine = min(least_cosine, -at.z * inversesqrt(squared));
    }
    float margin = is_parallel
        ? thick * frame.focal_px * sqrt(max(1.0 - n.z * n.z, 0.0))
        : thick * frame.focal_px / max(nearest - thick, near) * sqrt(sine_squared) / max(least_cosine, 0.1);
    // A little for rounding.
    margin += 1e-3;

    // Sides, and the longest of them.
    float area = 0.0;
    vec2 size = vec2(0.0);
    for (int i = 1; i < CORNERS; i++) {
        vec2 from = places[i - 1] - places[0];
        vec2 to = places[i] - places[0];
        area += from.x * to.y - from.y * to.x;
        size = max(size, abs(to));
    }
    float size_squared = dot(size, size);
    bool is_line = abs(area) <= 1e-6 * size_squared;
    float longest = 0.0;
    vec2 direction = vec2(1.0, 0.0);
    vec3 sides[CORNERS];
    for (int i = 0; i < CORNERS; i++) {
        vec2 from = places[i];
        vec2 edge = places[(i + 1) % CORNERS] - from;
        float squared = dot(edge, edge);
        if (squared > longest) {
            longest = squared;
            direction = edge;
        }
        sides[i] = vec3(0.0, 0.0, ENDLESS);
        // Rounding turns what is far shorter than the longest side.
        if (squared > 1e-8 * size_squared && !is_line) {
            vec2 inward = vec2(-edge.y, edge.x) * (sign(area) * inversesqrt(squared));
            sides[i] = vec3(inward, -dot(inward, from));
        }
    }
    direction = longest > 0.0 ? direction * inversesqrt(longest) : direction;
    vec2 ends = vec2(ENDLESS, -ENDLESS);
    vec2 across = vec2(ENDLESS, -ENDLESS);
    for (int i = 0; i < CORNERS; i++) {
        float p = dot(places[i], direction);
        float q = dot(places[i], vec2(-direction.y, direction.x));
        ends = vec2(min(ends.x, p), max(ends.y, p));
        across = vec2(min(across.x, q), max(across.y, q));
    }

    for (int i = 0; i < 2; i++) {
        sides_a[3 * i] = vec4(sides[4 * i], sides[4 * i + 1].x);
        sides_a[3 * i + 1] = vec4(sides[4 * i + 1].yz, sides[4 * i + 2].xy);
        sides_a[3 * i + 2] = vec4(sides[4 * i + 2].z, sides[4 * i + 3]);
    }
    vec3 u_over = u / (scale * scale);
    vec3 v_over = v / (scale * scale);
    along_u = vec4(u_over, dot(u_over, c));
    along_v = vec4(v_over, dot(v_over, c));
    // The ray is t (x, y, -1), and t the distance: 1 / t = n . (x, y, -1) / n . c; of parallel rays t falls with x and y.
    vec2 slope = is_parallel ? n.xy * frame.ray_scale / n.z : n.xy * frame.ray_scale / off;
    bool has_slope = abs(is_parallel ? n.z : off) > 1e-12;
    plane = vec4(has_slope ? slope : vec2(0.0), is_parallel ? -c.z : 1.0 / -c.z, thick);
    limits = vec4(clamp(nearest - thick, near, far), clamp(farthest + thick, near, far), margin, light_share());
    extent = vec4(low, high);
    normal_and_shape = vec4(turn * shading_normal, shape_operator.x);
    shape_and_middle = vec4(shape_operator.yz, middle);
    mat2x3 change = color_slopes();
    color_a = vec4(color.rgb, change[0].x);
    color_b = vec4(change[0].yz, change[1].xy);
    color_c = change[1].z;

    // Corners of the rectangle: 0, 1, 2 and 2, 1, 3.
    int corner = gl_VertexIndex < 3 ? gl_VertexIndex : 6 - gl_VertexIndex - (gl_VertexIndex == 5 ? -2 : 1);
    vec2 at = direction * ((corner & 1) == 0 ? ends.x - margin : ends.y + margin)
        + vec2(-direction.y, direction.x) * ((corner & 2) == 0 ? across.x - margin : across.y + margin);
    vec2 through = (middle + at) * frame.ray_scale + frame.ray_offset;
    float distance = clamp(-c.z, near, far);
    vec3 shown = is_parallel ? vec3(through, -distance) : vec3(through, -1.0) * distance;
    bool is_gone = faces_away(c) || nearest <= 0.0 && !is_parallel;
    gl_Position = is_gone ? vec4(0.0, 0.0, 2.0, 1.0) : frame.clip_from_view * vec4(shown, 1.0);
}
