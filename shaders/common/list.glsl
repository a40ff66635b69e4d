#include "common/item.glsl"

// What a pass over storage knows of the picture and of the part of the list that is bound. Mirrored by
// `abi::ListConstants`.
layout(set = 0, binding = 1, std140) uniform ListConstants {
    // The part of the picture that something may be drawn in: its first pixel, and one past its last. Storage with a
    // value a pixel has the values of these pixels, row by row.
    uvec4 rect_px;
    // Width and height of the picture, pixels.
    uvec2 size_px;
    // Pixels by which the viewport of `clip_from_view` reaches beyond the picture on every side.
    float guard_px;
    // The bound part of the list: number of its first item, how many they are, and where the first lies in what is
    // bound.
    uint first;
    uint count;
    uint begin;
    // Sign of twice the area (clockwise on the picture is positive) of the triangles that are dropped; 0: none.
    int dropped_sign;
} list;


// The low half of a key of the nearest: complement of this bit for splats, and the number in the list. Triangles are
// drawn first, so of equal depths they win.
const uint SPLAT_BIT = 0x80000000u;

// Window position of a clip position, pixels.
vec2 window_of(vec4 clip) {
    return (clip.xy / clip.w * 0.5 + 0.5) * (vec2(list.size_px) + 2.0 * list.guard_px) - list.guard_px;
}

// Where storage with a value a pixel has that of a pixel of the rectangle.
uint index_of(ivec2 pixel) {
    uvec2 in_rect = uvec2(pixel) - list.rect_px.xy;
    return in_rect.y * (list.rect_px.z - list.rect_px.x) + in_rect.x;
}
