// Colors of filtered splats in other lights than the headlight, and as data.
#include "common/headlight.glsl"
#include "common/seen_patch.glsl"

// The factor of the albedo and the highlight of a patch in the light of a lamp.
vec2 in_lamp(SummedPatch of, SeenPatch seen) {
    vec3 l = eye.lamp.w != 0.0 ? unit_or_none(eye.lamp.xyz - of.center) : eye.lamp.xyz;
    float sharp = of.area > 0.0 ? min(length(of.normals) / of.area, 1.0) : 1.0;
    vec3 mean = unit_or_none(of.normals);
    bool is_back = !has_flag(FLAG_CULLS_BACK) && dot(mean, seen.v) < -LEAST_BACK;
    mean = is_back ? -mean : mean;
    float facing = dot(mean, l);
    // An element of either side is lit when lamp and eye are on the same side of it.
    float of_sums = seen.both > 0.0 ? dot(seen.v, of_second(of, l)) / seen.both : 0.0;
    float lambert = clamp(of.has_one_normal ? facing : of_sums, 0.0, 1.0);
    float cosine = clamp(dot(mean, unit_or_none(l + seen.v)), 0.0, 1.0);
    float rise = clamp(facing / FULL_HIGHLIGHT, 0.0, 1.0);
    float exponent = frame.shininess * sharp / (sharp + frame.shininess * (1.0 - sharp));
    float wide = (1.0 + exponent) / (1.0 + frame.shininess);
    float highlight = rise > 0.0 && cosine > 0.0 ? rise * frame.specular * wide * pow(cosine, exponent) : 0.0;
    return vec2(frame.ambient + (1.0 - frame.ambient) * lambert, highlight);
}

// A direction of model space in view space.
vec3 direction_in_view(vec3 v) {
    return vec3(dot(eye.right, v), dot(eye.up, v), -dot(eye.forward.xyz, v));
}

// The color of a patch where `is_plain` does not say that it is that of the headlight.
vec3 other_color(SummedPatch of, SeenPatch seen) {
    if (has_flag(FLAG_COLOR_BY_NORMAL)) {
        return of.normal * 0.5 + 0.5;
    }
    if (has_flag(FLAG_COLOR_BY_DEPTH)) {
        float from = frame.depth_range.x;
        return ramp(1.0 - (-in_view(2, of.center) - from) / (frame.depth_range.y - from));
    }
    if (has_flag(FLAG_LIT_SPHERE)) {
        vec3 to_eye = direction_in_view(seen.v);
        return lit_sphere(-to_eye, direction_in_view(of.normal), of.color, vec3(1.0, 0.2, 0.2));
    }
    vec2 light = of.is_bare ? vec2(1.0, 0.0) : in_lamp(of, seen);
    return min(own_color(of) * (ALBEDO * light.x) + light.y, vec3(1.0));
}
