#version 460
// One triangle that covers the target. Its first vertex is three times the column where the picture begins.
layout(location = 0) flat out int left;

void main() {
    int index = gl_VertexIndex % 3;
    left = gl_VertexIndex / 3;
    vec2 corner = vec2((index << 1) & 2, index & 2);
    gl_Position = vec4(corner * 2.0 - 1.0, 0.0, 1.0);
}
