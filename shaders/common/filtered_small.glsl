// What the compute passes of filtered splats share: which splats are theirs, and where.
// Requires GL_EXT_shader_explicit_arithmetic_types_int64.
#include "common/filtered_record.glsl"

struct SmallSplat {
    bool is_drawn;
    vec3 center_in_view;
    // Depth offset, model units.
    float offset;
    vec2 window_px;
    float side_px;
    float area_px;
    // Reversed depth of the center; the same bits in both passes, so that nothing is behind itself.
    float depth;
};

SmallSplat small_splat(uint at) {
    vec2 x_y = floats_of(splats[at].center_x_y);
    vec2 z_offset = floats_of(splats[at].center_z_offset);
    vec2 side_area = floats_of(splats[at].side_area);
    SmallSplat small;
    small.offset = z_offset.y;
    small.side_px = side_area.x;
    small.area_px = side_area.y;
    small.center_in_view = (frame.view_from_model * vec4(x_y, z_offset.x, 1.0)).xyz;
    precise vec4 clip = frame.clip_from_view * vec4(small.center_in_view, 1.0);
    precise float depth = clip.z / clip.w;
    small.depth = depth;
    small.window_px = window_of(clip);
    // The view volume in depth, and nothing that is not finite. The rasterizer draws what is larger.
    small.is_drawn = clip.z >= 0.0 && clip.z <= clip.w && clip.w > 0.0 && side_area.x <= LARGEST_SMALL_BLENDED_PX;
    return small;
}
