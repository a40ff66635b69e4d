#version 460
// Pass look.eye_dome: darkens pixels whose neighbors are nearer, so that depth shows without normals. Source: Boucheny,
// "Visualisation scientifique de grands volumes de donnees" (2009), section 3.4. The CPU mirror is
// src/render/cpu/eye_dome.rs.
#include "common/frame.glsl"
#include "common/distance.glsl"

layout(set = 0, binding = 1) uniform sampler2D picture;
layout(set = 0, binding = 2) uniform sampler2D depths;

layout(location = 0) out vec4 color;

const ivec2 NEIGHBORS[8] = ivec2[](ivec2(-2, 0), ivec2(2, 0), ivec2(0, -2), ivec2(0, 2),
                                   ivec2(-1, -1), ivec2(1, -1), ivec2(-1, 1), ivec2(1, 1));

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    color = texelFetch(picture, pixel, 0);
    float own = texelFetch(depths, pixel, 0).r;
    if (!(own > 0.0) || !(color.a > 0.0)) {
        return;
    }
    float level = log2(distance_of(own));
    ivec2 size = textureSize(depths, 0);
    float nearer = 0.0;
    for (int i = 0; i < 8; ++i) {
        ivec2 neighbor = pixel + NEIGHBORS[i];
        if (all(greaterThanEqual(neighbor, ivec2(0))) && all(lessThan(neighbor, size))) {
            float depth = texelFetch(depths, neighbor, 0).r;
            // Where nothing is, nothing is in front.
            nearer += depth > 0.0 ? max(level - log2(distance_of(depth)), 0.0) : 0.0;
        }
    }
    float light = exp2(-frame.eye_dome * nearer);
    // The background shows through what a pixel is not covered by, and is not darkened.
    vec3 behind = frame.background.rgb * (1.0 - color.a);
    color.rgb = behind + (color.rgb - behind) * light;
}
