// The footprint of an oriented disc, exact in perspective: ray and plane, as a quadratic form in pixels.
//
// A disc has center c, unit normal n and radius r in view space. The ray through a pixel at an offset of (x, y) pixels
// from the projected center has the direction d = d_c + e, d_c = c / z. It meets the plane in q = z d / (1 + M.e),
// M = z n / (n.c), so q - c = z (e - d_c (M.e)) / (1 + M.e): free of cancellation. With rho = |q - c| / r,
//
//     rho^2 = (x, y) form (x, y) / (1 + skew.(x, y))^2.
//
// Orthographic rays are parallel to z; then skew = 0.
#include "common/form.glsl"
#include "common/frame.glsl"

// Smallest ratio of the axes of a footprint: at a rim normals are unsure and a line would leave holes.
const float LEAST_RATIO = 0.1;

// Framebuffer position of a view-space point in front of the eye.
vec2 position_px(vec3 in_view) {
    vec2 at = has_flag(FLAG_ORTHOGRAPHIC) ? in_view.xy : in_view.xy / -in_view.z;
    return (at - frame.ray_offset) / frame.ray_scale;
}

// Unit vector from a view-space point to the eye; towards the viewer in an orthographic view.
vec3 to_eye(vec3 in_view) {
    return has_flag(FLAG_ORTHOGRAPHIC) ? vec3(0.0, 0.0, 1.0) : -normalize(in_view);
}

// Half the thickness of the patch over its radius, from the alpha of its color (1 / 255 to 1: 255 is flat).
float thickness_of(float alpha) {
    return (1.0 - alpha) * (255.0 / 254.0);
}

// Normal of the plane in which the footprint of a patch is a disc. The patch lies in a ball, between two planes with
// normal n at a distance of `thickness` radii from its middle; v is the direction to the eye. A slab seen under the
// cosine k is k + thickness sin wide, which is the ratio of the disc's axes. A zero normal: facing.
vec3 footprint_normal(vec3 n, vec3 v, float thickness) {
    float facing = dot(n, v);
    vec3 across = n - facing * v;
    float sine = length(across);
    float ratio = clamp(abs(facing) + thickness * sine, LEAST_RATIO, 1.0);
    // Towards the eye; facing when there is no normal or it points straight there.
    if (sine < 1e-6) {
        return v;
    }
    return ratio * v + sqrt(1.0 - ratio * ratio) * sign(facing == 0.0 ? 1.0 : facing) * (across / sine);
}

// Ends a footprint whose form and skew are set.
Disc bounded(Disc disc) {
    disc.size_px = size_of(inverse_form(disc.form), disc.skew);
    if (!(disc.size_px >= LEAST_ROUND_PX)) {
        disc.form = vec3(0.0);
        disc.skew = vec2(0.0);
        disc.lean = vec2(0.0);
        disc.dome = 0.0;
        disc.size_px = disc.size_px >= 1.0 ? disc.size_px : 1.0;
    } else {
        bool is_leaning = disc.size_px >= LEAST_LEANING_PX;
        disc.lean = is_leaning ? disc.lean : vec2(0.0);
        disc.dome = is_leaning ? disc.dome : 0.0;
        // The device snaps the center; what the square gains is cut off by the form.
        disc.size_px += 1.0 / 64.0;
    }
    return disc;
}

// Reversed depth of an opaque splat at an offset from its center, in pixels, where that has `depth`.
float dome_depth(float depth, vec3 form, vec2 lean, float dome, vec2 offset) {
    float squared = form.x * offset.x * offset.x + 2.0 * form.y * offset.x * offset.y + form.z * offset.y * offset.y;
    return clamp(depth + dot(lean, offset) - dome * squared, 0.0, 1.0);
}

// A circle of `radius_px` around a framebuffer position.
Disc circle_at(vec2 center_px, float radius_px) {
    return bounded(Disc(center_px, vec3(1.0, 0.0, 1.0) / (radius_px * radius_px), vec2(0.0), 0.0, vec2(0.0), 0.0));
}

// The same around a center in view space.
Disc circle(vec3 center, float radius_px) {
    return circle_at(position_px(center), radius_px);
}

// Form and skew of the footprint of a patch around `center`, all in view space; `normal` unit, or zero where there is
// none. `is_widened`: by the frame's Gaussian, where rho = 1 stands for two standard deviations. (A constant, since a device may
// compile a shader anew that asks the frame whether there is one.)
Disc unbounded_footprint(vec3 center, vec3 normal, float radius, float thickness, bool is_widened) {
    Disc disc;
    disc.center_px = position_px(center);
    disc.skew = vec2(0.0);
    disc.lean = vec2(0.0);
    disc.dome = 0.0;
    vec2 scale = frame.ray_scale;
    bool is_orthographic = has_flag(FLAG_ORTHOGRAPHIC);
    float distance = is_orthographic ? 1.0 : -center.z;
    // The near plane in view space, from the projection: depth 1 there.
    float near = frame.clip_from_view[3][2] / (1.0 + frame.clip_from_view[2][2]);
    vec3 n = footprint_normal(normal, to_eye(center), thickness);
    float nearest = distance - radius * length(n.xy);
    if (!is_orthographic && nearest <= near) {
        // Its plane may reach behind the eye, where it has no picture: a circle that faces the viewer.
        float extent = radius * frame.focal_px / max(distance, near);
        disc.form = vec3(1.0, 0.0, 1.0) / (extent * extent);
    } else {
        // Along the ray it is higher, at most a radius.
        float height = radius * min(DOME_HEIGHT / dot(n, to_eye(center)), 1.0);
        vec3 x;
        vec3 y;
        if (is_orthographic) {
            x = vec3(1.0, 0.0, -n.x / n.z);
            y = vec3(0.0, 1.0, -n.y / n.z);
            disc.lean = n.xy / n.z * scale * -frame.clip_from_view[2][2];
            disc.dome = height * frame.clip_from_view[2][2];
        } else {
            vec3 along = center / distance;
            vec2 slope = n.xy / dot(n, along);
            x = vec3(1.0, 0.0, 0.0) - along * slope.x;
            y = vec3(0.0, 1.0, 0.0) - along * slope.y;
            disc.skew = slope * scale;
            // Depth is a constant and this over the distance.
            float over = frame.clip_from_view[3][2] / distance;
            disc.lean = disc.skew * over;
            // A way s further along the ray costs s over the square of the distance, and that is where the form has its own
            // square. Half of the nearest distance at most, lest depth ends behind everything.
            disc.dome = over * (min(height, 0.5 * nearest) / distance);
        }
        x *= scale.x * distance / radius;
        y *= scale.y * distance / radius;
        disc.form = vec3(dot(x, x), dot(x, y), dot(y, y));
    }
    if (is_widened) {
        vec3 inverse = inverse_form(disc.form);
        inverse.xz += 4.0 * frame.low_pass_px * frame.low_pass_px;
        disc.form = inverse_form(inverse);
    }
    disc.size_px = 0.0;
    return disc;
}

// The footprint of a patch, see unbounded_footprint; a pixel at least.
Disc footprint(vec3 center, vec3 normal, float radius, float thickness, bool is_widened) {
    return bounded(unbounded_footprint(center, normal, radius, thickness, is_widened));
}

// The footprint as it is: it may lie between the centers of pixels.
Disc exact_footprint(vec3 center, vec3 normal, float radius, float thickness) {
    Disc disc = unbounded_footprint(center, normal, radius, thickness, false);
    float size = size_of(inverse_form(disc.form), disc.skew) + 1.0 / 64.0;
    disc.size_px = size >= 1.0 ? size : 1.0;
    return disc;
}
