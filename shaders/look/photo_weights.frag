#version 460
// Pass look.photo_weights: what each photograph of a group counts at each pixel; negative those of the second stage. The CPU
// mirror is src/projective/look.rs, of what a photograph sees src/projective/depth_map.rs.
#include "common/photo_surface.glsl"
#include "common/photo_texels.glsl"

// Cameras and places of the photographs of a group. Mirrored by `abi::PhotoGroup`.
layout(set = 0, binding = 7, std140) uniform PhotoGroup {
    vec4 cameras[PHOTO_VECTORS * PHOTO_GROUP];
    // Of each: the word of its depth map, its width, height, and 1 where texels have a mask; the word of its table of levels,
    // width and height of the first, and the first level that is there times 32 plus how many there are.
    uvec4 places[2u * PHOTO_GROUP];
    // Where the group lies in the image of weights, pixels; how many photographs it has.
    uvec4 spot;
} group;

vec4 camera_of(uint photo, uint row) {
    return group.cameras[PHOTO_VECTORS * photo + row];
}

uvec4 place_of(uint photo, uint row) {
    return group.places[2u * photo + row];
}

#include "common/photo_place.glsl"

layout(location = 0) out vec4 weights;

layout(constant_id = 2) const uint WEIGHT_FORM = 2u;
layout(constant_id = 3) const uint WEIGHT_DIRECTION = 2u;
layout(constant_id = 4) const uint PHOTO_VISIBILITY = 2u;
layout(constant_id = 6) const bool HAS_MASKS = false;

const uint FORM_PRINTED = 0u;
const uint FORM_QUALITY = 2u;
const uint FORM_BAKED = 3u;
const uint DIRECTION_AXIS = 0u;
const uint DIRECTION_HULL = 1u;
const uint VISIBILITY_OFF = 0u;
const uint VISIBILITY_SOFT = 2u;

const float SAME_RAY = 1e-5;
const float LEAST_AT_EDGE = 0.02;
const float RELATIVE_BIAS = 0.002;

// Part of a point in camera space that the photograph sees.
float visibility_of(uint photo, vec3 p, float facing) {
    uvec4 place = place_of(photo, 0u);
    if (place.y == 0u) {
        return 1.0;
    }
    vec4 map = camera_of(photo, 9u);
    float slope = min(sqrt(max(1.0 - facing * facing, 0.0)) / max(abs(facing), 0.05), 10.0);
    vec2 at = p.xy / p.z * map.xy + map.zw;
    if (any(isinf(at)) || any(isnan(at))) {
        return 0.0;
    }
    float texel_size = p.z / max(min(map.x, map.y), 1e-6);
    float nearest = p.z - (RELATIVE_BIAS * p.z + 2.0 * texel_size * slope);
    vec2 corner = floor(at - 0.5);
    vec2 part = at - 0.5 - corner;
    ivec2 last = ivec2(place.yz) - 1;
    ivec2 low = clamp(ivec2(clamp(corner, vec2(-2.0), vec2(65536.0))), ivec2(0), last);
    ivec2 high = clamp(ivec2(clamp(corner, vec2(-2.0), vec2(65536.0))) + 1, ivec2(0), last);
    uint upper = place.x + uint(low.y) * place.y;
    uint lower = place.x + uint(high.y) * place.y;
    uvec4 texels = uvec4(photo_texels[upper + uint(low.x)], photo_texels[upper + uint(high.x)],
                         photo_texels[lower + uint(low.x)], photo_texels[lower + uint(high.x)]);
    vec2 rest = 1.0 - part;
    vec4 shares = vec4(rest.x * rest.y, part.x * rest.y, rest.x * part.y, part.x * part.y);
    // The lowest eight bits are the distance from an edge.
    vec4 seen_depths = uintBitsToFloat(texels & uvec4(0xffffff00u));
    float seen = dot(shares, vec4(greaterThanEqual(seen_depths, vec4(nearest))));
    if (PHOTO_VISIBILITY != VISIBILITY_SOFT) {
        return seen;
    }
    // Of 255: EDGE_TEXELS.
    float t = clamp(dot(shares, vec4(texels & uvec4(255u))) / 255.0, 0.0, 1.0);
    return seen * (LEAST_AT_EDGE + (1.0 - LEAST_AT_EDGE) * t * t * (3.0 - 2.0 * t));
}

// Weight of a photograph by Princ's equation 2.8, as printed or mended.
float princ_weight(uint photo, vec3 ray, vec3 normal) {
    vec3 d = ray;
    if (WEIGHT_DIRECTION == DIRECTION_AXIS) {
        d = camera_of(photo, 2u).xyz;
    } else if (WEIGHT_DIRECTION == DIRECTION_HULL) {
        d = camera_of(photo, 6u).xyz;
    }
    float limit_cos = look.limits.x;
    float area = camera_of(photo, 3u).w;
    float towards_view = dot(look.direction.xyz, d);
    float facing = -dot(normal, d);
    if (WEIGHT_FORM == FORM_PRINTED) {
        return towards_view * ((1.0 + facing) / (1.0 - limit_cos) + 1.0) * area;
    }
    return max(towards_view, 0.0) * max((facing - limit_cos) / (1.0 - limit_cos), 0.0) * area;
}

// 1 inside of a photograph, falling to little at its border.
float border_weight(vec2 at, vec2 size) {
    vec2 inside = min(at, size - at);
    float width = look.limits.z * min(size.x, size.y);
    return width > 0.0 ? clamp(min(inside.x, inside.y) / width, 0.02, 1.0) : 1.0;
}

// Weight whose odds are a part of those of another: lessened in src/projective/look.rs.
float lessened(float weight, float part) {
    float found = weight * part;
    return found > 0.0 ? found / (found + max(1.0 - weight, 0.0)) : 0.0;
}

// What a photograph counts at a pixel; weight 0 where it does not show it.
float weight_of(uint photo, SurfacePixel surface, vec3 view_ray) {
    vec3 p = in_camera(photo, surface.position);
    vec2 at;
    vec2 size = camera_of(photo, 4u).zw;
    if (!place_anywhere(photo, p, at) || !is_inside(at, size)) {
        return 0.0;
    }
    vec3 ray = unit_of(surface.position - camera_of(photo, 3u).xyz);
    float facing = -dot(surface.normal, ray);
    vec2 next;
    float across = place_anywhere(photo, in_camera(photo, surface.position + surface.across), next) ? distance(next, at) : 1.0;
    float down = place_anywhere(photo, in_camera(photo, surface.position + surface.down), next) ? distance(next, at) : 1.0;
    float weight;
    // What lessens it.
    float part = 1.0;
    if (WEIGHT_FORM == FORM_QUALITY) {
        vec3 between = view_ray - ray;
        float same = SAME_RAY / (SAME_RAY + 0.5 * dot(between, between));
        float faces = surface.normal == vec3(0.0) ? 1.0 : smooth_step(look.limits.x, 0.6, facing);
        float texels = clamp(min(across, down), 0.05, 1.0);
        weight = same;
        part = faces * texels * border_weight(at, size);
    } else if (WEIGHT_FORM == FORM_BAKED) {
        vec2 scale = vec2(camera_of(photo, 0u).w, camera_of(photo, 1u).w) / p.z;
        weight = facing * scale.x * scale.y;
        part = border_weight(at, size);
    } else {
        weight = princ_weight(photo, ray, surface.normal);
    }
    int looks = PHOTO_VISIBILITY != VISIBILITY_OFF && weight > 0.0 ? 1 : 0;
    for (int i = 0; i < looks; ++i) {
        part *= visibility_of(photo, p, facing);
    }
    if (HAS_MASKS && place_of(photo, 0u).w != 0u) {
        uvec4 place = place_of(photo, 1u);
        part *= photo_bilinear(place.x, place.yz, place.w >> 5, at / size).a;
    }
    return WEIGHT_FORM == FORM_QUALITY ? lessened(weight, part) : max(weight * part, 0.0);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy) - ivec2(group.spot.xy);
    weights = vec4(0.0);
    float own = texelFetch(depths, pixel, 0).r;
    // A software device takes every branch, but leaves loops that no pixel needs.
    int surfaces = own > 0.0 ? 1 : 0;
    for (int i = 0; i < surfaces; ++i) {
        SurfacePixel surface = surface_of(pixel, distance_of(own));
        bool is_perspective = look.start.w != 0.0;
        vec3 view_ray = unit_of(is_perspective ? surface.position - look.start.xyz : look.towards.xyz);
        for (uint photo = 0u; photo < PHOTO_GROUP; ++photo) {
            float weight = weight_of(photo, surface, view_ray);
            bool is_there = photo < group.spot.z;
            weights[photo] = is_there ? (camera_of(photo, 5u).w == 0.0 ? weight : -weight) : 0.0;
        }
    }
}
