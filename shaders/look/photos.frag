#version 460
// Pass look.photos: the color of each pixel's place on the surface from the photographs that weigh most there
// (look.photo_weights). It works over whatever drew the surface. The CPU mirror is src/projective/look.rs.
//
// A software device takes every branch, but leaves loops that no pixel needs: hence loops up to a number of its own.
#include "common/photo_surface.glsl"
#include "common/photo_texels.glsl"

layout(set = 0, binding = 4) uniform sampler2D weights;

// Cameras and places of all photographs. Mirrored by `abi::PhotoTable`.
layout(set = 0, binding = 7, std140) uniform PhotoTable {
    vec4 cameras[PHOTO_VECTORS * MOST_FRAME_PHOTOS];
    uvec4 places[2u * MOST_FRAME_PHOTOS];
} table;

vec4 camera_of(uint photo, uint row) {
    return table.cameras[PHOTO_VECTORS * photo + row];
}

uvec4 place_of(uint photo, uint row) {
    return table.places[2u * photo + row];
}

#include "common/photo_place.glsl"

layout(location = 0) out vec4 color;

layout(constant_id = 5) const bool HAS_CONSENSUS = true;
layout(constant_id = 7) const bool SHOWS_SOURCE = false;
layout(constant_id = 8) const bool MARKS_UNCOVERED = false;

const int CANDIDATES = 6;
const int MOST_BLENDED = 3;
const float LEAST_LEFT = 1e-3;
const float SHARPER = 0.5;
const float COARSER = 2.0;
// Candidates of less than this part of the best one's weight do not count.
const float LEAST_SHARE = 1.0 / 64.0;
// Factor of the weights of the second stage: below all of the first.
const float SECOND_STAGE = 1e-20;

// The color of a photograph at a place of 0..=1, of both nearest levels that are there.
vec3 photo_color(uint photo, vec2 at, float level) {
    uvec4 place = place_of(photo, 1u);
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

// Where a place is in a photograph, and the level whose texels are as large as pixels there, counted from the largest held.
vec3 spot_of(uint photo, SurfacePixel surface) {
    vec2 at;
    vec2 next;
    place_anywhere(photo, in_camera(photo, surface.position), at);
    float across = place_anywhere(photo, in_camera(photo, surface.position + surface.across), next) ? distance(next, at) : 1.0;
    float down = place_anywhere(photo, in_camera(photo, surface.position + surface.down), next) ? distance(next, at) : 1.0;
    vec2 size = camera_of(photo, 4u).zw;
    float held = log2(max(float(place_of(photo, 1u).y) / max(size.x, 1.0), 1e-6));
    float level = log2(max(max(across, down), 1e-6)) + held - SHARPER;
    return vec3(at / size, max(level, 0.0));
}

// The color of the nearest level alone.
vec3 coarse_color(uint photo, vec2 at, float level) {
    uvec4 place = place_of(photo, 1u);
    uint nearest = clamp(uint(level + 0.5), place.w >> 5, (place.w & 31u) - 1u);
    return photo_bilinear(place.x, place.yz, nearest, at).rgb;
}

float largest_of(vec3 v) {
    return max(max(v.x, v.y), v.z);
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
    float own = texelFetch(depths, pixel, 0).r;
    bool is_surface = own > 0.0 && color.a > 0.0;
    // The few that weigh most, those of the first stage before all others.
    float best[CANDIDATES] = float[](0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    uint photos[CANDIDATES] = uint[](0u, 0u, 0u, 0u, 0u, 0u);
    uint groups = is_surface ? (look.counts.x + PHOTO_GROUP - 1u) / PHOTO_GROUP : 0u;
    for (uint group = 0u; group < groups; ++group) {
        uvec2 spot = uvec2(group % look.counts.w, group / look.counts.w) * look.size.xy;
        vec4 four = texelFetch(weights, pixel + ivec2(spot), 0);
        for (uint i = 0u; i < PHOTO_GROUP; ++i) {
            float weight = four[i] < 0.0 ? -SECOND_STAGE * four[i] : four[i];
            uint photo = PHOTO_GROUP * group + i;
            for (int k = 0; k < CANDIDATES; ++k) {
                bool is_more = weight > best[k];
                float other = best[k];
                uint other_photo = photos[k];
                best[k] = is_more ? weight : other;
                photos[k] = is_more ? photo : other_photo;
                weight = is_more ? other : weight;
                photo = is_more ? other_photo : photo;
            }
        }
    }
    int count = 0;
    for (int i = 0; i < CANDIDATES; ++i) {
        count += best[i] > 0.0 && best[i] >= LEAST_SHARE * best[0] ? 1 : 0;
    }
    SurfacePixel surface = SurfacePixel(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0));
    int surfaces = count > 0 ? 1 : 0;
    for (int i = 0; i < surfaces; ++i) {
        surface = surface_of(pixel, distance_of(max(own, 1e-9)));
    }
    vec3 spots[CANDIDATES];
    for (int i = 0; i < count; ++i) {
        spots[i] = spot_of(photos[i], surface);
    }
    if (HAS_CONSENSUS) {
        // Each weight times the share of the others that show the same.
        int compared = count > 2 ? count : 0;
        vec3 colors[CANDIDATES];
        float agreed[CANDIDATES];
        for (int i = 0; i < compared; ++i) {
            colors[i] = coarse_color(photos[i], spots[i].xy, spots[i].z + COARSER) * camera_of(photos[i], 5u).xyz;
        }
        float tolerance = look.limits.y;
        for (int i = 0; i < compared; ++i) {
            float same = 0.0;
            float all_weights = 0.0;
            for (int j = 0; j < compared; ++j) {
                float apart = largest_of(abs(colors[i] - colors[j]));
                same += best[j] * (1.0 - smooth_step(tolerance, 2.5 * tolerance, apart));
                all_weights += best[j];
            }
            agreed[i] = best[i] * (same / all_weights);
        }
        // Sorted again, stable.
        for (int i = 1; i < compared; ++i) {
            float weight = agreed[i];
            uint photo = photos[i];
            vec3 spot = spots[i];
            int at = i;
            for (; at > 0 && agreed[max(at - 1, 0)] < weight; --at) {
                agreed[at] = agreed[at - 1];
                photos[at] = photos[at - 1];
                spots[at] = spots[at - 1];
            }
            agreed[at] = weight;
            photos[at] = photo;
            spots[at] = spot;
        }
        for (int i = 0; i < compared; ++i) {
            best[i] = agreed[i];
        }
    }
    int most = clamp(int(look.counts.y), 1, MOST_BLENDED);
    int blended = SHOWS_SOURCE ? 0 : min(count, most);
    // What the first that is left out weighs is taken off all, so that none comes or goes at a step.
    float left_out = max(count > most ? best[most] : 0.0, LEAST_SHARE * best[0]) * (1.0 - LEAST_LEFT);
    vec3 sum = vec3(0.0);
    float all_weights = 0.0;
    for (int i = 0; i < blended; ++i) {
        float part = max((best[i] - left_out) / (best[0] - left_out), 0.0);
        sum += photo_color(photos[i], spots[i].xy, spots[i].z) * camera_of(photos[i], 5u).xyz * part;
        all_weights += part;
    }
    vec3 found = SHOWS_SOURCE ? camera_of(photos[0], 10u).xyz : clamp(sum / max(all_weights, 1e-20), 0.0, 1.0);
    // The background shows through what a pixel is not covered by.
    vec3 behind = frame.background.rgb * (1.0 - color.a);
    if (count > 0) {
        color.rgb = behind + found * color.a;
    } else if (MARKS_UNCOVERED && is_surface) {
        color.rgb = behind + vec3(1.0, 0.0, 1.0) * color.a;
    }
    vec3 laid_over;
    int columns = gl_FragCoord.x < look.limits.w ? 1 : 0;
    for (int i = 0; i < columns; ++i) {
        if (compared_color(gl_FragCoord.xy, laid_over)) {
            color = vec4(laid_over, 1.0);
        }
    }
}
