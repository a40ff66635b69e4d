#version 460
// Pass cut.leaves: small leaves are splats, large ones triangles, whose corners are listed. An invocation does one leaf.
#include "common/cut_lists.glsl"
#include "common/vertex.glsl"

layout(local_size_x = 64) in;

// Mirrored by `tree::Leaf`.
struct LeafRecord {
    float center[3];
    float radius;
};

layout(set = 0, binding = 4, std430) readonly buffer Leaves {
    LeafRecord leaves[];
};

layout(set = 0, binding = 5, std430) readonly buffer Corners {
    uint corners[];
};

layout(set = 0, binding = 6, std430) readonly buffer Vertices {
    VertexRecord vertices[];
};

layout(set = 0, binding = 7, std430) writeonly buffer Indices {
    uint indices[];
};

vec3 position_of(uint vertex) {
    return vec3(vertices[vertex].position[0], vertices[vertex].position[1], vertices[vertex].position[2]);
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

// Whether the triangle surely faces away. What single precision cannot tell is seen edge-on, and stays.
bool is_away(vec3 a, vec3 b, vec3 c) {
    precise vec3 e = (b - a) * cut.unit;
    precise vec3 g = (c - a) * cut.unit;
    precise vec3 to_eye = (cut.reference - a) * cut.unit;
    vec3 w = cut.is_perspective != 0u ? to_eye : cut.backward;
    float along = dot_of(cross_of(e, g), w);
    precise float scale = (dot_of(e, e) * dot_of(g, g)) * dot_of(w, w);
    precise float squared = along * along;
    precise float limit = scale * 4e-12;
    return squared > limit && scale > 1e-20 && along < 0.0;
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

// The triangle as a patch of surface, see `draw::splats`: normal and color. False where it has no area.
bool patch_of(uvec3 index, vec3 a, vec3 b, vec3 c, out uint normal, out uint color) {
    precise vec3 e = b - a;
    precise vec3 g = c - a;
    vec3 cross = cross_of(e, g);
    vec3 plane = unit_or(cross, vec3(0.0));
    precise vec3 sum = vec3(0.0);
    uvec3 channels = uvec3(0u);
    for (int i = 0; i < 3; ++i) {
        uint rgba = vertices[index[i]].color;
        // Alpha 0 marks a vertex without normal: it leaves the others to decide.
        if (rgba >> 24 != 0u) {
            sum += unit_of(halves_of(vertices[index[i]].normal));
        }
        channels += (uvec3(rgba) >> uvec3(0u, 8u, 16u)) & 0xffu;
    }
    vec3 mean = unit_or(sum, plane);
    vec3 off = cross_of(mean, plane);
    precise float thickness = min(sqrt(dot_of(off, off)), 1.0);
    uint alpha = mean == vec3(0.0) ? 0u : alpha_of(thickness);
    channels = (channels + 1u) / 3u;
    normal = code_of(mean);
    color = channels.x | (channels.y << 8) | (channels.z << 16) | (alpha << 24);
    precise float area = 0.5 * sqrt(dot_of(cross, cross));
    return area != 0.0;
}

void main() {
    begin_group();
    uint group = ITEM / 4u;
    uint lane = ITEM % 4u;
    uvec2 siblings = group < counters.groups ? groups[group] : uvec2(0u);
    uint id = siblings.x + lane;
    bool is_there = lane < (siblings.y & 0xffu) && id < uint(leaves.length());
    id = is_there ? id : 0u;
    vec3 center = vec3(leaves[id].center[0], leaves[id].center[1], leaves[id].center[2]);
    Ball ball = ball_of(center, leaves[id].radius);
    bool is_off = is_there && (siblings.y & INSIDE) == 0u && is_outside(least_inside(ball), ball);
    bool is_kept = is_there && !is_off;
    if (cut.are_samples != 0u) {
        is_kept = is_kept && centers_of(ball).x;
    }
    uvec3 index = uvec3(corners[3u * id], corners[3u * id + 1u], corners[3u * id + 2u]);
    vec3 a = position_of(index.x);
    vec3 b = position_of(index.y);
    vec3 c = position_of(index.z);
    bool faces_away = is_kept && (siblings.y & FRONT) == 0u && is_away(a, b, c);
    is_kept = is_kept && !faces_away;
    count(is_there, is_off, faces_away);

    bool is_splat = is_kept && is_small(ball);
    bool is_triangle = is_kept && !is_splat;
    uint normal = 0u;
    uint color = 0u;
    if (is_splat) {
        is_splat = patch_of(index, a, b, c, normal, color);
    }
    uint splat = is_splat ? atomicAdd(own_splats, 1u) : 0u;
    uint triangle = is_triangle ? atomicAdd(own_others, 1u) : 0u;
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        splats_at = atomicAdd(counters.splats, own_splats);
        others_at = atomicAdd(counters.indices, 3u * own_others) / 3u;
        add_counts();
    }
    barrier();
    if (is_splat && splats_at + splat < cut.most_splats) {
        splats[splats_at + splat] = SplatRecord(float[3](center.x, center.y, center.z), 0.0, normal, color);
    }
    uint at = others_at + triangle;
    if (is_triangle && at < cut.most_triangles) {
        indices[3u * at] = index.x;
        indices[3u * at + 1u] = index.y;
        indices[3u * at + 2u] = index.z;
    }
}
