// The default shading: 0.8 |n . l|, light in the eye (or parallel to the view direction).
#include "common/frame.glsl"

// `normal` unit and `to_eye` unit, both in view space; a zero normal means that there is none: lit as if it
// faced the light. `tint` is the color used when coloring by primitive.
vec3 headlight(vec3 normal, vec3 to_eye, vec3 color, vec3 tint) {
    float facing = dot(normal, to_eye);
    float lambert = (frame.flags & FLAG_TWO_SIDED) != 0u ? abs(facing) : max(facing, 0.0);
    if (normal == vec3(0.0)) {
        lambert = 1.0;
    }
    vec3 albedo = vec3(ALBEDO);
    if ((frame.flags & FLAG_COLOR_BY_PRIMITIVE) != 0u) {
        albedo *= tint;
    } else if ((frame.flags & FLAG_USE_COLORS) != 0u) {
        albedo *= color;
    }
    return albedo * min(lambert, 1.0);
}

// Unit vector from a view-space point towards the light.
vec3 to_light(vec3 position_in_view) {
    return (frame.flags & FLAG_PARALLEL_LIGHT) != 0u ? vec3(0.0, 0.0, 1.0) : -normalize(position_in_view);
}
