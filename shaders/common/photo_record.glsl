// Photographs of a frame: what the pass over the picture knows of them, and how a point falls into one. The CPU mirror is
// src/projective/projected.rs, of lenses src/projective/lens.rs. Mirrored by `abi::PhotoConstants`.
#include "common/constants.glsl"

layout(set = 0, binding = 4, std430) readonly buffer PhotoTexels {
    uint photo_texels[];
};

layout(set = 0, binding = 5, std140) uniform PhotoConstants {
    // Start of the ray of position (0, 0) in model space; 1 where all rays start there.
    vec4 start;
    // Its direction, which has component 1 along the view direction.
    vec4 towards;
    // Change of the direction (of the start, of a parallel view) for a pixel to the right, and down.
    vec4 right;
    vec4 down;
    // Direction that photographs are chosen for; nothing.
    vec4 direction;
    // Cosine of the largest angle between normal and photograph; tolerance of colors; border; column up to which a photograph
    // is laid over the picture.
    vec4 limits;
    // Photographs; those blended at most; the one that is laid over; 1 where some are of the second stage.
    uvec4 counts;
    // Of each photograph: rows of its rotation with focal lengths and least depth; center and area; principal point and size;
    // gain and stage; direction and largest radius; coefficients of its lens (two); focal lengths and principal point of its
    // depth map; tint and lens.
    vec4 cameras[PHOTO_VECTORS * MOST_FRAME_PHOTOS];
    // Of each: the word of its depth map, its width, height, and 1 where texels have a mask; the word of its table of levels,
    // width and height of the first, and the first level that is there times 32 plus how many there are.
    uvec4 places[2u * MOST_FRAME_PHOTOS];
} look;

layout(constant_id = 0) const bool HAS_LENSES = false;

const uint LENS_PINHOLE = 0u;
const uint LENS_BROWN = 1u;
const uint LENS_RATIONAL = 2u;
const uint LENS_FISHEYE = 3u;

vec4 camera_of(uint photo, uint row) {
    return look.cameras[PHOTO_VECTORS * photo + row];
}

// A point in the space of a photograph's camera.
vec3 in_camera(uint photo, vec3 position) {
    vec3 p = position - camera_of(photo, 3u).xyz;
    return vec3(dot(camera_of(photo, 0u).xyz, p), dot(camera_of(photo, 1u).xyz, p), dot(camera_of(photo, 2u).xyz, p));
}

// r' / r of r = r' (1 + k r'^2), by Newton's method.
float measured_factor(float k, float r2) {
    float s = 1.0;
    for (int i = 0; i < 8; ++i) {
        s -= (s + k * r2 * s * s * s - 1.0) / (1.0 + 3.0 * k * r2 * s * s);
    }
    return s;
}

// The ray as the lens bends it; false beyond the lens.
bool bend(uint photo, inout vec2 ray) {
    uint lens = uint(camera_of(photo, 10u).w);
    if (lens == LENS_PINHOLE) {
        return true;
    }
    float r2 = dot(ray, ray);
    float largest = camera_of(photo, 6u).w;
    vec4 k = camera_of(photo, 7u);
    vec4 l = camera_of(photo, 8u);
    if (!(r2 <= largest * largest)) {
        return false;
    }
    float factor = 1.0;
    vec2 p = vec2(0.0);
    if (lens == LENS_BROWN) {
        factor = 1.0 + r2 * (k.x + r2 * (k.y + r2 * (l.x + r2 * l.y)));
        p = k.zw;
    } else if (lens == LENS_RATIONAL) {
        factor = (1.0 + r2 * (k.x + r2 * (k.y + r2 * l.x))) / (1.0 + r2 * (l.y + r2 * (l.z + r2 * l.w)));
        p = k.zw;
    } else if (lens == LENS_FISHEYE) {
        float r = sqrt(r2);
        float t = atan(r);
        float t2 = t * t;
        float bent = t * (1.0 + t2 * (k.x + t2 * (k.y + t2 * (k.z + t2 * k.w))));
        factor = r > 1e-9 ? bent / r : 1.0;
    } else {
        factor = measured_factor(k.x, r2);
    }
    float xy = 2.0 * ray.x * ray.y;
    ray = ray * factor + vec2(p.x * xy + p.y * (r2 + 2.0 * ray.x * ray.x), p.y * xy + p.x * (r2 + 2.0 * ray.y * ray.y));
    return true;
}

// The pixel of a point in camera space, also outside of the photograph; false behind the camera and beyond its lens.
bool place_anywhere(uint photo, vec3 p, out vec2 pixel) {
    pixel = vec2(0.0);
    if (!(p.z > camera_of(photo, 2u).w)) {
        return false;
    }
    vec2 ray = p.xy / p.z;
    if (HAS_LENSES && !bend(photo, ray)) {
        return false;
    }
    vec2 focal = vec2(camera_of(photo, 0u).w, camera_of(photo, 1u).w);
    pixel = ray * focal + camera_of(photo, 4u).xy;
    return true;
}

// The four texels around a place of a level, bilinear; clamped at the border.
vec4 photo_bilinear(uint table, uvec2 size, uint level, vec2 at) {
    uvec2 count = (size + (1u << level) - 1u) >> level;
    vec2 place = at * vec2(count) - 0.5;
    vec2 corner = floor(place);
    vec2 part = place - corner;
    ivec2 last = ivec2(count) - 1;
    ivec2 low = clamp(ivec2(corner), ivec2(0), last);
    ivec2 high = clamp(ivec2(corner) + 1, ivec2(0), last);
    uint first = table + photo_texels[table + level];
    uint upper = first + uint(low.y) * count.x;
    uint lower = first + uint(high.y) * count.x;
    vec4 a = unpackUnorm4x8(photo_texels[upper + uint(low.x)]);
    vec4 b = unpackUnorm4x8(photo_texels[upper + uint(high.x)]);
    vec4 c = unpackUnorm4x8(photo_texels[lower + uint(low.x)]);
    vec4 d = unpackUnorm4x8(photo_texels[lower + uint(high.x)]);
    return mix(mix(a, b, part.x), mix(c, d, part.x), part.y);
}

// The color of a photograph at a place of 0..=1, of both nearest levels that are there.
vec3 photo_color(uint photo, vec2 at, float level) {
    uvec4 place = look.places[2u * photo + 1u];
    uint first = place.w >> 5;
    uint last = (place.w & 31u) - 1u;
    level = clamp(level, float(first), float(last));
    uint fine = uint(level);
    float part = level - float(fine);
    vec3 color = photo_bilinear(place.x, place.yz, fine, at).rgb;
    if (part > 0.0) {
        color = mix(color, photo_bilinear(place.x, place.yz, min(fine + 1u, last), at).rgb, part);
    }
    return color;
}
