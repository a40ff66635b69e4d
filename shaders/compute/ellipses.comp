#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass compute.splats, ellipses: every disc in the plane of the surface leaves the depth of its dome and its number in the
// pixels that it covers; the nearest stays, of equals the first of the list.
#include "common/footprint_pixels.glsl"
#include "common/octahedral.glsl"
#include "common/round.glsl"
#include "common/splat_record.glsl"

layout(local_size_x = 64) in;

// Look at a key before the atomic; on a software device the look costs more than it spares.
layout(constant_id = 0) const bool LOOKS_FIRST = false;

layout(set = 0, binding = 3, std430) buffer Nearest {
    // As compute.splats has them of squares and discs.
    uint64_t nearest[];
};

void main() {
    uint item = ITEM;
    SplatRecord splat = splats[list.begin + min(item, list.count - 1u)];
    vec3 center = vec3(splat.center[0], splat.center[1], splat.center[2]);
    vec3 center_in_view = (frame.view_from_model * vec4(center, 1.0)).xyz;
    vec4 clip = frame.clip_from_view * vec4(center_in_view, 1.0);
    // The view volume in depth, and nothing that is not finite.
    bool is_drawn = item < list.count && clip.z >= 0.0 && clip.z <= clip.w && clip.w > 0.0;
    float alpha = float(splat.color >> 24) / 255.0;
    ivec2 code = ivec2(splat.normal << 16, splat.normal) >> 16;
    vec3 normal_in_model = alpha == 0.0 ? vec3(0.0) : octahedral_decode(max(vec2(code) / 32767.0, -1.0));
    vec3 normal = mat3(frame.view_from_model) * normal_in_model / frame.model_scale;
    float radius = radius_in_view(splat.radius, center_in_view);
    Disc disc = unbounded_footprint(center_in_view, normal, radius, thickness_of(alpha), false);
    uint number = ~((list.first + item) | SPLAT_BIT);
    float depth_of_center = clip.z / clip.w;
    Walk walk = walk_over(disc, place_of(clip));
    walk.pixels = is_drawn ? walk.pixels : 0;
    for (; walk.pixels > 0; go_on(walk)) {
        float depth = dome_depth(depth_of_center, walk.disc.form, walk.disc.lean, walk.disc.dome, walk.from_center);
        uint64_t key = packUint2x32(uvec2(number, floatBitsToUint(depth)));
        if (is_covered(walk) && depth > 0.0 && (!LOOKS_FIRST || nearest[walk.pixel] < key)) {
            atomicMax(nearest[walk.pixel], key);
        }
    }
}
