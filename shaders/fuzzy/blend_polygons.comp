#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_shader_atomic_int64 : require
// Pass fuzzy.blend by compute, splats from vertices: lit in each pixel, added with a weight that falls from the vertex to the
// round bound where nothing in front hides them. A workgroup shares the pixels of one splat.
#include "common/polygon_record.glsl"
#include "common/push_polygon.glsl"
#include "common/disc_pixels.glsl"
#include "common/disc_look.glsl"
#include "common/fixed_sums.glsl"

layout(local_size_x = 32) in;

layout(constant_id = 0) const bool IS_GAUSS = false;

layout(set = 0, binding = 3, std430) readonly buffer Front {
    uint front[];
};

layout(set = 0, binding = 4, std430) buffer Sums {
    uint64_t sums[];
};

void main() {
    uint item = ITEM / gl_WorkGroupSize.x;
    if (item >= list.count) {
        return;
    }
    read_polygon(list.begin + item);
    DiscPlane disc = disc_plane();
    vec2 reach = reach_of(disc.middle);
    ivec4 pixels = faces_away(disc.middle) ? ivec4(0) : pixels_of_disc();
    int width = pixels.z - pixels.x;
    int count = max(width, 0) * max(pixels.w - pixels.y, 0);
    for (int i = int(gl_LocalInvocationID.x); i < count; i += int(gl_WorkGroupSize.x)) {
        ivec2 at = pixels.xy + ivec2(i % width, i / width);
        DiscPixel seen;
        bool is_covered = disc_pixel(disc, vec2(at) + 0.5, seen);
        uint pixel = index_of(at);
        float tested = is_covered ? min(max(pulled_depth(seen.position, reach), seen.depth), 1.0) : 0.0;
        if (is_covered && front[pixel] <= floatBitsToUint(tested)) {
            float squared = dot(seen.uv, seen.uv) / (round_radius * round_radius);
            vec3 n = unit_or_zero(mat3(frame.view_from_model) * disc_normal(seen.uv));
            vec3 shown = shade_disc(seen.position, n, seen.uv);
            Deposit deposit = deposit_of(pixel, shown, IS_GAUSS ? exp(-2.0 * squared) : 1.0);
            atomicAdd(sums[deposit.word], deposit.first);
            if (!IS_GRAY) {
                atomicAdd(sums[deposit.word + 1u], deposit.second);
            }
        }
    }
}
