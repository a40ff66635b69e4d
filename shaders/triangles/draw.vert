#version 460
// Triangles of the mesh: Gouraud-interpolated normals, shaded per pixel.
#include "common/frame.glsl"
#include "common/octahedral.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec2 normal;
layout(location = 2) in vec4 color;

layout(location = 0) out vec3 normal_in_view;
layout(location = 1) out vec4 vertex_color;

invariant gl_Position;

void main() {
    vec4 position_in_view = frame.view_from_model * vec4(position, 1.0);
    gl_Position = frame.clip_from_view * position_in_view;
    normal_in_view = mat3(frame.view_from_model) * octahedral_decode(normal);
    vertex_color = color;
}
