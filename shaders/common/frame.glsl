// What every pass of a frame knows: camera, light, sizes. Mirrored by `abi::FrameConstants`.
#include "common/constants.glsl"

layout(set = 0, binding = 0, std140) uniform FrameConstants {
    mat4 view_from_model;
    // Includes the guard band: wider than the picture, so that a point whose center lies just outside is kept.
    mat4 clip_from_view;
    // View-space direction through framebuffer position p: (p * ray_scale + ray_offset, -1). Orthographic: x and y.
    vec2 ray_scale;
    vec2 ray_offset;
    // Pixels per unit of tangent (perspective) or per unit of length (orthographic).
    float focal_px;
    // Side of splats and points without a radius of their own, pixels.
    float splat_size_px;
    // Length in view space of a unit vector in model space.
    float model_scale;
    uint flags;
    // What a pixel shows where nothing is drawn; the last component is 0.
    vec4 background;
    // The lamp of FLAG_PHONG in view space: a position where w is 1, the unit vector towards it where w is 0.
    vec4 lamp;
    // Part of the light that comes from everywhere.
    float ambient;
    // Value of the highlight at its middle, and its exponent.
    float specular;
    float shininess;
    // Standard deviation of the Gaussian that fuzzy splats are widened by, pixels.
    float low_pass_px;
    // Distances along the view direction between which the ramp of FLAG_COLOR_BY_DEPTH goes, view-space units.
    vec2 depth_range;
    // Exponent of eye-dome lighting for each doubling of the distance from one neighbor of eight; 0 without.
    float eye_dome;
    // Factor of the depth offset where splats are blended.
    float depth_offset;
    // Window position (pixels of the picture) and reversed depth from model space, both times the last component: for
    // passes that ask for nothing else, since a software device takes longer to read a matrix than to multiply by it.
    mat4 window_from_model;
    // Where the headlight is in model space: a position where w is 1, the unit vector towards it where w is 0. Shading there
    // needs no matrix.
    vec4 headlight;
    // Power of the openness of a pixel that ambient occlusion multiplies its color by; 0 without. How far around that looks,
    // pixels. Rises by less than the slack, view-space units, hide nothing.
    float ambient_occlusion;
    float ambient_occlusion_px;
    float ambient_occlusion_slack;
    float unused;
    // Of FLAG_LIT_SPHERE: directions of three lamps with the values of their highlights, and the sky with how far light reaches
    // around; colors of the lamps, and the ground; the rim and its power. The exponent of highlights is `shininess`.
    mat4 sphere_lamps;
    mat4 sphere_colors;
    vec4 sphere_rim;
    // What the background has more at the lower edge of the picture than at the upper.
    vec4 background_change;
} frame;

// The flags of the frames that a pipeline is made for, with FLAGS_ARE_KNOWN; 0: the block says. Where larger parts of a shader
// depend on them, a device may have to compile it anew for every frame otherwise.
layout(constant_id = 31) const uint KNOWN_FLAGS = 0u;

bool has_flag(uint flag) {
    return ((KNOWN_FLAGS != 0u ? KNOWN_FLAGS : frame.flags) & flag) != 0u;
}
