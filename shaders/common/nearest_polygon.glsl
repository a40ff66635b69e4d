// Pass polygons.resolve: shades the oriented polygon that each pixel kept; its depth is tested against what the rasterizer
// drew.
#include "common/polygon_record.glsl"
#include "common/disc_look.glsl"
#include "common/patch_setup.glsl"
#include "common/disc_plane.glsl"
#ifdef HAS_TEXTURES
#define TEXELS_BINDING 4
#define PATCHES_BINDING 5
#include "common/patch_texture.glsl"
#endif

layout(set = 0, binding = 3, std430) readonly buffer Nearest {
    uint64_t nearest[];
};

// Patches of a cut by error; else splats from vertices.
layout(constant_id = 0) const bool ARE_PATCHES = false;

layout(location = 0) out vec4 shown_color;
#ifdef NORMALS
layout(location = 1) out vec4 shown_normal;
layout(location = 2) out uint shown_number;
#else
layout(location = 1) out uint shown_number;
#endif

void main() {
    uint64_t key = nearest[index_of(ivec2(gl_FragCoord.xy))];
    uint item = ~uint(key) - list.first;
    if (key == 0ul || item >= list.count) {
        discard;
    }
    read_polygon(list.begin + item);
    vec3 n;
    vec3 shown;
    if (ARE_PATCHES) {
        PatchPlane own;
        PatchRectangle rectangle;
        PatchPixel pixel;
        set_up_patch(own, rectangle);
        patch_pixel(own, gl_FragCoord.xy, pixel);
        n = unit_or_zero(patch_normal(own, pixel.foot));
#ifdef HAS_TEXTURES
        vec3 base = textured_color(list.first + item, own, pixel);
#else
        vec3 base = patch_color(own, pixel.foot);
#endif
        shown = shade_polygon(pixel.position, n, base, light_share(), vec3(0.25, 0.9, 0.35));
    } else {
        DiscPixel pixel;
        disc_pixel(disc_plane(), gl_FragCoord.xy, pixel);
        n = unit_or_zero(mat3(frame.view_from_model) * disc_normal(pixel.uv));
        shown = shade_disc(pixel.position, n, pixel.uv);
    }
    shown_color = vec4(shown, 1.0);
#ifdef NORMALS
    shown_normal = vec4(n * mat3(frame.view_from_model) / frame.model_scale, 1.0);
#endif
    gl_FragDepth = uintBitsToFloat(uint(key >> 32));
    shown_number = list.first + item + 1u;
}
