// What round footprints share before the form is known.
#include "common/frame.glsl"
#include "common/disc.glsl"

// Radius in view space: that of the record, or for 0 that of the frame's constant size.
float radius_in_view(float radius, vec3 center_in_view) {
    float distance = has_flag(FLAG_ORTHOGRAPHIC) ? 1.0 : -center_in_view.z;
    return radius > 0.0 ? radius * frame.model_scale : 0.5 * frame.splat_size_px * distance / frame.focal_px;
}

// Radius in pixels of a disc that faces the viewer; `distance` is the last component of its clip position.
float radius_px_of(float radius, float distance) {
    return radius > 0.0 ? radius * frame.model_scale * frame.focal_px / distance : 0.5 * frame.splat_size_px;
}
