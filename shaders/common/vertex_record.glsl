// Triangles as storage: corner indices and vertices, and the set-up of one small triangle. What follows is the
// rasterizer's rule (Vulkan, "Basic Polygon Rasterization"): positions in steps of 1/256 pixel, a pixel belongs to the
// triangle that contains its center, and on an edge to the one whose top or left edge it is.
#include "common/frame.glsl"
#include "common/list.glsl"

// Mirrored by `abi::Vertex`.
struct VertexRecord {
    float position[3];
    // Octahedral, 2 x 16 bit signed normalized.
    uint normal;
    // Red, green, blue, alpha from the lowest byte; alpha 0 marks a vertex without normal.
    uint color;
};

layout(set = 0, binding = 2, std430) readonly buffer Corners {
    uint corners[];
};

layout(set = 0, binding = 3, std430) readonly buffer Vertices {
    VertexRecord vertices[];
};

struct Small {
    // Corners in steps of 1/256 pixel from the first, clockwise on the picture (y down): the others.
    ivec2 second;
    ivec2 third;
    // The first corner, steps of 1/256 pixel from the corner of the picture.
    ivec2 origin;
    // Depth and 1 / w of the corners.
    vec3 depth;
    vec3 inverse_w;
    // Indices of the corners.
    uvec3 index;
    // Twice the area, steps squared; 0: nothing is covered.
    int area;
};

Small set_up(uint item) {
    Small small;
    small.index = uvec3(corners[3 * item], corners[3 * item + 1], corners[3 * item + 2]);
    ivec2 at[3];
    for (int i = 0; i < 3; ++i) {
        VertexRecord v = vertices[small.index[i]];
        vec4 clip = frame.clip_from_view
            * (frame.view_from_model * vec4(v.position[0], v.position[1], v.position[2], 1.0));
        small.inverse_w[i] = 1.0 / clip.w;
        small.depth[i] = clip.z / clip.w;
        at[i] = ivec2(roundEven(window_of(clip) * 256.0));
    }
    small.origin = at[0];
    small.second = at[1] - at[0];
    small.third = at[2] - at[0];
    small.area = small.second.x * small.third.y - small.second.y * small.third.x;
    if (small.area != 0 && sign(small.area) == list.dropped_sign) {
        small.area = 0;
    }
    if (small.area < 0) {
        small.area = -small.area;
        small.second = at[2] - at[0];
        small.third = at[1] - at[0];
        small.depth = small.depth.xzy;
        small.inverse_w = small.inverse_w.xzy;
        small.index = small.index.xzy;
    }
    return small;
}

// Value of the edge function from `from` to `to` at `point`, and 1 less where the edge is neither top nor left, so that
// a point belongs to the triangle when all three are at least 0.
int edge(ivec2 from, ivec2 to, ivec2 point) {
    ivec2 d = to - from;
    return d.x * (point.y - from.y) - d.y * (point.x - from.x);
}

int outside_by_rule(ivec2 from, ivec2 to) {
    ivec2 d = to - from;
    return (d.y < 0 || (d.y == 0 && d.x > 0)) ? 0 : 1;
}

// Weights of the corners in the window at the center of a pixel.
vec3 weights(Small small, ivec2 pixel) {
    ivec2 point = pixel * 256 + 128 - small.origin;
    return vec3(
        edge(small.second, small.third, point),
        edge(small.third, ivec2(0), point),
        edge(ivec2(0), small.second, point)
    ) / float(small.area);
}
