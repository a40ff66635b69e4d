// Triangles as storage: corner indices and vertices, and the set-up of one small triangle. What follows is the
// rasterizer's rule (Vulkan, "Basic Polygon Rasterization"): positions in steps of 1/256 pixel, a pixel belongs to the
// triangle that contains its center, and on an edge to the one whose top or left edge it is.
#include "common/headlight.glsl"
#include "common/list.glsl"
#include "common/octahedral.glsl"
#include "common/vertex.glsl"

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

uvec3 corners_of(uint item) {
    return uvec3(corners[3 * item], corners[3 * item + 1], corners[3 * item + 2]);
}

vec3 position_of(VertexRecord v) {
    return vec3(v.position[0], v.position[1], v.position[2]);
}

// The triangle of these vertices, whose corners are at these clip positions.
Small set_up_at(uvec3 index, vec4 clip[3]) {
    Small small;
    small.index = index;
    ivec2 at[3];
    for (int i = 0; i < 3; ++i) {
        small.inverse_w[i] = 1.0 / clip[i].w;
        precise float depth = clip[i].z / clip[i].w;
        small.depth[i] = depth;
        at[i] = ivec2(roundEven(window_of(clip[i]) * 256.0));
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

Small set_up(uint item) {
    uvec3 index = corners_of(item);
    precise vec4 clip[3];
    for (int i = 0; i < 3; ++i) {
        vec3 position = position_of(vertices[index[i]]);
        clip[i] = frame.clip_from_view * (frame.view_from_model * vec4(position, 1.0));
    }
    return set_up_at(index, clip);
}

int edge(ivec2 from, ivec2 to, ivec2 point) {
    ivec2 d = to - from;
    return d.x * (point.y - from.y) - d.y * (point.x - from.x);
}

int least_inside(ivec2 from, ivec2 to) {
    ivec2 d = to - from;
    return (d.y < 0 || (d.y == 0 && d.x > 0)) ? 0 : 1;
}

// Values of the edge functions at the center of a pixel, each proportional to the weight of the corner opposite.
ivec3 edges(Small small, ivec2 pixel) {
    ivec2 point = pixel * 256 + 128 - small.origin;
    return ivec3(
        edge(small.second, small.third, point),
        edge(small.third, ivec2(0), point),
        edge(ivec2(0), small.second, point)
    );
}

// The least values inside: 1 where a center exactly on the edge belongs to the neighbor.
ivec3 least_edges(Small small) {
    return ivec3(
        least_inside(small.second, small.third),
        least_inside(small.third, ivec2(0)),
        least_inside(ivec2(0), small.second)
    );
}

// Pixels that the triangle may cover: the first, and one past the last.
ivec4 pixels_of(Small small) {
    ivec2 low = min(min(small.second, small.third), ivec2(0)) + small.origin;
    ivec2 high = max(max(small.second, small.third), ivec2(0)) + small.origin;
    // Center of pixel i: 256 i + 128 >= low  <=>  i >= (low + 127) >> 8; at most high  <=>  i <= (high - 128) >> 8.
    return ivec4(
        max((low + 127) >> 8, ivec2(list.rect_px.xy)),
        min(((high - 128) >> 8) + 1, ivec2(list.rect_px.zw))
    );
}

// Depth where the edge functions have these values; the same bits in every pass, so that nothing is behind itself.
float depth_at(Small small, ivec3 e) {
    precise vec3 weight = vec3(e) / float(small.area);
    precise float depth = weight.x * small.depth.x + weight.y * small.depth.y + weight.z * small.depth.z;
    return clamp(depth, 0.0, 1.0);
}

// The color of triangles where primitives are told apart.
const vec3 TRIANGLE_TINT = vec3(0.2, 0.35, 1.0);

struct Surface {
    // In view space, a unit vector; zero where there is none.
    vec3 normal;
    vec3 color;
    float inverse_w;
};

// What the corners have, where the edge functions have these values.
Surface surface_at(Small small, ivec3 e) {
    vec3 w = vec3(e) / float(small.area) * small.inverse_w;
    float inverse_w = w.x + w.y + w.z;
    w /= inverse_w;
    vec3 normal_in_view = vec3(0.0);
    vec3 vertex_color = vec3(0.0);
    for (int i = 0; i < 3; ++i) {
        VertexRecord v = vertices[small.index[i]];
        vec4 rgba = unpackUnorm4x8(v.color);
        // Alpha 0 marks a vertex without normal: it leaves the others to decide.
        if (rgba.a != 0.0) {
            normal_in_view += w[i] * (mat3(frame.view_from_model) * octahedral_decode(unpackSnorm2x16(v.normal)));
        }
        vertex_color += w[i] * rgba.rgb;
    }
    float squared = dot(normal_in_view, normal_in_view);
    return Surface(squared > 0.0 ? normal_in_view * inversesqrt(squared) : vec3(0.0), vertex_color, inverse_w);
}
