#version 460
// Pass overdraw.count, triangles and squares: each adds one to every pixel that it covers.

layout(location = 0) out float count;

void main() {
    count = 1.0;
}
