// Pass fuzzy.blend: footprints in their place, each with its share of the sums.
#include "common/place.glsl"
#include "common/fuzzy.glsl"

// Lit once a pixel: the sums are those of colors and normals, not of shades.
layout(constant_id = 4) const bool IS_DEFERRED = false;
// The frame has a lamp instead of the headlight.
layout(constant_id = 6) const bool HAS_LAMP = false;
// Gaussians are widened by that of the frame.
layout(constant_id = 11) const bool IS_WIDENED = false;

layout(location = 0) flat out vec2 center_px;
layout(location = 1) flat out vec3 form;
layout(location = 2) flat out vec2 skew;
// Color times weight and weight, both at the center of the kernel.
layout(location = 3) flat out vec4 deposit;
// Normal in view space and depth, times weight.
layout(location = 4) flat out vec4 normal_deposit;

// `area` in model units squared; negative where it is unknown.
void emit_blend(vec3 center, float radius, vec2 packed_normal, vec4 color, float area) {
    Surfel surfel = surfel_of(center, radius, packed_normal, color.a);
    Disc disc = footprint_of(surfel, IS_WIDENED);
    center_px = disc.center_px;
    form = disc.form;
    skew = disc.skew;
    place(frame.clip_from_view * vec4(surfel.center, 1.0), disc.size_px);

    float weight = weight_of(surfel, disc, area);
    vec3 tint = vec3(1.0, 0.2, 0.2);
    vec3 base = has_flag(FLAG_COLOR_BY_PRIMITIVE) ? tint : color.rgb;
    if (!IS_DEFERRED) {
        base = shade_at(surfel.center, surfel.normal, color.rgb, tint);
    }
    deposit = vec4(base * weight, weight);
    bool is_turned = IS_DEFERRED && is_turned_when_deferred(HAS_LAMP, dot(surfel.normal, to_eye(surfel.center)));
    float depth = clamp(gl_Position.z / gl_Position.w, 0.0, 1.0);
    normal_deposit = weight * vec4(is_turned ? -surfel.normal : surfel.normal, depth);
}
