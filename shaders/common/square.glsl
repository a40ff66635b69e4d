// The pixels of a square, as a rasterizer of points finds them: positions in steps of 1/256 pixel, a pixel belongs to
// the square that contains its center.
#include "common/list.glsl"

struct Square {
    ivec2 first;
    // One past the last.
    ivec2 end;
};

// The part of a rectangle around a window position that lies in that of the frame; empty when either is not finite.
Square rectangle_around(vec2 window, vec2 sides_px) {
    vec2 side = clamp(sides_px, vec2(0.0), vec2(65536.0));
    // Too far beside the rectangle to reach into it; also keeps the integers below from overflowing.
    if (!(all(greaterThan(window, vec2(list.rect_px.xy) - side)) && all(lessThan(window, vec2(list.rect_px.zw) + side)))) {
        return Square(ivec2(0), ivec2(0));
    }
    ivec2 steps = ivec2(roundEven(side * 256.0));
    ivec2 low = ivec2(roundEven(window * 256.0)) - steps / 2;
    // Center of pixel i: 256 i + 128 >= low  <=>  i >= (low + 127) >> 8.
    return Square(
        max((low + 127) >> 8, ivec2(list.rect_px.xy)),
        min((low + steps + 127) >> 8, ivec2(list.rect_px.zw))
    );
}

// The same of a square, a pixel large at least.
Square square_around(vec2 window, float side_px) {
    return rectangle_around(window, vec2(max(side_px, 1.0)));
}
