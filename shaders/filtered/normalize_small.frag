#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass filtered.normalize where compute summed small splats: the picture from those sums, and its depth.
#include "common/small_sums.glsl"
#include "common/normalize.glsl"

layout(location = 0) out vec4 color;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float own = front_at(pixel);
    color = normalized(pixel, own);
    gl_FragDepth = own;
}
