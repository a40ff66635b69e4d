// Pass fuzzy.depth: footprints into depth only, pushed away from the eye.
#include "common/place.glsl"
#include "common/fuzzy.glsl"
#include "common/push.glsl"

layout(location = 0) flat out vec2 center_px;
layout(location = 1) flat out vec3 form;
layout(location = 2) flat out vec2 skew;

void emit_depth(vec3 center, float radius, vec2 packed_normal, float alpha) {
    Surfel surfel = surfel_of(center, radius, packed_normal, alpha);
    Disc disc = hiding_footprint(surfel);
    center_px = disc.center_px;
    form = disc.form;
    skew = disc.skew;
    vec4 clip = clip_of_pushed(push_away(surfel.center, offset_of(surfel)));
    // Near and far are those of the center itself, as in the blend pass.
    vec4 unpushed = frame.clip_from_view * vec4(surfel.center, 1.0);
    if (unpushed.z > unpushed.w || unpushed.z < 0.0) {
        clip = vec4(0.0, 0.0, 2.0, 1.0);
    }
    place(clip, disc.size_px);
}
