// What the vertex shaders of both passes of fuzzy splats share.
#include "common/round.glsl"
#include "common/headlight.glsl"
#include "common/octahedral.glsl"
#include "common/fuzzy_weight.glsl"

// A Gaussian in the plane of the surface, else weights of 1.
layout(constant_id = 0) const bool IS_GAUSS = false;
// A disc in the plane of the surface.
layout(constant_id = 1) const bool IS_ORIENTED = false;
// A square, else (if not oriented) a circle.
layout(constant_id = 3) const bool IS_SQUARE = false;

// The least cosine under which a patch is taken to be seen: it covers something, or it would not be there.
const float LEAST_FACING = 0.02;

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

Disc footprint_of(Surfel surfel, bool is_widened) {
    if (IS_ORIENTED) {
        return footprint(surfel.center, surfel.normal, surfel.radius, surfel.thickness, is_widened);
    }
    float distance = has_flag(FLAG_ORTHOGRAPHIC) ? 1.0 : -surfel.center.z;
    float radius_px = surfel.radius * frame.focal_px / distance;
    if (IS_SQUARE) {
        return Disc(position_px(surfel.center), vec3(0.0), vec2(0.0), max(2.0 * radius_px, 1.0), vec2(0.0), 0.0);
    }
    return circle(surfel.center, radius_px);
}

// The weight in the middle of a kernel; `area` in model units squared, negative where it is unknown.
float weight_of(Surfel surfel, Disc disc, float area) {
    if (IS_GAUSS && area >= 0.0) {
        // A patch of some thickness has normals to all sides of the mean.
        float facing = clamp(length(vec2(surfel.facing, surfel.thickness)), LEAST_FACING, 1.0);
        float scale = frame.focal_px * frame.model_scale;
        if (!has_flag(FLAG_ORTHOGRAPHIC)) {
            float z = -surfel.center.z;
            facing *= length(surfel.center) / z;
            scale /= z;
        }
        return weight_in_middle(area * scale * scale * facing, disc);
    }
    return 1.0;
}

// The footprint that hides what is behind.
Disc hiding_footprint(Surfel surfel) {
    // A Gaussian's own footprint: wherever it hides something it also counts, since the kernel is never smaller. Small
    // ones between the centers of pixels hide nothing; what surface they stand for, their neighbors hide.
    return IS_GAUSS ? exact_footprint(surfel.center, surfel.normal, surfel.radius, surfel.thickness)
                    : footprint_of(surfel, false);
}

// How far away from the eye a splat is pushed in the first pass, view space. Where discs of one plane overlap, the depths of
// their centers differ by at most 2 r sin, and an offset of r / cos is never less: sin 2a <= 1. So one depth for the whole
// footprint is enough.
float offset_of(Surfel surfel) {
    return frame.depth_offset * surfel.radius / max(surfel.facing, LEAST_RATIO);
}
