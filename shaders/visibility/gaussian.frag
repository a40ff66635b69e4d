#version 460
// Pass visibility.gaussian: every hole from the centers within the size of a splat.
#include "common/gather.glsl"

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 own = texelFetch(picked, pixel, 0);
    vec2 front = texelFetch(fronts, pixel, 0).xy;
    resolve(own, front, gather(pixel, front, is_hole(own) ? max(frame.splat_size_px, 1.0) : -1.0));
}
