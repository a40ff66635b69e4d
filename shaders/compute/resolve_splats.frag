#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass small.resolve, splats: shades the splat that each pixel kept; its depth is tested against what the rasterizer
// drew.
#include "common/headlight.glsl"
#include "common/octahedral.glsl"
#include "common/splat_record.glsl"

layout(set = 0, binding = 3, std430) readonly buffer Nearest {
    uint64_t nearest[];
};

// Another light than the headlight, or data.
layout(constant_id = 0) const bool HAS_LAMP = false;

layout(location = 0) out vec4 color;
#ifdef NORMALS
layout(location = 1) out vec4 normal;
#endif

// Where a splat has no radius, its lower bits may be what the codes of its normal and of its color leave out.
int fine_of(SplatRecord splat) {
    return min(floatBitsToInt(splat.radius), 0);
}

vec2 code_of(SplatRecord splat) {
    ivec2 code = ivec2(splat.normal << 16, splat.normal) >> 16;
    int fine = fine_of(splat);
    vec2 left = vec2(bitfieldExtract(fine, 0, 11), bitfieldExtract(fine, 11, 11)) / 1024.0;
    return max((vec2(code) + left) / 32767.0, -1.0);
}

vec4 color_of(SplatRecord splat) {
    int fine = fine_of(splat);
    ivec3 left = ivec3(bitfieldExtract(fine, 22, 3), bitfieldExtract(fine, 25, 3), bitfieldExtract(fine, 28, 3));
    return unpackUnorm4x8(splat.color) + vec4(vec3(left) / (8.0 * 255.0), 0.0);
}

void main() {
    uint64_t key = nearest[index_of(ivec2(gl_FragCoord.xy))];
    uint number = ~uint(key);
    uint item = (number & ~SPLAT_BIT) - list.first;
    if (key == 0ul || (number & SPLAT_BIT) == 0u || item >= list.count) {
        discard;
    }
    SplatRecord splat = splats[list.begin + item];
    vec4 rgba = color_of(splat);
    vec3 center = vec3(splat.center[0], splat.center[1], splat.center[2]);
    vec3 normal_in_model = rgba.a == 0.0 ? vec3(0.0) : octahedral_decode(code_of(splat));
    if (HAS_LAMP) {
        // As splats are shaded that are rasterized.
        vec3 center_in_view = (frame.view_from_model * vec4(center, 1.0)).xyz;
        vec3 n = mat3(frame.view_from_model) * normal_in_model / frame.model_scale;
        color = vec4(shade_at(center_in_view, n, rgba.rgb, vec3(1.0, 0.2, 0.2)), 1.0);
    } else {
        vec3 to_light = normalize(frame.headlight.xyz - frame.headlight.w * center);
        color = vec4(headlight(normal_in_model, to_light, rgba.rgb, vec3(1.0, 0.2, 0.2)), 1.0);
    }
#ifdef NORMALS
    normal = vec4(normal_in_model, 1.0);
#endif
    gl_FragDepth = uintBitsToFloat(uint(key >> 32));
}
