// Slope of the color along the row of splats that stands for a node, see `pack::filtered`.
#include "common/seen_patch.glsl"

struct ColorSlope {
    bool is_there;
    vec3 direction;
    vec3 per_unit;
    // Largest difference from the mean.
    vec3 most;
};

const ColorSlope NO_SLOPE = ColorSlope(false, vec3(0.0), vec3(0.0), vec3(0.0));

// Parts of a node: how much is seen of each, 0 where it does not count, and its color.
struct SlopeParts {
    uint lanes;
    vec4 weight;
    vec3 centers[4];
    vec3 colors[4];
};

float dot4_of(vec4 a, vec4 b) {
    precise vec4 products = a * b;
    precise float sum = (products.x + products.z) + (products.y + products.w);
    return sum;
}

// The unit vector along a node's strip.
vec3 strip_direction(NodeRecord node) {
    return unit_of(max(ivec2(int(node.sine << 8) >> 24, int(node.sine) >> 24), ivec2(-127)) * 258);
}

// Children of a node, of triangles or nodes.
SlopeParts parts_of(NodeRecord parent, bool has_leaves) {
    uint count = clamp((parent.shape >> 16) & 0xffu, 1u, 4u);
    SlopeParts parts;
    parts.lanes = 0u;
    for (uint i = 0u; i < 4u; ++i) {
        uint id = parent.first_child + min(i, count - 1u);
        SummedPatch of;
        if (has_leaves) {
            of = patch_of_triangle(id, 0u, 0u);
        } else {
            of = patch_of_node(id);
        }
        SeenPatch seen = seen_of(of);
        bool is_in = i < count && seen.is_seen;
        parts.lanes |= is_in ? 1u << i : 0u;
        parts.weight[i] = is_in ? seen.front : 0.0;
        parts.centers[i] = of.center;
        parts.colors[i] = in_headlight(of, seen);
    }
    return parts;
}

// Slope of the line through the colors that has the least squares.
ColorSlope slope_through(SlopeParts parts, NodeRecord node) {
    vec3 direction = strip_direction(node);
    precise float sum = (parts.weight.x + parts.weight.y) + (parts.weight.z + parts.weight.w);
    vec4 along;
    for (int i = 0; i < 4; ++i) {
        along[i] = dot_of(direction, parts.centers[i]);
    }
    precise vec4 off = along - dot4_of(parts.weight, along) / sum;
    precise vec4 squares = off * off;
    float spread = dot4_of(parts.weight, squares);
    precise float least = LEAST_SPREAD * node.radius;
    precise float least_spread = sum * least * least;
    // Also where nothing is seen and the quotient is no number.
    if (parts.lanes == 0u || !(spread > least_spread)) {
        return NO_SLOPE;
    }
    ColorSlope slope = ColorSlope(true, direction, vec3(0.0), vec3(0.0));
    for (int channel = 0; channel < 3; ++channel) {
        vec4 color;
        float low = 2.0;
        float high = -1.0;
        for (int i = 0; i < 4; ++i) {
            color[i] = parts.colors[i][channel];
            bool is_in = (parts.lanes >> i & 1u) != 0u;
            low = is_in ? min(low, color[i]) : low;
            high = is_in ? max(high, color[i]) : high;
        }
        precise vec4 moved = off * color;
        precise float per_unit = dot4_of(parts.weight, moved) / spread;
        precise float most = MOST_CHANGE * (high - low);
        slope.per_unit[channel] = per_unit;
        slope.most[channel] = most;
    }
    return slope;
}

// As the color changes between a node's children, or where these lie side by side (needles do), between theirs.
ColorSlope slope_of(NodeRecord node) {
    NodeRecord parent = node;
    for (uint level = 0u; level < SLOPE_LEVELS; ++level) {
        // `tree::Node::LEAF_CHILDREN`.
        bool has_leaves = ((parent.shape >> 24) & 1u) != 0u;
        if (has_leaves && !HAVE_TRIANGLES) {
            return NO_SLOPE;
        }
        SlopeParts parts = parts_of(parent, has_leaves);
        ColorSlope slope = slope_through(parts, node);
        if (slope.is_there || has_leaves || parts.lanes == 0u) {
            return slope;
        }
        parent = nodes[parent.first_child + uint(findLSB(parts.lanes))];
    }
    return NO_SLOPE;
}

// The color at a place, where it is `mean` at `middle`.
vec3 color_along(ColorSlope slope, vec3 mean, vec3 middle, vec3 at) {
    precise vec3 from = at - middle;
    float along = dot_of(slope.direction, from);
    precise vec3 change = max(min(along * slope.per_unit, slope.most), -slope.most);
    precise vec3 color = min(max(mean + change, vec3(0.0)), vec3(1.0));
    return color;
}
