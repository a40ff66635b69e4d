#version 460
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
// Pass polygons.resolve: shades the oriented polygon that each pixel kept; its depth is tested against what the rasterizer
// drew.
#include "common/polygon_record.glsl"
#include "common/polygon_shade.glsl"
#include "common/patch_setup.glsl"
#include "common/disc_plane.glsl"

layout(set = 0, binding = 3, std430) readonly buffer Nearest {
    uint64_t nearest[];
};

// Patches of a cut by error; else splats from vertices.
layout(constant_id = 0) const bool ARE_PATCHES = false;

layout(location = 0) out vec4 shown_color;
#ifdef NORMALS
layout(location = 1) out vec4 shown_normal;
#endif

void main() {
    uint64_t key = nearest[index_of(ivec2(gl_FragCoord.xy))];
    uint item = ~uint(key) - list.first;
    if (key == 0ul || item >= list.count) {
        discard;
    }
    read_polygon(list.begin + item);
    vec3 position;
    vec3 n;
    vec3 base;
    vec3 tint;
    if (ARE_PATCHES) {
        PatchPlane own;
        PatchRectangle rectangle;
        PatchPixel pixel;
        set_up_patch(own, rectangle);
        patch_pixel(own, gl_FragCoord.xy, pixel);
        position = pixel.position;
        n = patch_normal(own, pixel.foot);
        base = patch_color(own, pixel.foot);
        tint = vec3(0.25, 0.9, 0.35);
    } else {
        DiscPixel pixel;
        disc_pixel(disc_plane(), gl_FragCoord.xy, pixel);
        position = pixel.position;
        vec3 s = shape_operator;
        vec3 own = shading_normal + dot(s.xy, pixel.uv) * axis + dot(s.yz, pixel.uv) * second_axis();
        n = mat3(frame.view_from_model) * own;
        base = clamp(color.rgb + color_slopes() * pixel.uv, vec3(0.0), vec3(1.0));
        tint = vec3(1.0, 0.2, 0.2);
    }
    n = unit_or_zero(n);
    shown_color = vec4(shade_polygon(position, n, base, light_share(), tint), 1.0);
#ifdef NORMALS
    shown_normal = vec4(n * mat3(frame.view_from_model) / frame.model_scale, 1.0);
#endif
    gl_FragDepth = uintBitsToFloat(uint(key >> 32));
}
