#version 460
// Pass look.photos: the color of each pixel's place on the surface from the photographs that were chosen for the frame. It
// works over whatever drew the surface. The CPU mirror is src/projective/look.rs; places are found as in
// src/projective/surface_rays.rs, what a photograph sees as in src/projective/depth_map.rs.
#include "common/frame.glsl"
#include "common/distance.glsl"
#include "common/photo_record.glsl"

layout(set = 0, binding = 1) uniform sampler2D picture;
layout(set = 0, binding = 2) uniform sampler2D depths;
// That of colors again where there are no normals.
layout(set = 0, binding = 3) uniform sampler2D normals;

layout(location = 0) out vec4 color;

layout(constant_id = 1) const bool HAS_SURFACE_NORMALS = false;
layout(constant_id = 2) const uint WEIGHT_FORM = 2u;
layout(constant_id = 3) const uint WEIGHT_DIRECTION = 2u;
layout(constant_id = 4) const uint PHOTO_VISIBILITY = 2u;
layout(constant_id = 5) const bool HAS_CONSENSUS = true;
layout(constant_id = 6) const bool HAS_MASKS = false;
layout(constant_id = 7) const bool SHOWS_SOURCE = false;
layout(constant_id = 8) const bool MARKS_UNCOVERED = false;

const uint FORM_PRINTED = 0u;
const uint FORM_QUALITY = 2u;
const uint DIRECTION_AXIS = 0u;
const uint DIRECTION_HULL = 1u;
const uint VISIBILITY_OFF = 0u;
const uint VISIBILITY_SOFT = 2u;

const int CANDIDATES = 6;
const float SAME_RAY = 1e-4;
const float SHARPER = 0.5;
const float COARSER = 2.0;
const float LONGEST_STEP = 8.0;
const float EDGE_TEXELS = 4.0;
const float LEAST_AT_EDGE = 0.02;
const float RELATIVE_BIAS = 0.002;

// A pixel's place on the surface, in model space.
struct SurfacePixel {
    vec3 position;
    vec3 normal;
    vec3 across;
    vec3 down;
};

// A photograph's weight at a pixel, and where the pixel is in it.
struct Candidate {
    float weight;
    float level;
    vec2 pixel;
    uint photo;
};

float smooth_step(float from, float to, float value) {
    float t = clamp((value - from) / (to - from), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

vec3 unit_of(vec3 v) {
    float squared = dot(v, v);
    return squared > 0.0 ? v * inversesqrt(squared) : vec3(0.0);
}

void ray_of(vec2 at, out vec3 start, out vec3 towards) {
    vec3 moved = at.x * look.right.xyz + at.y * look.down.xyz;
    bool is_perspective = look.start.w != 0.0;
    start = look.start.xyz + (is_perspective ? vec3(0.0) : moved);
    towards = look.towards.xyz + (is_perspective ? moved : vec3(0.0));
}

vec3 point_of(vec2 at, float depth) {
    vec3 start, towards;
    ray_of(at, start, towards);
    return start + depth * towards;
}

// From a neighbor to the pixel or from the pixel to the one on the other side, whichever is nearer in depth.
vec3 side_of(ivec2 pixel, ivec2 offset, float depth, vec3 position) {
    ivec2 size = textureSize(depths, 0);
    ivec2 before_px = pixel - offset;
    ivec2 after_px = pixel + offset;
    float before = all(greaterThanEqual(before_px, ivec2(0))) ? texelFetch(depths, before_px, 0).r : 0.0;
    float after = all(lessThan(after_px, size)) ? texelFetch(depths, after_px, 0).r : 0.0;
    float near_before = before > 0.0 ? distance_of(before) : 0.0;
    float near_after = after > 0.0 ? distance_of(after) : 0.0;
    bool is_nearer = abs(near_before - depth) < abs(near_after - depth);
    if (before > 0.0 && (!(after > 0.0) || is_nearer)) {
        return position - point_of(vec2(before_px) + 0.5, near_before);
    }
    if (after > 0.0) {
        return point_of(vec2(after_px) + 0.5, near_after) - position;
    }
    return vec3(0.0);
}

// To where the ray of a neighbor meets the plane of the pixel.
vec3 step_of(vec2 at, vec3 position, vec3 normal, float depth) {
    vec3 start, towards;
    ray_of(at, start, towards);
    vec3 flat_step = start + depth * towards - position;
    float facing = dot(normal, towards);
    if (facing > -1e-6) {
        return flat_step;
    }
    vec3 along = start + towards * (dot(normal, position - start) / facing) - position;
    float longest = LONGEST_STEP * length(flat_step);
    float own = length(along);
    return own > longest ? along * (longest / own) : along;
}

SurfacePixel surface_of(ivec2 pixel, float depth) {
    vec2 at = vec2(pixel) + 0.5;
    vec3 start, towards;
    ray_of(at, start, towards);
    vec3 position = start + depth * towards;
    vec3 normal;
    if (HAS_SURFACE_NORMALS) {
        normal = texelFetch(normals, pixel, 0).xyz;
    } else {
        vec3 across = side_of(pixel, ivec2(1, 0), depth, position);
        vec3 down = side_of(pixel, ivec2(0, 1), depth, position);
        normal = unit_of(cross(across, down));
    }
    normal = dot(normal, towards) > 0.0 ? -normal : normal;
    vec3 right_step = step_of(at + vec2(1.0, 0.0), position, normal, depth);
    vec3 down_step = step_of(at + vec2(0.0, 1.0), position, normal, depth);
    return SurfacePixel(position, normal, right_step, down_step);
}

// Part of a point in camera space that the photograph sees.
float visibility_of(uint photo, vec3 p, float facing) {
    uvec4 place = look.places[2u * photo];
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

bool is_inside(vec2 at, vec2 size) {
    return all(greaterThanEqual(at, vec2(0.0))) && all(lessThan(at, size));
}

// What a photograph counts at a pixel; weight 0 where it does not show it.
Candidate candidate_of(uint photo, SurfacePixel surface, vec3 view_ray) {
    Candidate none = Candidate(0.0, 0.0, vec2(0.0), photo);
    vec3 p = in_camera(photo, surface.position);
    vec2 at;
    vec2 size = camera_of(photo, 4u).zw;
    if (!place_anywhere(photo, p, at) || !is_inside(at, size)) {
        return none;
    }
    vec3 ray = unit_of(surface.position - camera_of(photo, 3u).xyz);
    float facing = -dot(surface.normal, ray);
    vec2 next;
    float across = place_anywhere(photo, in_camera(photo, surface.position + surface.across), next) ? distance(next, at) : 1.0;
    float down = place_anywhere(photo, in_camera(photo, surface.position + surface.down), next) ? distance(next, at) : 1.0;
    float weight;
    if (WEIGHT_FORM == FORM_QUALITY) {
        float apart = max(1.0 - dot(view_ray, ray), 0.0);
        float same = SAME_RAY / (SAME_RAY + apart);
        float faces = surface.normal == vec3(0.0) ? 1.0 : smooth_step(look.limits.x, 0.6, facing);
        float texels = clamp(min(across, down), 0.05, 1.0);
        vec2 inside = min(at, size - at);
        float width = look.limits.z * min(size.x, size.y);
        float border = width > 0.0 ? clamp(min(inside.x, inside.y) / width, 0.02, 1.0) : 1.0;
        weight = same * faces * texels * border;
    } else {
        weight = princ_weight(photo, ray, surface.normal);
    }
    if (!(weight > 0.0)) {
        return none;
    }
    if (PHOTO_VISIBILITY != VISIBILITY_OFF) {
        weight *= visibility_of(photo, p, facing);
    }
    if (HAS_MASKS && look.places[2u * photo].w != 0u) {
        uvec4 place = look.places[2u * photo + 1u];
        weight *= photo_bilinear(place.x, place.yz, place.w >> 5, at / size).a;
    }
    return Candidate(weight, log2(max(max(across, down), 1e-6)), at, photo);
}

// Color of a candidate, so many levels above the one that fits.
vec3 color_of(Candidate candidate, float coarser) {
    vec2 size = camera_of(candidate.photo, 4u).zw;
    float held = log2(max(float(look.places[2u * candidate.photo + 1u].y) / max(size.x, 1.0), 1e-6));
    float level = max(candidate.level + held - SHARPER, 0.0) + coarser;
    return photo_color(candidate.photo, candidate.pixel / size, level) * camera_of(candidate.photo, 5u).xyz;
}

float largest_of(vec3 v) {
    return max(max(v.x, v.y), v.z);
}

// Puts a candidate among the best few, behind those that weigh as much.
void insert(inout Candidate best[CANDIDATES], Candidate found) {
    for (int i = 0; i < CANDIDATES; ++i) {
        if (found.weight > best[i].weight) {
            Candidate other = best[i];
            best[i] = found;
            found = other;
        }
    }
}

// Multiplies each weight by the share of the others that show the same, and sorts again.
void agree(inout Candidate best[CANDIDATES]) {
    vec3 colors[CANDIDATES];
    for (int i = 0; i < CANDIDATES; ++i) {
        colors[i] = best[i].weight > 0.0 ? color_of(best[i], COARSER) : vec3(0.0);
    }
    Candidate sorted[CANDIDATES];
    float tolerance = look.limits.y;
    for (int i = 0; i < CANDIDATES; ++i) {
        sorted[i] = Candidate(0.0, 0.0, vec2(0.0), 0u);
    }
    for (int i = 0; i < CANDIDATES; ++i) {
        float same = 0.0;
        float all_weights = 0.0;
        for (int j = 0; j < CANDIDATES; ++j) {
            float apart = largest_of(abs(colors[i] - colors[j]));
            same += best[j].weight * (1.0 - smooth_step(tolerance, 2.5 * tolerance, apart));
            all_weights += best[j].weight;
        }
        Candidate own = best[i];
        own.weight = own.weight > 0.0 ? own.weight * (same / all_weights) : 0.0;
        insert(sorted, own);
    }
    best = sorted;
}

// The color of the best of some candidates, or of those that agree with it.
vec3 mixed(Candidate best[CANDIDATES]) {
    vec3 chosen = color_of(best[0], 0.0);
    vec3 sum = chosen * best[0].weight;
    float weights = best[0].weight;
    float tolerance = look.limits.y;
    for (int i = 1; i < 3; ++i) {
        if (uint(i) < look.counts.y && best[i].weight > 0.0) {
            vec3 other = color_of(best[i], 0.0);
            float apart = largest_of(abs(other - chosen));
            float weight = best[i].weight * (1.0 - smooth_step(tolerance, 2.0 * tolerance, apart));
            sum += other * weight;
            weights += weight;
        }
    }
    return clamp(sum / max(weights, 1e-20), 0.0, 1.0);
}

// The photograph that is laid over the picture; false where it does not reach.
bool compared_color(vec2 at, out vec3 found) {
    uint photo = look.counts.z;
    vec3 start, towards;
    ray_of(at, start, towards);
    vec2 pixel;
    vec2 size = camera_of(photo, 4u).zw;
    vec3 p = vec3(dot(camera_of(photo, 0u).xyz, towards), dot(camera_of(photo, 1u).xyz, towards),
                  dot(camera_of(photo, 2u).xyz, towards));
    found = vec3(0.0);
    if (!place_anywhere(photo, p, pixel) || !is_inside(pixel, size)) {
        return false;
    }
    found = photo_color(photo, pixel / size, 0.0);
    return true;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    color = texelFetch(picture, pixel, 0);
    vec3 laid_over;
    if (gl_FragCoord.x < look.limits.w && compared_color(gl_FragCoord.xy, laid_over)) {
        color = vec4(laid_over, 1.0);
        return;
    }
    float own = texelFetch(depths, pixel, 0).r;
    if (!(own > 0.0) || !(color.a > 0.0)) {
        return;
    }
    SurfacePixel surface = surface_of(pixel, distance_of(own));
    bool is_perspective = look.start.w != 0.0;
    vec3 view_ray = unit_of(is_perspective ? surface.position - look.start.xyz : look.towards.xyz);
    Candidate best[CANDIDATES];
    for (int i = 0; i < CANDIDATES; ++i) {
        best[i] = Candidate(0.0, 0.0, vec2(0.0), 0u);
    }
    for (uint photo = 0u; photo < look.counts.x; ++photo) {
        if (camera_of(photo, 5u).w == 0.0) {
            insert(best, candidate_of(photo, surface, view_ray));
        }
    }
    if (look.counts.w != 0u && !(best[0].weight > 0.0)) {
        for (uint photo = 0u; photo < look.counts.x; ++photo) {
            if (camera_of(photo, 5u).w != 0.0) {
                insert(best, candidate_of(photo, surface, view_ray));
            }
        }
    }
    // The background shows through what a pixel is not covered by.
    vec3 behind = frame.background.rgb * (1.0 - color.a);
    if (!(best[0].weight > 0.0)) {
        if (MARKS_UNCOVERED) {
            color.rgb = behind + vec3(1.0, 0.0, 1.0) * color.a;
        }
        return;
    }
    if (HAS_CONSENSUS && best[2].weight > 0.0) {
        agree(best);
    }
    vec3 found = SHOWS_SOURCE ? camera_of(best[0].photo, 10u).xyz : mixed(best);
    color.rgb = behind + found * color.a;
}
