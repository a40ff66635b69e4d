#version 460
// A patch of a cut by error, as the ray of each pixel sees its plane. What lies in the widened margin is pushed back by the
// thickness and its distance from the footprint, so that a neighbor's own area wins.
#include "common/polygon_shade.glsl"

layout(location = 0) flat in vec4 sides_a[6];
layout(location = 6) flat in vec4 along_u;
layout(location = 7) flat in vec4 along_v;
layout(location = 8) flat in vec4 plane;
layout(location = 9) flat in vec4 limits;
layout(location = 10) flat in vec4 extent;
layout(location = 11) flat in vec4 normal_and_shape;
layout(location = 12) flat in vec4 shape_and_middle;
layout(location = 13) flat in vec4 color_a;
layout(location = 14) flat in vec4 color_b;
layout(location = 15) flat in float color_c;

layout(location = 0) out vec4 color;
#ifdef NORMALS
layout(location = 1) out vec4 normal;
#endif

void main() {
    vec3 at = vec3(gl_FragCoord.xy - shape_and_middle.zw, 1.0);
    float inside = 1e30;
    for (int i = 0; i < 2; i++) {
        vec4 a = sides_a[3 * i];
        vec4 b = sides_a[3 * i + 1];
        vec4 c = sides_a[3 * i + 2];
        inside = min(inside, min(dot(a.xyz, at), dot(vec3(a.w, b.xy), at)));
        inside = min(inside, min(dot(vec3(b.zw, c.x), at), dot(c.yzw, at)));
    }
    if (inside < -limits.z) {
        discard;
    }
    bool is_parallel = has_flag(FLAG_ORTHOGRAPHIC);
    float on_plane = dot(plane.xyz, at);
    float distance = is_parallel ? on_plane : 1.0 / on_plane;
    // Rays along the plane meet it nowhere, or behind the eye.
    distance = on_plane > 0.0 || is_parallel ? distance : limits.y;
    distance = clamp(distance, limits.x, limits.y);
    vec2 through = gl_FragCoord.xy * frame.ray_scale + frame.ray_offset;
    vec3 position = is_parallel ? vec3(through, -distance) : vec3(through, -1.0) * distance;
    vec2 foot = vec2(dot(along_u.xyz, position) - along_u.w, dot(along_v.xyz, position) - along_v.w);
    foot = clamp(foot, extent.xy, extent.zw);

    float shown = distance;
    if (inside < 0.0) {
        float unit_px = is_parallel ? frame.focal_px : frame.focal_px / distance;
        shown += plane.w - inside / unit_px;
    }
    vec2 depth = frame.clip_from_view[2].zw * -shown + frame.clip_from_view[3].zw;
    // What was pushed back stays in the picture: it may be all that covers this pixel. Nothing is seen at a depth of 0.
    gl_FragDepth = clamp(depth.x / depth.y, 1e-37, 1.0);

    vec2 bend = vec2(
        normal_and_shape.w * foot.x + shape_and_middle.x * foot.y,
        shape_and_middle.x * foot.x + shape_and_middle.y * foot.y
    );
    vec3 n = normal_and_shape.xyz + frame.model_scale * frame.model_scale * (bend.x * along_u.xyz + bend.y * along_v.xyz);
    n = unit_or_zero(n);
    vec3 base = color_a.rgb + foot.x * vec3(color_a.w, color_b.xy) + foot.y * vec3(color_b.zw, color_c);
    base = clamp(base, vec3(0.0), vec3(1.0));
    color = vec4(shade_polygon(position, n, base, limits.w, vec3(0.25, 0.9, 0.35)), 1.0);
#ifdef NORMALS
    normal = vec4(n * mat3(frame.view_from_model) / frame.model_scale, 1.0);
#endif
}
