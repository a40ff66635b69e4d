#version 460
// Pass overlay: a corner of the overlay, already in clip space.
layout(location = 0) in vec2 position;
layout(location = 1) in vec2 place;
layout(location = 2) in vec4 color;

layout(location = 0) out vec2 place_in_texture;
layout(location = 1) out vec4 tint;

void main() {
    gl_Position = vec4(position, 0.0, 1.0);
    place_in_texture = place;
    tint = color;
}
