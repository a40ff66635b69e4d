#version 460
// One deposit for every pixel of the square; the target adds them up.
layout(location = 0) flat in vec4 deposit;

layout(location = 0) out vec4 sums;

void main() {
    sums = deposit;
}
