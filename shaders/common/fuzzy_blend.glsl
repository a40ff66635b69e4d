// Pass fuzzy.blend: footprints in their place, each with its share of the sums.
#include "common/fuzzy.glsl"

// Lit once a pixel: the sums are those of colors and normals, not of shades.
layout(constant_id = 4) const bool IS_DEFERRED = false;
// The frame has a lamp instead of the headlight.
layout(constant_id = 6) const bool HAS_LAMP = false;

layout(location = 0) flat out vec2 center_px;
layout(location = 1) flat out vec3 form;
layout(location = 2) flat out vec2 skew;
// Color times weight and weight, both at the center of the kernel.
layout(location = 3) flat out vec4 deposit;
// Normal in view space and depth, times weight.
layout(location = 4) flat out vec4 normal_deposit;

const float PI = 3.14159265;
// Integral of exp(-2 rho^2) over the unit disc, over pi: (1 - exp(-2)) / 2.
const float GAUSSIAN_MEAN = 0.43233236;
// The least cosine under which a patch is taken to be seen: it covers something, or it would not be there.
const float LEAST_FACING = 0.02;
// The least weight in the middle: a pixel that a splat alone decides (exp(-2) of this) must show something.
const float LEAST_DEPOSIT = 1e-3;

// `area` in model units squared; negative where it is unknown.
void emit_blend(vec3 center, float radius, vec2 packed_normal, vec4 color, float area) {
    Surfel surfel = surfel_of(center, radius, packed_normal, color.a);
    Disc disc = footprint_of(surfel, IS_GAUSS ? frame.low_pass_px : 0.0);
    center_px = disc.center_px;
    form = disc.form;
    skew = disc.skew;
    place(frame.clip_from_view * vec4(surfel.center, 1.0), disc.size_px);

    // A Gaussian deposits the area that its patch covers, so that the sum of weights is coverage.
    float weight = 1.0;
    if (IS_GAUSS && area >= 0.0) {
        // A patch of some thickness has normals to all sides of the mean.
        float facing = clamp(length(vec2(surfel.facing, surfel.thickness)), LEAST_FACING, 1.0);
        float scale = frame.focal_px * frame.model_scale;
        if ((frame.flags & FLAG_ORTHOGRAPHIC) == 0u) {
            float z = -surfel.center.z;
            facing *= length(surfel.center) / z;
            scale /= z;
        }
        float area_px = area * scale * scale * facing;
        float determinant = disc.form.x * disc.form.z - disc.form.y * disc.form.y;
        // A square has no form.
        weight = determinant > 0.0 ? area_px * sqrt(determinant) / (PI * GAUSSIAN_MEAN)
                                   : area_px / (disc.size_px * disc.size_px);
        weight = max(weight, LEAST_DEPOSIT);
    }
    vec3 tint = vec3(1.0, 0.2, 0.2);
    vec3 base = (frame.flags & FLAG_COLOR_BY_PRIMITIVE) != 0u ? tint : color.rgb;
    if (!IS_DEFERRED) {
        base = shade_at(surfel.center, surfel.normal, color.rgb, tint);
    }
    deposit = vec4(base * weight, weight);
    bool is_turned = IS_DEFERRED && is_turned_when_deferred(HAS_LAMP, dot(surfel.normal, to_eye(surfel.center)));
    float depth = clamp(gl_Position.z / gl_Position.w, 0.0, 1.0);
    normal_deposit = weight * vec4(is_turned ? -surfel.normal : surfel.normal, depth);
}
