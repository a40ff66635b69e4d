// A patch of a cut by error, as the ray of each pixel sees its plane.
#include "common/polygon_shade.glsl"
#include "common/patch_plane.glsl"
#ifdef HAS_TEXTURES
#define PATCHES_BINDING 4
#include "common/patch_texture.glsl"
#endif

// The fields of `PatchPlane`.
layout(location = 0) flat in vec4 sides[6];
layout(location = 6) flat in vec4 along_u;
layout(location = 7) flat in vec4 along_v;
layout(location = 8) flat in vec4 plane;
layout(location = 9) flat in vec4 limits;
layout(location = 10) flat in vec4 extent;
layout(location = 11) flat in vec4 normal_and_shape;
layout(location = 12) flat in vec4 shape_and_middle;
layout(location = 13) flat in vec4 color_a;
layout(location = 14) flat in vec4 color_b;
// And the number of the patch.
layout(location = 15) flat in vec2 color_c;

layout(location = 0) out vec4 color;
#ifdef NORMALS
layout(location = 1) out vec4 normal;
layout(location = 2) out uint shown_number;
#else
layout(location = 1) out uint shown_number;
#endif

void main() {
    PatchPlane own = PatchPlane(
        sides, along_u, along_v, plane, limits, extent, normal_and_shape, shape_and_middle, color_a, color_b, color_c.x
    );
    PatchPixel pixel;
    if (!patch_pixel(own, gl_FragCoord.xy, pixel)) {
        discard;
    }
    gl_FragDepth = pixel.depth;
    shown_number = uint(color_c.y) + 1u;
    vec3 n = unit_or_zero(patch_normal(own, pixel.foot));
#ifdef HAS_TEXTURES
    vec3 base = textured_color(uint(color_c.y), own, pixel);
#else
    vec3 base = patch_color(own, pixel.foot);
#endif
    color = vec4(shade_polygon(pixel.position, n, base, limits.w, vec3(0.25, 0.9, 0.35)), 1.0);
#ifdef NORMALS
    normal = vec4(n * mat3(frame.view_from_model) / frame.model_scale, 1.0);
#endif
}
