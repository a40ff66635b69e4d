// Sets a patch of a cut by error up, of the fields of common/polygon_parts.glsl.
#include "common/patch_plane.glsl"

// The rectangle of the picture that a patch may be seen in, pixels from the middle.
struct PatchRectangle {
    // Direction of its longer sides; unit.
    vec2 direction;
    // Least and greatest along them, and across them, before it is widened by the margin.
    vec2 ends;
    vec2 across;
    // Distance of the middle, within the near and far plane.
    float distance;
    // It is behind the eye, or left out as facing away.
    bool is_gone;
};

const float ENDLESS = 1e30;

void set_up_patch(out PatchPlane patch_plane, out PatchRectangle rectangle) {
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
        patch_plane.sides[3 * i] = vec4(sides[4 * i], sides[4 * i + 1].x);
        patch_plane.sides[3 * i + 1] = vec4(sides[4 * i + 1].yz, sides[4 * i + 2].xy);
        patch_plane.sides[3 * i + 2] = vec4(sides[4 * i + 2].z, sides[4 * i + 3]);
    }
    vec3 u_over = u / (scale * scale);
    vec3 v_over = v / (scale * scale);
    patch_plane.along_u = vec4(u_over, dot(u_over, c));
    patch_plane.along_v = vec4(v_over, dot(v_over, c));
    // The ray is t (x, y, -1), and t the distance: 1 / t = n . (x, y, -1) / n . c; of parallel rays t falls with x and y.
    vec2 slope = is_parallel ? n.xy * frame.ray_scale / n.z : n.xy * frame.ray_scale / off;
    bool has_slope = abs(is_parallel ? n.z : off) > 1e-12;
    patch_plane.plane = vec4(has_slope ? slope : vec2(0.0), is_parallel ? -c.z : 1.0 / -c.z, thick);
    patch_plane.limits = vec4(clamp(nearest - thick, near, far), clamp(farthest + thick, near, far), margin, light_share());
    patch_plane.extent = vec4(low, high);
    patch_plane.normal_and_shape = vec4(turn * shading_normal, shape_operator.x);
    patch_plane.shape_and_middle = vec4(shape_operator.yz, middle);
    mat2x3 change = color_slopes();
    patch_plane.color_a = vec4(color.rgb, change[0].x);
    patch_plane.color_b = vec4(change[0].yz, change[1].xy);
    patch_plane.color_c = change[1].z;
    rectangle.direction = direction;
    rectangle.ends = ends;
    rectangle.across = across;
    rectangle.distance = clamp(-c.z, near, far);
    rectangle.is_gone = faces_away(c) || nearest <= 0.0 && !is_parallel;
}

// Whether a window position lies in the rectangle around a patch.
bool is_in_rectangle(PatchPlane own, PatchRectangle rectangle, vec2 window) {
    vec2 at = window - own.shape_and_middle.zw;
    float p = dot(at, rectangle.direction);
    float q = dot(at, vec2(-rectangle.direction.y, rectangle.direction.x));
    float margin = own.limits.z;
    return p >= rectangle.ends.x - margin && p <= rectangle.ends.y + margin && q >= rectangle.across.x - margin
        && q <= rectangle.across.y + margin;
}
