// One fuzzy splat of the draw list as storage, and what the compute passes share. Mirrored by `abi::WeightedSplat`.
#include "common/fuzzy.glsl"
#include "common/list.glsl"

struct WeightedRecord {
    float center[3];
    // Model units; 0 asks for the constant size of the frame.
    float radius;
    // Octahedral, 2 x 16 bit signed normalized.
    uint normal;
    // Red, green, blue, alpha from the lowest byte; alpha 0 marks a splat without normal.
    uint color;
    // Of its patch of surface, model units squared; negative where it is unknown.
    float area;
};

layout(set = 0, binding = 2, std430) readonly buffer WeightedSplats {
    WeightedRecord splats[];
};

struct SmallSplat {
    bool is_drawn;
    Surfel surfel;
    vec4 color;
    vec2 window_px;
    // Reversed depth of the center; the same bits in both passes, so that nothing is behind itself.
    float depth;
};

SmallSplat small_splat(uint at) {
    SmallSplat small;
    small.color = unpackUnorm4x8(splats[at].color);
    vec3 center = vec3(splats[at].center[0], splats[at].center[1], splats[at].center[2]);
    small.surfel = surfel_of(center, splats[at].radius, unpackSnorm2x16(splats[at].normal), small.color.a);
    precise vec4 clip = frame.clip_from_view * vec4(small.surfel.center, 1.0);
    precise float depth = clip.z / clip.w;
    small.depth = depth;
    small.window_px = window_of(clip);
    // The view volume in depth, and nothing that is not finite. The rasterizer draws what is larger.
    small.is_drawn = clip.z >= 0.0 && clip.z <= clip.w && clip.w > 0.0 && is_small(small.surfel);
    return small;
}
