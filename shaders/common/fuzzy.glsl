// What the vertex shaders of both passes of fuzzy splats share.
#include "common/round.glsl"
#include "common/headlight.glsl"
#include "common/octahedral.glsl"

// A Gaussian in the plane of the surface, else weights of 1.
layout(constant_id = 0) const bool IS_GAUSS = false;
// A disc in the plane of the surface.
layout(constant_id = 1) const bool IS_ORIENTED = false;
// A square, else (if not oriented) a circle.
layout(constant_id = 3) const bool IS_SQUARE = false;

struct Surfel {
    // All in view space.
    vec3 center;
    // Unit, or zero where there is none.
    vec3 normal;
    float radius;
    // In radii.
    float thickness;
    // Cosine between normal and view ray; 1 without a normal.
    float facing;
};

Surfel surfel_of(vec3 center, float radius, vec2 packed_normal, float alpha) {
    Surfel surfel;
    surfel.center = (frame.view_from_model * vec4(center, 1.0)).xyz;
    surfel.normal = vec3(0.0);
    surfel.facing = 1.0;
    // Alpha 0 marks what has no normal.
    if (alpha != 0.0) {
        surfel.normal = mat3(frame.view_from_model) * octahedral_decode(packed_normal) / frame.model_scale;
        surfel.facing = abs(dot(surfel.normal, to_eye(surfel.center)));
    }
    surfel.radius = radius_in_view(radius, surfel.center);
    surfel.thickness = thickness_of(alpha);
    return surfel;
}

Disc footprint_of(Surfel surfel, float low_pass_px) {
    if (IS_ORIENTED) {
        return footprint(surfel.center, surfel.normal, surfel.radius, surfel.thickness, low_pass_px);
    }
    float distance = (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? 1.0 : -surfel.center.z;
    float radius_px = surfel.radius * frame.focal_px / distance;
    if (IS_SQUARE) {
        return Disc(position_px(surfel.center), vec3(0.0), vec2(0.0), max(2.0 * radius_px, 1.0));
    }
    return circle(surfel.center, radius_px);
}
