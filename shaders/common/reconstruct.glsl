// What the reconstructions share: the images, the guard against depth steps, and how a pixel ends.
#include "common/visibility.glsl"

layout(set = 0, binding = 1) uniform sampler2D picked;
layout(set = 0, binding = 2) uniform sampler2D fronts;

// Whether two distances with their offsets may belong to one surface: less than twice the smaller offset apart.
bool is_one_surface(vec2 a, vec2 b) {
    return abs(a.x - b.x) <= 2.0 * min(a.y, b.y);
}
