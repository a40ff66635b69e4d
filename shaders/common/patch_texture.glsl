// The image that a patch of a cut by error shows: what `patches::texture` has of it.
#include "common/texels.glsl"

// Mirrored by `abi::PatchTexture`.
struct PatchTexture {
    float at[2];
    float along_u[2];
    float along_v[2];
    uint image;
    float slip;
};

layout(set = 0, binding = PATCHES_BINDING, std430) readonly buffer PatchTextures {
    PatchTexture patch_textures[];
};

// Change of plane coordinates to what the next pixel of a direction sees, from a place in view space; `step`: change of its ray
// at z = -1, or of its place where rays are parallel.
vec2 plane_step(PatchPlane patch_plane, vec3 place, vec3 step) {
    vec3 u = patch_plane.along_u.xyz;
    vec3 v = patch_plane.along_v.xyz;
    vec3 n = cross(u, v);
    bool is_parallel = has_flag(FLAG_ORTHOGRAPHIC);
    // Along the ray the plane is met again.
    vec3 ray = is_parallel ? vec3(0.0, 0.0, -1.0) : place / -place.z;
    vec3 way = (step - ray * (dot(n, step) / dot(n, ray))) * (is_parallel ? 1.0 : -place.z);
    return vec2(dot(u, way), dot(v, way));
}

// Color where a pixel sees the patch of a number, of the image that it is in, else its own.
vec3 textured_color(uint number, PatchPlane patch_plane, PatchPixel pixel) {
    PatchTexture own = patch_textures[number];
    vec2 along_u = vec2(own.along_u[0], own.along_u[1]);
    vec2 along_v = vec2(own.along_v[0], own.along_v[1]);
    vec2 place = vec2(own.at[0], own.at[1]) + pixel.foot.x * along_u + pixel.foot.y * along_v;
    vec2 right = plane_step(patch_plane, pixel.position, vec3(frame.ray_scale.x, 0.0, 0.0));
    vec2 down = plane_step(patch_plane, pixel.position, vec3(0.0, frame.ray_scale.y, 0.0));
    return surface_color(
        own.image, place, right.x * along_u + right.y * along_v, down.x * along_u + down.y * along_v,
        patch_color(patch_plane, pixel.foot)
    );
}
