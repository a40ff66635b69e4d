// What the passes that put photographs on the surface know of a frame. Mirrored by `abi::PhotoHeader`. Photographs come in groups
// of PHOTO_GROUP, so that a pass over one group reads its cameras at places that are known when it is compiled.
#include "common/constants.glsl"

layout(set = 0, binding = 5, std430) readonly buffer PhotoTexels {
    uint photo_texels[];
};

layout(set = 0, binding = 6, std140) uniform PhotoHeader {
    // Start of the ray of position (0, 0) in model space; 1 where all rays start there.
    vec4 start;
    // Its direction, which has component 1 along the view direction.
    vec4 towards;
    // Change of the direction (of the start, of a parallel view) for a pixel to the right, and down.
    vec4 right;
    vec4 down;
    // Direction that photographs are chosen for; nothing.
    vec4 direction;
    // Cosine of the largest angle between normal and photograph; tolerance of colors; border; column up to which a photograph
    // is laid over the picture.
    vec4 limits;
    // Photographs; those blended at most; the one that is laid over; groups side by side in the image of weights.
    uvec4 counts;
    // Width and height of the picture.
    uvec4 size;
} look;

const uint LENS_PINHOLE = 0u;
const uint LENS_BROWN = 1u;
const uint LENS_RATIONAL = 2u;
const uint LENS_FISHEYE = 3u;
