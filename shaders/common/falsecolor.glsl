// Levels of the tree, normals and depth as colors that no light changes; src/pack/falsecolor.rs says which.
#include "common/frame.glsl"

// Viridis as a polynomial (Zucker, 2019, public domain).
vec3 ramp(float t) {
    const vec3 c0 = vec3(0.27772733, 0.0054073445, 0.3340998);
    const vec3 c1 = vec3(0.10509304, 1.4046135, 1.3845901);
    const vec3 c2 = vec3(-0.33086183, 0.21484756, 0.09509516);
    const vec3 c3 = vec3(-4.63423, -5.799101, -19.332441);
    const vec3 c4 = vec3(6.22827, 14.179933, 56.69055);
    const vec3 c5 = vec3(4.776385, -13.745145, -65.35303);
    const vec3 c6 = vec3(-5.435456, 4.6458526, 26.312435);
    t = clamp(t, 0.0, 1.0);
    return clamp(c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * (c5 + t * c6))))), 0.0, 1.0);
}

bool shows_data() {
    return has_flag(FLAG_COLOR_BY_LEVEL | FLAG_COLOR_BY_NORMAL | FLAG_COLOR_BY_DEPTH);
}

// `normal` unit or zero, both in view space; `level` is the color of the level in the tree.
vec3 data_color(vec3 position_in_view, vec3 normal, vec3 level) {
    if (has_flag(FLAG_COLOR_BY_LEVEL)) {
        return level;
    }
    if (has_flag(FLAG_COLOR_BY_NORMAL)) {
        return 0.5 + 0.5 * (normal * mat3(frame.view_from_model)) / frame.model_scale;
    }
    return ramp((frame.depth_range.y + position_in_view.z) / (frame.depth_range.y - frame.depth_range.x));
}
