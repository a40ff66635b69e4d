// A triangle as a patch of surface, as `draw::splats` has it.
#include "common/exact.glsl"
#include "common/vertex.glsl"

struct Patch {
    // As a splat has them.
    uint normal;
    uint color;
    // Model units squared.
    float area;
};

vec3 position_of(VertexRecord v) {
    return vec3(v.position[0], v.position[1], v.position[2]);
}

// a x b.
vec3 cross_of(vec3 a, vec3 b) {
    precise vec3 left = a.yzx * b.zxy;
    precise vec3 right = b.yzx * a.zxy;
    precise vec3 cross = left - right;
    return cross;
}

// The unit vector, or `other` where there is none.
vec3 unit_or(vec3 v, vec3 other) {
    precise float inverse = 1.0 / sqrt(dot_of(v, v));
    precise vec3 unit = v * inverse;
    return inverse > 0.0 && !isinf(inverse) ? unit : other;
}

// The words of a unit vector's code.
uint code_of(vec3 v) {
    precise float size = (abs(v.x) + abs(v.y)) + abs(v.z);
    if (!(size > 0.0) || isinf(size)) {
        return 0u;
    }
    precise vec3 p = v / size;
    precise vec2 folded = 1.0 - abs(p.yx);
    vec2 at = p.z >= 0.0 ? p.xy : vec2(with_sign_of(folded.x, p.x), with_sign_of(folded.y, p.y));
    precise vec2 scaled = clamp(at, vec2(-1.0), vec2(1.0)) * 32767.0;
    precise vec2 rounded = scaled + vec2(with_sign_of(0.5, scaled.x), with_sign_of(0.5, scaled.y));
    ivec2 code = ivec2(rounded);
    return (uint(code.x) & 0xffffu) | (uint(code.y) << 16);
}

// Its mean color, and the mean normal of its corners with a thickness that reaches all of it, or with `is_in_plane` its own
// normal.
Patch patch_of(VertexRecord corners[3], bool is_in_plane) {
    precise vec3 e = position_of(corners[1]) - position_of(corners[0]);
    precise vec3 g = position_of(corners[2]) - position_of(corners[0]);
    vec3 cross = cross_of(e, g);
    vec3 plane = unit_or(cross, vec3(0.0));
    precise vec3 sum = vec3(0.0);
    uvec3 channels = uvec3(0u);
    for (int i = 0; i < 3; ++i) {
        uint rgba = corners[i].color;
        // Alpha 0 marks a vertex without normal: it leaves the others to decide.
        if (rgba >> 24 != 0u) {
            sum += unit_of(halves_of(corners[i].normal));
        }
        channels += (uvec3(rgba) >> uvec3(0u, 8u, 16u)) & 0xffu;
    }
    vec3 mean = unit_or(sum, plane);
    vec3 off = cross_of(mean, plane);
    precise float thickness = min(sqrt(dot_of(off, off)), 1.0);
    if (is_in_plane && plane != vec3(0.0)) {
        mean = dot_of(mean, plane) < 0.0 ? -plane : plane;
        thickness = 0.0;
    }
    uint alpha = mean == vec3(0.0) ? 0u : alpha_of(thickness);
    channels = (channels + 1u) / 3u;
    uint color = channels.x | (channels.y << 8) | (channels.z << 16) | (alpha << 24);
    precise float area = 0.5 * sqrt(dot_of(cross, cross));
    return Patch(code_of(mean), color, area);
}
