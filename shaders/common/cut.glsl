// What the passes that choose a cut know, and the tests that they share: those of `cut::Tester` in the same operations in
// the same order, so that both choose the same. Nothing is contracted.
#include "common/constants.glsl"
#include "common/exact.glsl"
#include "common/item.glsl"

// Mirrored by `abi::CutConstants`.
layout(set = 0, binding = 0, std140) uniform CutConstants {
    // The sides of the view volume and the view direction: unit normals, and what is added.
    vec4 sides[4];
    vec4 forward;
    // To the right and up in the picture, and what is added.
    vec4 right;
    vec4 up;
    // Third row of the matrix from model to view space.
    vec4 view_row;
    // Pixels of a tangent (perspective) or of a unit, and the middle of the picture.
    vec2 focal;
    vec2 middle;
    // Where lengths start, and their units in a unit of the model.
    vec3 reference;
    float unit;
    // From the scene to the viewer (orthographic).
    vec3 backward;
    float plane_error;
    float near;
    float far;
    // 2 f / threshold, and its square.
    float ratio;
    float ratio_squared;
    // Rows of splats: the threshold over 2 f, the limit of the square of a count, the widest strip over the ball of a splat
    // and its square.
    float row_ball;
    float row_limit;
    float row_width;
    float row_width_squared;
    // First node of the lowest level and of the one above it, and how many leaves are below one of the latter.
    uint lowest_nodes;
    uint low_nodes;
    uint low_leaves;
    // Most splats in a row.
    uint most_in_row;
    // What the root inherits.
    uint start;
    uint is_perspective;
    // Records that the lists have room for.
    uint most_splats;
    uint most_triangles;
    // What a place in the picture may be off, times the distance (perspective) or alone, and by rounding, pixels.
    float place_error;
    float snap;
    // Largest focal length of the two.
    float focal_px;
    // Whether splats are one pixel, drawn where balls contain its center.
    uint are_samples;
    // 2 f / the largest triangle that compute draws, pixels; 0: the rasterizer draws all.
    float compute_ratio;
    // Whether leaves are points, which are splats whatever their size, and whether large triangles are splats too.
    uint are_points;
    uint draws_large_leaves;
    // Whether splats lie in the plane of the surface, with a radius of their own.
    uint are_oriented;
    // Items that each list of splats has room for.
    uint room;
    // 2 f, pixels of a tangent (perspective) or of a unit here; side of a splat without a size of its own, pixels.
    float twice_focal_px;
    float threshold_px;
    // Largest side of a leaf that is drawn as a point, pixels, without what it is widened by.
    float largest_px;
    // Whether large triangles are named at the end of the splats, as some may become filtered splats, and whether all do.
    uint names_triangles;
    uint are_pieces;
    // 2 f, pixels of a tangent (perspective) or of a unit of view space; length there of a unit vector in model space.
    float view_focal_px;
    float view_scale;
} cut;

// Mirrored by `abi::CutCounters`: commands that the device makes for itself, then counts.
layout(set = 0, binding = 1, std430) buffer Counters {
    // A draw of all splats that are points.
    uint splats;
    uint splat_instances;
    uint first_splat;
    uint first_splat_instance;
    // A draw of those that may be too large for points, an instance each.
    uint quad_vertices;
    uint quads;
    uint first_quad_vertex;
    uint first_quad;
    // A draw of all triangles.
    uint indices;
    uint index_instances;
    uint first_index;
    int vertex_offset;
    uint first_index_instance;
    // A dispatch over the groups of the level.
    uint groups_x;
    uint groups_y;
    uint groups_z;
    // Sibling groups of the level, and of the next one so far.
    uint groups;
    uint opened;
    // As `cut::Stats` has them.
    uint visited;
    uint outside;
    uint facing_away;
    // Triangles that compute draws.
    uint small;
    // Dispatches over the points, the quads and the small triangles.
    uint splat_groups[3];
    uint quad_groups[3];
    uint small_groups[3];
    // Large triangles that may become filtered splats, those of them that are small on the screen, and a dispatch over all.
    uint named;
    uint named_small;
    uint named_groups[3];
    // Pieces of those up to the limit and of the others, and whether these are too many to be counted.
    uint pieces_within;
    uint pieces_beyond;
    uint are_too_many;
    // The largest that become splats, and the largest that become several.
    float taken_px;
    float halved_px;
} counters;

// Siblings that are to be looked at: the first one; in the lowest byte of the other word how many they are, above it what
// they inherit.
const uint COUNT_BITS = 8u;
// Wholly inside the view volume (or nothing is dropped by it): no test below.
const uint INSIDE = 1u << COUNT_BITS;
// Every normal faces the viewer (or nothing is dropped by facing): no test below.
const uint FRONT = 2u << COUNT_BITS;

struct Ball {
    // From the reference, in its unit.
    vec3 center;
    float radius;
    // Along the view direction.
    float depth;
};

float distance_from(vec4 plane, vec3 center) {
    precise float sum = dot_of(plane.xyz, center) + plane.w;
    return sum;
}

Ball ball_of(vec3 center, float radius) {
    precise vec3 at = (center - cut.reference) * cut.unit;
    precise float scaled = radius * cut.unit;
    return Ball(at, scaled, distance_from(cut.forward, at));
}

// At most the threshold wide on the screen and in front of the near plane.
bool is_small(Ball ball) {
    precise float front = ball.depth - ball.radius;
    precise float squared = ball.radius * ball.radius;
    precise float tangent = dot_of(ball.center, ball.center) - squared;
    precise float depths = ball.depth * ball.depth - squared;
    precise float seen = (squared * cut.ratio_squared) * tangent;
    precise float most = depths * depths;
    precise float in_pixels = ball.radius * cut.ratio;
    return front > cut.near && (cut.is_perspective != 0u ? seen <= most : in_pixels <= 1.0);
}

// The least distance to a side of the view volume, inward.
float least_inside(Ball ball) {
    precise float near = ball.depth - cut.near;
    precise float far = cut.far - ball.depth;
    float least = min(near, far);
    for (int i = 0; i < 4; ++i) {
        least = min(least, distance_from(cut.sides[i], ball.center));
    }
    return least;
}

bool is_outside(float least, Ball ball) {
    precise float limit = -ball.radius - cut.plane_error;
    return least < limit;
}

bool is_inside(float least, Ball ball) {
    precise float limit = ball.radius + cut.plane_error;
    return least >= limit;
}

// What may be in the picture of a ball at `along` the axes of the picture: the center of a pixel (x), and surely no more
// than that of the pixel that its middle is in (y). As `cut::centers` has it.
bvec2 centers_of(vec2 along, float depth, float radius) {
    bool is_perspective = cut.is_perspective != 0u;
    precise float inverse = is_perspective ? 1.0 / depth : 1.0;
    precise vec2 at = along * inverse;
    precise float size = radius * inverse;
    precise float off = inverse * cut.place_error + cut.snap;
    precise vec2 squares = at * at;
    precise float stretch = is_perspective ? (squares.x + squares.y) * 0.506 + 1.006 : 1.001;
    precise float reach = (size * cut.focal_px) * stretch + off * 1.41421356;
    bool is_known = !is_perspective || size < 0.01;
    precise vec2 shifted = at * cut.focal + cut.middle + 0.5;
    precise vec2 sum = shifted + 8388608.0;
    precise vec2 rounded = sum - 8388608.0;
    precise vec2 aside = abs(shifted - rounded);
    precise vec2 sides = aside * aside;
    precise float nearest = sides.x + sides.y;
    precise float reach_squared = reach * reach;
    float farther = max(aside.x, aside.y);
    precise float next = (nearest - 2.0 * farther) + 1.0;
    precise float border = 0.5 - off;
    precise float front = depth - radius;
    bool misses = is_known && nearest > reach_squared && depth > cut.near;
    bool is_one = is_known && next > reach_squared && farther < border && front > cut.near;
    return bvec2(!misses, is_one);
}

bvec2 centers_of(Ball ball) {
    vec2 along = vec2(distance_from(cut.right, ball.center), distance_from(cut.up, ball.center));
    return centers_of(along, ball.depth, ball.radius);
}
