// The splats of a node that is drawn as a row of them, see `cut::strip`.
#include "common/exact.glsl"
#include "common/splat.glsl"
#include "common/tree.glsl"

// Half length of the row and width of the strip over the node's radius.
vec2 relative_size(NodeRecord node) {
    float half_length = float(node.shape & 0xffu);
    float width = float((node.shape >> 8) & 0xffu);
    precise vec2 size = vec2(min(half_length + width, 255.0), width) * (1.0 / 255.0);
    return size;
}

// Splat `i` of `count`, its radius that of the ball that it stands for.
SplatRecord splat_of_row(NodeRecord node, AttributesRecord of, uint count, uint i) {
    vec3 center = vec3(node.center[0], node.center[1], node.center[2]);
    vec2 relative = relative_size(node);
    ivec2 code = max(ivec2(int(node.sine << 8) >> 24, int(node.sine) >> 24), ivec2(-127)) * 258;
    vec3 direction = unit_of(code);
    precise float along = float(2u * i + 1u) / float(count) - 1.0;
    precise float way = (relative.x * node.radius) * along;
    precise vec3 to = center + direction * way;
    precise float piece = relative.x / float(count);
    precise float ball = sqrt(piece * piece + relative.y * relative.y) * node.radius;
    // The slab lies around the node's center, and its thickness counts in the radii of the ball.
    uint own = of.color >> 24;
    vec3 normal = unit_of(halves_of(of.normal));
    precise float thickness = (float(255u - own) / 254.0) * of.splat_radius;
    precise vec3 off = to - center;
    precise float thick = (thickness + abs(dot_of(normal, off))) / ball;
    uint alpha = own == 0u ? 0u : alpha_of(thick);
    return SplatRecord(float[3](to.x, to.y, to.z), ball, of.normal, (of.color & 0xffffffu) | (alpha << 24));
}
