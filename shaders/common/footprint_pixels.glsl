// The pixels of a footprint, as compute goes over them: row by row in one loop. Of two, the inner one would take as many
// turns as the longest row of its neighbors.
#include "common/disc.glsl"
#include "common/square.glsl"

// Window position of a clip position, in the steps of a rasterizer's viewport: where these round decides which pixels a
// splat of a pixel covers.
vec2 place_of(vec4 clip) {
    vec2 middle = 0.5 * (vec2(list.size_px) + 2.0 * list.guard_px);
    return clip.xy * (1.0 / clip.w) * middle + (middle - list.guard_px);
}

struct Walk {
    Disc disc;
    // So many are left to look at.
    int pixels;
    // Where storage with a value a pixel has that of the present one, and how far its center is from the disc's.
    uint pixel;
    vec2 from_center;
    // So many are left of its row, and what a row is.
    int left;
    int width;
    float first;
    uint to_next_row;
};

// Begins at the first pixel of a footprint that `bounded` has not ended, around a window position.
Walk walk_over(Disc disc, vec2 window) {
    // Less than the square that a rasterizer goes over: what that has beside the rectangle the form cuts off.
    vec2 sides = sides_of(inverse_form(disc.form), disc.skew) + 1.0 / 64.0;
    Walk walk;
    walk.disc = bounded(disc);
    Square square = rectangle_around(window, walk.disc.form == vec3(0.0) ? vec2(walk.disc.size_px) : sides);
    ivec2 size = max(square.end - square.first, ivec2(0));
    walk.pixels = size.x * size.y;
    walk.pixel = index_of(square.first);
    walk.from_center = vec2(square.first) + 0.5 - walk.disc.center_px;
    walk.left = size.x;
    walk.width = size.x;
    walk.first = walk.from_center.x;
    walk.to_next_row = list.rect_px.z - list.rect_px.x - uint(size.x) + 1u;
    return walk;
}

// Whether the footprint covers the present pixel.
bool is_covered(Walk walk) {
    return rho_squared(walk.disc.form, walk.disc.skew, walk.from_center) <= 1.0;
}

// Goes on to the next pixel.
void go_on(inout Walk walk) {
    --walk.pixels;
    --walk.left;
    bool is_end = walk.left == 0;
    walk.pixel += is_end ? walk.to_next_row : 1u;
    walk.from_center = is_end ? vec2(walk.first, walk.from_center.y + 1.0) : walk.from_center + vec2(1.0, 0.0);
    walk.left = is_end ? walk.width : walk.left;
}
