// A splat as the passes visibility.depth and visibility.centers draw it: the footprint, pushed away from the eye by its
// depth offset, or the pixel of the center alone, in its place.
#include "common/place.glsl"
#include "common/visibility_shade.glsl"

// Whether this is the pass of centers.
layout(constant_id = 0) const bool IS_CENTER = false;

layout(location = 0) flat out vec3 shade;
layout(location = 1) flat out vec3 normal_in_model;
layout(location = 2) flat out vec2 front;
layout(location = 3) flat out vec2 center_px;
layout(location = 4) flat out vec3 form;
layout(location = 5) flat out vec2 skew;

// `radius` in model units; 0 asks for the constant size of the frame.
void emit_splat(vec3 center, float radius, vec2 packed_normal, vec4 color) {
    Seen seen = seen_splat(center, radius, packed_normal, color);
    normal_in_model = seen.normal_in_model;
    shade = seen.shade;
    front = seen.front;
    vec4 clip = clip_of_center(seen);
    // Near and far are those of the center itself in both passes.
    bool is_outside = clip.z > clip.w || clip.z < 0.0;
    clip = before_far(clip);
    float size_px = 1.0;
    center_px = vec2(0.0);
    form = vec3(0.0);
    skew = vec2(0.0);
    if (!IS_CENTER) {
        clip = clip_of_footprint(seen);
        Disc disc = footprint_of(seen, color.a);
        center_px = disc.center_px;
        form = disc.form;
        skew = disc.skew;
        size_px = disc.size_px;
    }
    place(is_outside ? vec4(0.0, 0.0, 2.0, 1.0) : clip, is_outside ? 1.0 : size_px);
}
