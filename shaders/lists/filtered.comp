#version 460
// Pass lists.filtered: what a draw list names becomes filtered splats as this eye sees them, those that `pack::filtered` would
// have written. An invocation does one.
#include "common/color_slope.glsl"
#include "common/filtered_light.glsl"
#include "common/filtered_place.glsl"
#include "common/row.glsl"
#include "common/splat_id.glsl"

layout(local_size_x = 64) in;

layout(set = 0, binding = 2, std430) readonly buffer SplatIds {
    uvec2 splat_ids[];
};

layout(set = 0, binding = 6, std430) writeonly buffer FilteredVectors {
    // Three to a record of `abi::FilteredSplat`.
    vec4 vectors[];
};

// What shows nothing lies before the near plane, where rasterizers drop it, and beside every picture, where compute does.
void write_nothing(uint item) {
    vectors[3u * item] = vec4(-FARTHEST_PX, -FARTHEST_PX, 2.0, 1.0);
    vectors[3u * item + 1u] = vec4(2.0, 0.0, 1.0, 1.0);
    vectors[3u * item + 2u] = vec4(0.0);
}

void write_splat(uint item, SummedPatch of, SeenPatch seen, SplatSize size, vec3 color) {
    size.diameter_px = min(size.diameter_px, eye.limit_px);
    // Its neighbors may be as large as the threshold.
    precise float half_side = max(size.diameter_px, eye.side_px) * seen.z / (eye.focal_px * 2.0);
    precise float offset = depth_reach(of, half_side, seen.facing, size.is_own) * eye.offset_px;
    PicturePlace place = place_of(of.center, offset);
    if (!seen.is_seen || !place.is_between) {
        write_nothing(item);
        return;
    }
    precise float area_px = area_px_of(seen) * size.share;
    vectors[3u * item] = vec4(place.window_px, place.pushed_depth, side_of(of, seen, size));
    vectors[3u * item + 1u] = vec4(
        place.depth, area_px, extent_along(eye.right, of, seen, size), extent_along(eye.up, of, seen, size)
    );
    vectors[3u * item + 2u] = vec4(color, 0.0);
}

// Projected diameter of a leaf, pixels.
float diameter_of(LeafRecord leaf) {
    vec3 center = vec3(leaf.center[0], leaf.center[1], leaf.center[2]);
    precise float diameter = eye.twice_focal_px * leaf.radius * eye.model_scale;
    float z = -in_view(2, center);
    precise float at_distance = diameter / z;
    // It reaches the eye.
    float nearby = z > 0.0 ? at_distance : 2.0 * eye.limit_px;
    return has_flag(FLAG_ORTHOGRAPHIC) ? diameter : nearby;
}

// A leaf with the bits of its number, and its size.
SummedPatch patch_of_leaf(uint id, uint part, inout SplatSize size) {
    float diameter_px = diameter_of(leaves[id]);
    if (!HAVE_TRIANGLES) {
        size.is_own = diameter_px > eye.side_px;
        size.diameter_px = max(diameter_px, eye.side_px);
        return patch_of_point(id);
    }
    // Of the threshold's size, or once more than its edges are halved.
    uint cuts = (part >> PIECE_CUTS) & PIECE_MOST;
    if (cuts > 0u) {
        --cuts;
        size.is_own = (part & OF_OWN_SIZE) != 0u;
        size.diameter_px = diameter_px / float(1u << cuts);
    }
    return patch_of_triangle(id, cuts, part & PIECE_NUMBER);
}

void main() {
    if (ITEM >= list.count) {
        return;
    }
    uint item = list.begin + ITEM;
    uint id = splat_ids[item].x;
    uint part = splat_ids[item].y;
    SplatSize size = SplatSize(1.0, false, vec3(0.0), eye.side_px, false);
    ColorSlope slope = NO_SLOPE;
    vec3 mean = vec3(0.0);
    vec3 middle = vec3(0.0);
    SummedPatch of;
    if ((part & LEAF) != 0u) {
        of = patch_of_leaf(id, part, size);
    } else if ((part >> 16) == 0u) {
        if (HAVE_TRIANGLES) {
            of = patch_of_node(id);
        } else {
            of = patch_of_points(id);
        }
    } else {
        uint count = part >> 16;
        NodeRecord node = nodes[id];
        of = patch_of_node(id);
        if (count >= LEAST_SLOPED && is_plain()) {
            slope = slope_of(node);
            mean = in_headlight(of, seen_of(of));
            middle = of.center;
        }
        // As `cut::strip_steps` has it.
        precise vec3 to_end = strip_direction(node) * (relative_size(node).x * node.radius);
        precise float share = 2.0 / float(count);
        precise vec3 start = vec3(node.center[0], node.center[1], node.center[2]) + to_end * (0.5 * share - 1.0);
        precise vec3 to_next = to_end * share;
        precise vec3 center = start + to_next * float(part & 0xffffu);
        of.center = center;
        of.reach = -1.0;
        size.share = 1.0 / float(count);
        size.is_row = true;
        size.to_next = to_next;
    }
    SeenPatch seen = seen_of(of);
    vec3 color;
    if (slope.is_there) {
        color = color_along(slope, mean, middle, of.center);
    } else if (is_plain()) {
        color = in_headlight(of, seen);
    } else {
        color = other_color(of, seen);
    }
    write_splat(item, of, seen, size, color);
}
