// What light makes of a surface: the default shading 0.8 |n . l|, light in the eye (or parallel to the view
// direction), or one lamp; the equation of the latter is in src/pack/light.rs.
#include "common/falsecolor.glsl"
#include "common/frame.glsl"

// Color of the surface itself. `tint` is the color used when coloring by primitive.
vec3 albedo_of(vec3 color, vec3 tint) {
    vec3 albedo = vec3(ALBEDO);
    if (has_flag(FLAG_COLOR_BY_PRIMITIVE)) {
        albedo *= tint;
    } else if (has_flag(FLAG_USE_COLORS)) {
        albedo *= color;
    }
    return albedo;
}

// `normal` unit and `to_eye` unit, both in view space; a zero normal means that there is none: lit as if it
// faced the light. `tint` is the color used when coloring by primitive.
vec3 headlight(vec3 normal, vec3 to_eye, vec3 color, vec3 tint) {
    float facing = dot(normal, to_eye);
    float lambert = has_flag(FLAG_TWO_SIDED) ? abs(facing) : max(facing, 0.0);
    if (normal == vec3(0.0)) {
        lambert = 1.0;
    }
    return albedo_of(color, tint) * min(lambert, 1.0);
}

// Unit vector from a view-space point towards the headlight.
vec3 to_light(vec3 position_in_view) {
    return has_flag(FLAG_PARALLEL_LIGHT) ? vec3(0.0, 0.0, 1.0) : -normalize(position_in_view);
}

vec3 unit_or_zero(vec3 v) {
    float squared = dot(v, v);
    return squared > 0.0 ? v * inversesqrt(squared) : vec3(0.0);
}

// A surface point in the light of the lamp; arguments as of `headlight`.
vec3 phong(vec3 position_in_view, vec3 normal, vec3 color, vec3 tint) {
    vec3 albedo = albedo_of(color, tint);
    if (normal == vec3(0.0)) {
        return albedo;
    }
    vec3 to_eye = has_flag(FLAG_ORTHOGRAPHIC) ? vec3(0.0, 0.0, 1.0) : -unit_or_zero(position_in_view);
    // No branch: on a value that is the same for all a device may compile a shader anew for every frame.
    vec3 to_lamp = unit_or_zero(frame.lamp.xyz - frame.lamp.w * position_in_view);
    bool is_back = !has_flag(FLAG_CULLS_BACK) && dot(normal, to_eye) < -LEAST_BACK;
    float cosine = dot(normal, to_lamp);
    float half_cosine = dot(normal, unit_or_zero(to_lamp + to_eye));
    if (is_back) {
        // The side that is seen is the other one; lit from the front only, it has no light of the lamp.
        float side = has_flag(FLAG_TWO_SIDED) ? -1.0 : 0.0;
        cosine *= side;
        half_cosine *= side;
    }
    float highlight = half_cosine > 0.0 ? pow(min(half_cosine, 1.0), frame.shininess) : 0.0;
    highlight *= clamp(cosine / FULL_HIGHLIGHT, 0.0, 1.0);
    float lambert = clamp(cosine, 0.0, 1.0);
    vec3 value = albedo * (frame.ambient + (1.0 - frame.ambient) * lambert) + vec3(frame.specular * highlight);
    return min(value, vec3(1.0));
}

// A surface point under lamps that go with the camera; arguments as of `headlight`. The equation is in src/pack/lit_sphere.rs.
vec3 lit_sphere(vec3 position_in_view, vec3 normal, vec3 color, vec3 tint) {
    vec3 to_eye = has_flag(FLAG_ORTHOGRAPHIC) ? vec3(0.0, 0.0, 1.0) : -unit_or_zero(position_in_view);
    bool is_back = !has_flag(FLAG_CULLS_BACK) && dot(normal, to_eye) < -LEAST_BACK;
    float side = is_back ? (has_flag(FLAG_TWO_SIDED) ? -1.0 : 0.0) : 1.0;
    float is_lit = side * side;
    // Turned by the shortest way that takes the direction to the eye to the z axis.
    vec3 both = to_eye + vec3(0.0, 0.0, 1.0);
    vec3 n = normal - both * (dot(normal, both) / (1.0 + to_eye.z));
    n.z += 2.0 * dot(normal, to_eye);
    n = normal == vec3(0.0) ? vec3(0.0, 0.0, 1.0) : side * n;
    float wrap = frame.sphere_lamps[3].w;
    vec3 diffuse = mix(frame.sphere_colors[3].rgb, frame.sphere_lamps[3].rgb, 0.5 + 0.5 * n.y);
    float gloss = 0.0;
    for (int i = 0; i < 3; ++i) {
        vec4 lamp = frame.sphere_lamps[i];
        float cosine = dot(n, lamp.xyz);
        diffuse += frame.sphere_colors[i].rgb * (is_lit * max((cosine + wrap) / (1.0 + wrap), 0.0));
        vec3 half_way = lamp.xyz + vec3(0.0, 0.0, 1.0);
        float half_cosine = dot(n, half_way) * inversesqrt(dot(half_way, half_way));
        float highlight = half_cosine > 0.0 ? pow(min(half_cosine, 1.0), frame.shininess) : 0.0;
        gloss += lamp.w * clamp(cosine / FULL_HIGHLIGHT, 0.0, 1.0) * highlight;
    }
    float turned = 1.0 - clamp(n.z, 0.0, 1.0);
    vec3 rim = turned > 0.0 ? frame.sphere_rim.rgb * (is_lit * pow(turned, frame.sphere_rim.w)) : vec3(0.0);
    return min(albedo_of(color, tint) * diffuse + vec3(gloss) + rim, vec3(1.0));
}

// A surface point in light that is not the headlight; arguments as of `headlight`.
vec3 in_lamps(vec3 position_in_view, vec3 normal, vec3 color, vec3 tint) {
    if (has_flag(FLAG_LIT_SPHERE)) {
        return lit_sphere(position_in_view, normal, color, tint);
    }
    return phong(position_in_view, normal, color, tint);
}

// Whether deferred shading sums a normal turned around: where both sides are lit, so that sides do not cancel. `facing` is
// the cosine to the eye. In the light of a lamp only what is certainly seen from behind: the headlight does not
// care about the sign at a silhouette, a lamp does.
bool is_turned_when_deferred(bool has_lamp, float facing) {
    bool is_back = has_lamp ? !has_flag(FLAG_CULLS_BACK) && facing < -LEAST_BACK : facing < 0.0;
    return has_flag(FLAG_TWO_SIDED) && is_back;
}

// A surface point in whatever light the frame has, or as the data that the frame shows: what a method calls that shades
// whole splats.
vec3 shade_at(vec3 position_in_view, vec3 normal, vec3 color, vec3 tint) {
    if (shows_data()) {
        return data_color(position_in_view, normal, color);
    }
    if (has_flag(FLAG_PHONG | FLAG_LIT_SPHERE)) {
        return in_lamps(position_in_view, normal, color, tint);
    }
    return headlight(normal, to_light(position_in_view), color, tint);
}

// The same for a pixel of a surface, whose position is that of gl_FragCoord. The direction to the headlight depends
// on the pixel alone, so no position is interpolated. `has_lamp` is a specialization constant that says whether it is
// anything but the headlight (a lamp, or data): a device that does not skip branches takes three times as long for the
// headlight if it must ask the flags. The surface is that of a triangle.
vec3 shade_pixel(bool has_lamp, vec4 frag_coord, vec3 normal, vec3 color, vec3 tint) {
    vec2 at = frag_coord.xy * frame.ray_scale + frame.ray_offset;
    if (has_lamp) {
        float depth_in_view = (frag_coord.z - frame.clip_from_view[3].z) / frame.clip_from_view[2].z;
        vec3 position_in_view = has_flag(FLAG_ORTHOGRAPHIC)
            ? vec3(at, depth_in_view)
            : vec3(at, -1.0) / frag_coord.w;
        if (shows_data()) {
            return data_color(position_in_view, normal, ramp(1.0));
        }
        return in_lamps(position_in_view, normal, color, tint);
    }
    vec3 l = vec3(0.0, 0.0, 1.0);
    if (!has_flag(FLAG_PARALLEL_LIGHT)) {
        l = -normalize(vec3(at, -1.0));
    }
    return headlight(normal, l, color, tint);
}
