// What light makes of a point of an oriented polygon.
#include "common/headlight.glsl"

// As `shade_at`, under a normal of any length; the light that falls on the surface is multiplied by `share`.
vec3 shade_polygon(vec3 position_in_view, vec3 unit, vec3 base, float share, vec3 tint) {
    vec3 shown = shade_at(position_in_view, unit, base, tint);
    if (shows_data()) {
        return shown;
    }
    vec3 from_everywhere = has_flag(FLAG_PHONG) ? albedo_of(base, tint) * frame.ambient : vec3(0.0);
    if (has_flag(FLAG_LIT_SPHERE)) {
        from_everywhere = albedo_of(base, tint) * 0.5 * (frame.sphere_lamps[3].rgb + frame.sphere_colors[3].rgb);
    }
    return mix(from_everywhere, shown, share);
}
