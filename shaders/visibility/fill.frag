#version 460
// Pass visibility.fill: the holes of the picture from the finest level of the pyramid.
#include "common/push_level.glsl"
#include "common/resolve.glsl"

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 own = texelFetch(picked, pixel, 0);
    vec2 front = texelFetch(fronts, pixel, 0).xy;
    resolve(own, front, from_coarse(pixel, own, front));
}
