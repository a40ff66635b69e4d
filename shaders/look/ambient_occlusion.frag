#version 460
// Pass look.ambient_occlusion: darkens pixels by how much of their sky the surface around them hides. Source and rule:
// src/render/reference/ambient_occlusion.rs. The CPU mirror is src/render/cpu/ambient_occlusion.rs.
#include "common/frame.glsl"

layout(set = 0, binding = 1) uniform sampler2D picture;
layout(set = 0, binding = 2) uniform sampler2D depths;

layout(location = 0) out vec4 color;

// Lines through a pixel: columns and rows of a step to one side, and the parts of the radius at which they are looked at.
const ivec2 STEPS[8] = ivec2[](ivec2(1, 0), ivec2(2, 1), ivec2(1, 1), ivec2(1, 2),
                               ivec2(0, 1), ivec2(-1, 2), ivec2(-1, 1), ivec2(-2, 1));
const vec3 PARTS[4] = vec3[](vec3(0.2, 0.55, 1.0), vec3(0.25, 0.6, 0.95),
                             vec3(0.15, 0.45, 0.85), vec3(0.3, 0.65, 1.0));

// Steepest rise that is told from others.
const float STEEPEST = 1e3;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    color = texelFetch(picture, pixel, 0);
    float own = texelFetch(depths, pixel, 0).r;
    if (!(own > 0.0) || !(color.a > 0.0)) {
        return;
    }
    ivec2 size = textureSize(depths, 0);
    float p22 = frame.clip_from_view[2][2];
    // Depth is affine in what is linear along a plane: a rise is a difference of depths times this, over pixels.
    float factor = frame.focal_px / ((frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? p22 : own + p22);
    // Pixels at the distance of the surface.
    float per_unit = (frame.flags & FLAG_ORTHOGRAPHIC) != 0u ? 1.0 : (own + p22) / frame.clip_from_view[3][2];
    float slack = frame.ambient_occlusion_slack * frame.focal_px * per_unit;
    float radius = frame.ambient_occlusion_px;
    float hidden = 0.0;
    for (int line = 0; line < 8; ++line) {
        float step_px = length(vec2(STEPS[line]));
        vec2 steepest = vec2(-STEEPEST);
        for (int part = 0; part < 3; ++part) {
            float steps = max(floor(PARTS[line & 3][part] * radius * (1.0 / step_px) + 0.5), 1.0);
            float away_px = steps * step_px;
            ivec2 offset = int(steps) * STEPS[line];
            for (int side = 0; side < 2; ++side) {
                ivec2 neighbor = side == 0 ? pixel + offset : pixel - offset;
                if (any(lessThan(neighbor, ivec2(0))) || any(greaterThanEqual(neighbor, size))) {
                    continue;
                }
                float depth = texelFetch(depths, neighbor, 0).r;
                // Where nothing is, nothing hides.
                if (depth > 0.0) {
                    float rise = (factor * (depth - own) - slack) / away_px;
                    rise *= clamp(2.0 - rise * away_px / radius, 0.0, 1.0);
                    steepest[side] = max(steepest[side], min(rise, STEEPEST));
                }
            }
        }
        float both = steepest.x + steepest.y;
        if (both > 0.0) {
            hidden += atan(both, 1.0 - steepest.x * steepest.y);
        }
    }
    float openness = clamp(1.0 - hidden / (8.0 * 3.14159265), 1e-6, 1.0);
    float light = pow(openness, frame.ambient_occlusion);
    // The background shows through what a pixel is not covered by, and is not darkened.
    vec3 behind = frame.background.rgb * (1.0 - color.a);
    color.rgb = behind + (color.rgb - behind) * light;
}
