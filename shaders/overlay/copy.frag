#version 460
// Pass overlay: the picture of the model, which the overlay then covers in part.
layout(set = 0, binding = 0) uniform sampler2D picture;

layout(location = 0) flat in int left;

layout(location = 0) out vec4 color;

void main() {
    color = texelFetch(picture, ivec2(gl_FragCoord.xy) - ivec2(left, 0), 0);
}
