#version 460
// Triangles of the mesh whose corners have places in images.
#include "common/frame.glsl"
#include "common/octahedral.glsl"

// Of each vertex: its place in an image, two floats, and the image.
layout(set = 0, binding = 2, std430) readonly buffer TexturePoints {
    uint points[];
};

layout(location = 0) in vec3 position;
layout(location = 1) in vec2 normal;
layout(location = 2) in vec4 color;

layout(location = 0) out vec3 normal_in_view;
layout(location = 1) out vec3 vertex_color;
layout(location = 2) out vec2 place;
layout(location = 3) flat out uint image;

invariant gl_Position;

void main() {
    vec4 position_in_view = frame.view_from_model * vec4(position, 1.0);
    gl_Position = frame.clip_from_view * position_in_view;
    // Alpha 0 marks a vertex without normal: it leaves the others to decide.
    normal_in_view = color.a == 0.0 ? vec3(0.0) : mat3(frame.view_from_model) * octahedral_decode(normal);
    vertex_color = color.rgb;
    uint own = 3u * uint(gl_VertexIndex);
    place = uintBitsToFloat(uvec2(points[own], points[own + 1u]));
    image = points[own + 2u];
}
