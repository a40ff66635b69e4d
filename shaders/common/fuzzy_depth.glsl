// Pass fuzzy.depth: footprints into depth only, pushed away from the eye.
#include "common/fuzzy.glsl"
#include "common/push.glsl"

layout(location = 0) flat out vec2 center_px;
layout(location = 1) flat out vec3 form;
layout(location = 2) flat out vec2 skew;

void emit_depth(vec3 center, float radius, vec2 packed_normal, float alpha) {
    Surfel surfel = surfel_of(center, radius, packed_normal, alpha);
    // A Gaussian's own footprint: wherever it hides something it also counts, since the kernel is never smaller. Small
    // ones between the centers of pixels hide nothing; what surface they stand for, their neighbors hide.
    Disc disc = IS_GAUSS ? exact_footprint(surfel.center, surfel.normal, surfel.radius, surfel.thickness)
                         : footprint_of(surfel, 0.0);
    center_px = disc.center_px;
    form = disc.form;
    skew = disc.skew;
    // Where discs of one plane overlap, the depths of their centers differ by at most 2 r sin, and an offset of
    // r / cos is never less: sin 2a <= 1. So one depth for the whole footprint is enough.
    float offset = frame.background.a * surfel.radius / max(surfel.facing, LEAST_RATIO);
    vec4 clip = clip_of_pushed(push_away(surfel.center, offset));
    // Near and far are those of the center itself, as in the blend pass.
    vec4 unpushed = frame.clip_from_view * vec4(surfel.center, 1.0);
    if (unpushed.z > unpushed.w || unpushed.z < 0.0) {
        clip = vec4(0.0, 0.0, 2.0, 1.0);
    }
    place(clip, disc.size_px);
}
