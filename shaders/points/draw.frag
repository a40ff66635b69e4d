#version 460
// One flat color over the square of a point or splat.
layout(location = 0) flat in vec3 shade;
layout(location = 1) flat in vec3 normal_in_model;

layout(location = 0) out vec4 color;
#ifdef NORMALS
layout(location = 1) out vec4 normal;
#endif

void main() {
    color = vec4(shade, 1.0);
#ifdef NORMALS
    normal = vec4(normal_in_model, 1.0);
#endif
}
