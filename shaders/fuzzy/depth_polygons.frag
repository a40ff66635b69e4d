#version 460
// Pass fuzzy.depth, splats from vertices: round where no edge cuts them.
layout(location = 0) in vec2 uv;
layout(location = 1) flat in float bound;

void main() {
    if (dot(uv, uv) > bound) {
        discard;
    }
}
