#version 460
// Pass cut.leaves: small leaves and points are splats, large ones triangles, whose corners are listed: from the start of the
// list those that compute draws, and from its end the others. Points (and triangles, where they are splats too) that may be
// too large for what draws small splats are listed from the end of the splats; so are large triangles that may become filtered
// splats, instead of their corners. An invocation does one leaf.
#include "common/cut_lists.glsl"
#include "common/patch.glsl"
#include "common/splat_id.glsl"
#include "common/tree.glsl"

layout(local_size_x = 64) in;

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

// How many triangles of a workgroup compute draws, how many splats are quads or large triangles, and where they go.
shared uint own_small;
shared uint own_last;
shared uint small_at;
shared uint last_at;

// Whether a leaf in a ball is drawn as a point, as `pack::splats` has it. Where not, it may still fit one.
bool fits_point(Ball ball) {
    if (cut.are_oriented == 0u) {
        precise float side = ball.radius * cut.twice_focal_px;
        float depth = cut.is_perspective != 0u ? max(ball.depth, cut.near) : 1.0;
        precise float most = cut.largest_px * depth;
        return side <= most;
    }
    if (!(ball.radius > 0.0)) {
        // As large as one of the threshold's size may be seen anywhere.
        return false;
    }
    precise float side = ball.radius * cut.twice_focal_px;
    if (cut.is_perspective == 0u) {
        return side <= cut.largest_px;
    }
    precise float front = ball.depth - ball.radius;
    if (front <= cut.near) {
        precise float most = cut.largest_px * max(ball.depth, cut.near);
        return side <= most;
    }
    precise float aside = sqrt(max(dot_of(ball.center, ball.center) - ball.depth * ball.depth, 0.0));
    precise float slope = aside / ball.depth;
    precise float seen = side * (1.0 + slope);
    precise float most = cut.largest_px * front;
    return seen <= most;
}

// Bits of a leaf that is a splat though it is larger than the threshold, or close to the near plane: a square or circle has the
// threshold's size unless its leaf is larger, and a triangle that lies in the picture at any size lies in its own plane.
uint bits_of_large(Ball ball) {
    if (cut.are_oriented != 0u) {
        return cut.are_points != 0u ? 0u : IN_PLANE;
    }
    precise float side = ball.radius * cut.twice_focal_px;
    float depth = cut.is_perspective != 0u ? max(ball.depth, cut.near) : 1.0;
    precise float most = cut.threshold_px * depth;
    return side > most ? OF_OWN_SIZE : 0u;
}

// Whether compute draws the triangle in a ball: it is a few pixels large, and before the near plane.
bool is_for_compute(Ball ball) {
    float front = ball.depth - ball.radius;
    float limit = cut.is_perspective != 0u ? front : 1.0;
    return cut.compute_ratio > 0.0 && front > cut.near && ball.radius * cut.compute_ratio <= limit;
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

void main() {
    if (gl_LocalInvocationIndex == 0u) {
        own_small = 0u;
        own_last = 0u;
    }
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
    bool are_points = cut.are_points != 0u;
    bool is_within = is_small(ball);
    bool is_large_splat = !is_within && (are_points || cut.draws_large_leaves != 0u);
    if (cut.are_samples != 0u) {
        is_kept = is_kept && centers_of(ball).x;
    }
    uvec3 index = uvec3(0u);
    bool faces_away = false;
    if (!are_points) {
        index = uvec3(corners[3u * id], corners[3u * id + 1u], corners[3u * id + 2u]);
        vec3 a = position_of(vertices[index.x]);
        vec3 b = position_of(vertices[index.y]);
        vec3 c = position_of(vertices[index.z]);
        faces_away = is_kept && (siblings.y & FRONT) == 0u && is_away(a, b, c);
        is_kept = is_kept && !faces_away;
    }
    count(is_there, is_off, faces_away);

    bool is_splat = is_kept && (is_within || is_large_splat);
    bool is_triangle = is_kept && !is_splat;
    bool is_named = is_triangle && cut.names_triangles != 0u;
    is_triangle = is_triangle && !is_named;
    // Triangles without area cover nothing. Where others may become splats they count among those.
    if (is_splat && !are_points && cut.names_triangles == 0u) {
        VertexRecord corners_of_leaf[3] = VertexRecord[3](vertices[index.x], vertices[index.y], vertices[index.z]);
        is_splat = patch_of(corners_of_leaf, false).area != 0.0;
    }
    uint bits = LEAF | (is_large_splat ? bits_of_large(ball) : 0u);
    bool has_own_size = (bits & OF_OWN_SIZE) != 0u || cut.are_oriented != 0u;
    bool is_quad = is_splat && has_own_size && (is_large_splat || are_points) && !fits_point(ball);
    bool is_point = is_splat && !is_quad;
    uint splat = is_point ? atomicAdd(own_splats, 1u) : 0u;
    bool is_last = is_quad || is_named;
    uint last = is_last ? atomicAdd(own_last, 1u) : 0u;
    bool is_fine = is_triangle && is_for_compute(ball);
    bool is_large = is_triangle && !is_fine;
    uint triangle = is_large ? atomicAdd(own_others, 1u) : 0u;
    uint fine = is_fine ? atomicAdd(own_small, 1u) : 0u;
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        splats_at = atomicAdd(counters.splats, own_splats);
        // A list has one kind or the other.
        if (cut.names_triangles != 0u) {
            last_at = atomicAdd(counters.named, own_last);
        } else {
            last_at = atomicAdd(counters.quads, own_last);
        }
        others_at = atomicAdd(counters.indices, 3u * own_others) / 3u;
        small_at = atomicAdd(counters.small, own_small);
        add_counts();
    }
    barrier();
    if (is_point && splats_at + splat < cut.most_splats) {
        splat_ids[splats_at + splat] = uvec2(id, bits);
    }
    if (is_last && last_at + last < cut.most_splats) {
        splat_ids[cut.room - 1u - (last_at + last)] = uvec2(id, bits);
    }
    uint number = is_fine ? small_at + fine : others_at + triangle;
    uint room = uint(indices.length()) / 3u;
    uint at = is_fine ? number : room - 1u - number;
    if (is_triangle && number < cut.most_triangles) {
        indices[3u * at] = index.x;
        indices[3u * at + 1u] = index.y;
        indices[3u * at + 2u] = index.z;
    }
}
