// What the compute passes of filtered splats share: which splats are theirs, and where.
#include "common/filtered_record.glsl"

struct SmallSplat {
    bool is_drawn;
    vec3 center_in_view;
    vec2 window_px;
    // Reversed depth of the center; the same bits in both passes, so that nothing is behind itself.
    float depth;
};

SmallSplat small_splat(FilteredRecord splat) {
    SmallSplat small;
    vec3 size = vec3(splat.extent_and_side_px[0], splat.extent_and_side_px[1], splat.extent_and_side_px[2]);
    small.center_in_view =
        (frame.view_from_model * vec4(splat.center[0], splat.center[1], splat.center[2], 1.0)).xyz;
    precise vec4 clip = frame.clip_from_view * vec4(small.center_in_view, 1.0);
    precise float depth = clip.z / clip.w;
    small.depth = depth;
    small.window_px = window_of(clip);
    // The view volume in depth, and nothing that is not finite.
    small.is_drawn = clip.z >= 0.0 && clip.z <= clip.w && clip.w > 0.0
        && max(max(size.x, size.y), size.z) <= LARGEST_SMALL_FILTERED_PX && min(size.x, size.y) > 0.0;
    return small;
}
