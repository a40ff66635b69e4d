#version 460
// Pass cut.tree, for every level: which nodes are dropped, which are splats or rows of splats, and of which the children are
// looked at. An invocation does one node, four those of a sibling group; the host does the same in `cut::CutSelector`.
#include "common/cut_lists.glsl"
#include "common/row.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 4, std430) readonly buffer Nodes {
    NodeRecord nodes[];
};

layout(set = 0, binding = 5, std430) readonly buffer Attributes {
    AttributesRecord attributes[];
};

layout(set = 0, binding = 6, std430) writeonly buffer Opened {
    uvec2 opened[];
};

// Whether everything in the ball faces away (x), or the viewer (y).
bvec2 facing(NodeRecord node, Ball ball) {
    uint packed_sine = node.sine & 0xffffu;
    vec3 axis = unfolded(max(vec2(halves_of(node.axis)), vec2(-32767.0)), 32767.0);
    precise float sine = float(packed_sine) * (1.0 / 65535.0);
    precise float sine_squared = sine * sine;
    precise float cosine = sqrt(max(1.0 - sine_squared, 0.0));
    float length_squared = dot_of(axis, axis);
    bool is_perspective = cut.is_perspective != 0u;
    float along = dot_of(axis, is_perspective ? ball.center : -cut.backward);
    float distance_squared = is_perspective ? dot_of(ball.center, ball.center) : 1.0;
    float radius = is_perspective ? ball.radius : 0.0;
    precise float k = distance_squared * length_squared;
    precise float t = (abs(along) * cosine) * 0.999999 - (radius * sqrt(length_squared)) * 1.000001;
    precise float across = max(k * 1.000001 - along * along, 0.0);
    precise float limit = (across * sine_squared) * 1.0001 + k * 4e-9;
    precise float t_squared = t * t;
    bool is_decided = packed_sine != 0xffffu && t > 0.0 && t_squared >= limit;
    return bvec2(is_decided && along > 0.0, is_decided && !(along > 0.0));
}

// Number of splats of the row that stands for a node, or 0: see `cut::strip`.
uint row_of(uint id, NodeRecord node, Ball ball) {
    uint children = (node.shape >> 16) & 0xffu;
    float most = float(cut.most_in_row);
    if (id >= cut.lowest_nodes) {
        most = float(int(children) - 1);
    } else if (id >= cut.low_nodes) {
        most = float(min(max(cut.low_leaves, 1u) - 1u, cut.most_in_row));
    }
    vec2 relative = relative_size(node);
    bool is_perspective = cut.is_perspective != 0u;
    float depth = is_perspective ? ball.depth : 1.0;
    precise float in_balls = ball.radius * cut.ratio;
    precise vec2 sizes = relative * in_balls;
    precise vec2 limits = vec2(depth * most, depth * cut.row_width);
    if (!(relative.y < 1.0 && sizes.y <= limits.y && sizes.x <= limits.x)) {
        return 0u;
    }
    precise vec2 size = relative * ball.radius;
    precise float nearest = ball.depth - size.x;
    precise float far = sqrt(dot_of(ball.center, ball.center)) + size.x;
    precise float far_squared = is_perspective ? far * far : 1.0;
    precise float near_squared = nearest * nearest;
    precise float limit = is_perspective ? (near_squared * near_squared) * cut.row_limit : cut.row_limit;
    precise float reach = is_perspective ? nearest * cut.row_ball : cut.row_ball;
    precise float thick = (size.y * size.y) * far_squared;
    precise float squared = ((size.x * size.x) * far_squared) / (limit - thick);
    precise float front = nearest - reach;
    precise float thickest = limit * cut.row_width_squared;
    float longest = float(cut.most_in_row * cut.most_in_row);
    if (!(front > cut.near && nearest > 0.0 && thick <= thickest && squared <= longest)) {
        return 0u;
    }
    precise float count = max(ceil(sqrt(squared)), 2.0);
    return count <= most ? uint(count) : 0u;
}

void main() {
    begin_group();
    uint group = ITEM / 4u;
    uint lane = ITEM % 4u;
    uvec2 siblings = group < counters.groups ? groups[group] : uvec2(0u);
    uint id = siblings.x + lane;
    bool is_there = lane < (siblings.y & 0xffu) && id < uint(nodes.length());
    NodeRecord node = nodes[is_there ? id : 0u];
    Ball ball = ball_of(vec3(node.center[0], node.center[1], node.center[2]), node.radius);
    float least = least_inside(ball);
    bool asks_volume = (siblings.y & INSIDE) == 0u;
    bool is_off = is_there && asks_volume && is_outside(least, ball);
    bool is_kept = is_there && !is_off;
    bvec2 faces = facing(node, ball);
    bool asks_cones = (siblings.y & FRONT) == 0u;
    bool is_away = is_kept && asks_cones && faces.x;
    is_kept = is_kept && !is_away;
    count(is_there, is_off, is_away);

    bool is_single = is_small(ball);
    if (cut.are_samples != 0u) {
        // What contains no center is nothing, what contains one alone is it.
        bvec2 centers = centers_of(ball);
        is_kept = is_kept && centers.x;
        is_single = is_single || centers.y;
    }
    uint own = 0u;
    bool is_open = false;
    if (is_kept && is_single) {
        own = 1u;
    } else if (is_kept) {
        own = row_of(id, node, ball);
        is_open = own == 0u;
    }
    bool is_row = own > 1u;
    // Triangles without area cover nothing. Where triangles may become splats they count among those.
    bool counts_all = (cut.are_points | cut.names_triangles) != 0u;
    bool has_area = is_there && (counts_all || attributes[id].area != 0.0);
    own = has_area ? own : 0u;
    uint splat = own > 0u ? atomicAdd(own_splats, own) : 0u;
    uint other = is_open ? atomicAdd(own_others, 1u) : 0u;
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        splats_at = atomicAdd(counters.splats, own_splats);
        others_at = atomicAdd(counters.opened, own_others);
        add_counts();
    }
    barrier();
    splat += splats_at;
    for (uint i = 0u; i < own && splat + i < cut.most_splats; ++i) {
        splat_ids[splat + i] = uvec2(id, is_row ? (own << 16) | i : 0u);
    }
    if (is_open && others_at + other < uint(opened.length())) {
        bool is_within = asks_volume && is_inside(least, ball);
        uint found = (is_within ? INSIDE : 0u) | (asks_cones && faces.y ? FRONT : 0u);
        uint inherited = siblings.y & ~0xffu;
        opened[others_at + other] = uvec2(node.first_child, ((node.shape >> 16) & 0xffu) | inherited | found);
    }
}
