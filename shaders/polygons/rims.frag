#version 460
// Pass polygons.rims: pixels at the rims of patches show how much of them is covered. The rules are those of
// src/render/reference/rims.rs.
#include "common/polygon_record.glsl"
#include "common/patch_setup.glsl"

layout(set = 0, binding = 3) uniform sampler2D picture;
layout(set = 0, binding = 4) uniform sampler2D depths;
// Numbers of patches, from 1; 0: none.
layout(set = 0, binding = 5) uniform usampler2D numbers;

layout(location = 0) out vec4 covered_color;

const int SAMPLES = 16;

// Sixteenths of a pixel.
const vec2 STEPS[SAMPLES] = vec2[](
    vec2(9, 9), vec2(7, 5), vec2(5, 10), vec2(12, 7), vec2(3, 6), vec2(10, 13), vec2(13, 11), vec2(11, 3),
    vec2(6, 14), vec2(8, 1), vec2(4, 2), vec2(2, 12), vec2(0, 8), vec2(15, 4), vec2(14, 15), vec2(1, 0)
);

// The first that shows a patch lends its color.
const ivec2 AROUND[9] = ivec2[](
    ivec2(0, 0), ivec2(-1, 0), ivec2(1, 0), ivec2(0, -1), ivec2(0, 1), ivec2(-1, -1), ivec2(1, -1), ivec2(-1, 1), ivec2(1, 1)
);

float depth_at(ivec2 pixel) {
    return texelFetch(depths, pixel, 0).r;
}

// Number of the patch that a pixel shows; 0: none, or one that is not bound.
uint number_at(ivec2 pixel) {
    uint number = texelFetch(numbers, pixel, 0).r;
    return number > list.count ? 0u : number;
}

bool is_in_picture(ivec2 pixel) {
    return all(greaterThanEqual(pixel, ivec2(list.rect_px.xy))) && all(lessThan(pixel, ivec2(list.rect_px.zw)));
}

// Whether depths along a step, from one side of a pixel to the other, do not go on straight.
bool is_broken(ivec2 pixel, ivec2 step, float own) {
    if (!is_in_picture(pixel - step) || !is_in_picture(pixel + step)) {
        return false;
    }
    float bend = depth_at(pixel - step) + depth_at(pixel + step) - 2.0 * own;
    float per_px = 2.0 * RIM_STRAIGHT_PX / frame.focal_px;
    float at_depth = has_flag(FLAG_ORTHOGRAPHIC) ? abs(frame.clip_from_view[2][2]) : own + frame.clip_from_view[2][2];
    return abs(bend) > at_depth * per_px;
}

// Distance inside of a side (x, y and constant; inside positive), pixels, if it faces outward.
float inside_of(vec3 side, vec3 at, vec2 outward) {
    return dot(side.xy, outward) < -OUTWARD_COSINE ? dot(side, at) : 1e30;
}

// Whether a patch covers a place if only what faces outward bounds it.
bool is_covered(PatchPlane patch_plane, PatchRectangle rectangle, vec2 window, vec2 outward, out PatchPixel seen) {
    vec3 at = vec3(window - patch_plane.shape_and_middle.zw, 1.0);
    float inside = 1e30;
    for (int i = 0; i < 2; i++) {
        vec4 a = patch_plane.sides[3 * i];
        vec4 b = patch_plane.sides[3 * i + 1];
        vec4 c = patch_plane.sides[3 * i + 2];
        inside = min(inside, min(inside_of(a.xyz, at, outward), inside_of(vec3(a.w, b.xy), at, outward)));
        inside = min(inside, min(inside_of(vec3(b.zw, c.x), at, outward), inside_of(c.yzw, at, outward)));
    }
    vec2 along = rectangle.direction;
    vec2 across = vec2(-along.y, along.x);
    inside = min(inside, inside_of(vec3(along, -rectangle.ends.x), at, outward));
    inside = min(inside, inside_of(vec3(-along, rectangle.ends.y), at, outward));
    inside = min(inside, inside_of(vec3(across, -rectangle.across.x), at, outward));
    inside = min(inside, inside_of(vec3(-across, rectangle.across.y), at, outward));
    patch_pixel_of(patch_plane, window, inside, seen);
    return inside >= -RIM_MARGIN * patch_plane.limits.z;
}

// Direction in which depths fall around a pixel; zero where they fall to several sides, by more than half.
vec2 outward_of(ivec2 pixel, float own) {
    vec2 sum = vec2(0.0);
    float all = 0.0;
    for (int k = 1; k < 9; k++) {
        ivec2 beside = pixel + AROUND[k];
        if (is_in_picture(beside)) {
            vec2 step = vec2(AROUND[k]);
            float fall = own - depth_at(beside);
            sum += step * (fall / dot(step, step));
            all += abs(fall) * inversesqrt(dot(step, step));
        }
    }
    bool is_one_way = dot(sum, sum) >= 0.25 * all * all && all > 0.0;
    return is_one_way ? normalize(sum) : vec2(0.0);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 own_color = texelFetch(picture, pixel, 0);
    covered_color = own_color;
    float own_depth = depth_at(pixel);
    if (list.count == 0u || !is_broken(pixel, ivec2(1, 0), own_depth) && !is_broken(pixel, ivec2(0, 1), own_depth)) {
        return;
    }
    uint own = number_at(pixel);
    float front[SAMPLES];
    // Place around the pixel of what each sample shows; negative: what is behind all patches.
    int shown[SAMPLES];
    for (int i = 0; i < SAMPLES; i++) {
        front[i] = own == 0u ? own_depth : 0.0;
        shown[i] = -1;
    }
    vec2 outward = outward_of(pixel, own_depth);
    bool is_one_way = outward != vec2(0.0);
    uint around[9];
    // Colors and number of the pixels that show no patch.
    vec4 others = vec4(0.0);
    float other_count = 0.0;
    bool has_patches = false;
    for (int k = 0; k < 9; k++) {
        ivec2 beside = pixel + AROUND[k];
        around[k] = 0u;
        if (!is_in_picture(beside)) {
            continue;
        }
        uint number = number_at(beside);
        if (number == 0u) {
            others += texelFetch(picture, beside, 0);
            other_count += 1.0;
            continue;
        }
        around[k] = number;
        bool is_known = false;
        for (int j = 0; j < k; j++) {
            is_known = is_known || around[j] == number;
        }
        if (is_known) {
            continue;
        }
        has_patches = true;
        read_polygon(list.begin + number - 1u);
        PatchPlane plane;
        PatchRectangle rectangle;
        set_up_patch(plane, rectangle);
        for (int i = 0; i < SAMPLES; i++) {
            vec2 at = vec2(pixel) + (STEPS[i] + 0.5) / 16.0;
            PatchPixel seen;
            bool covers = is_one_way
                ? is_covered(plane, rectangle, at, outward, seen)
                : patch_pixel(plane, at, seen) && is_in_rectangle(plane, rectangle, at);
            if (covers && seen.depth > front[i]) {
                front[i] = seen.depth;
                shown[i] = k;
            }
        }
    }
    if (!has_patches) {
        return;
    }
    vec4 behind = own == 0u ? own_color : others / max(other_count, 1.0);
    float behind_weight = own == 0u || other_count > 0.0 ? 1.0 : 0.0;
    vec4 sum = vec4(0.0);
    float count = 0.0;
    for (int i = 0; i < SAMPLES; i++) {
        bool is_patch = shown[i] >= 0;
        float weight = is_patch ? 1.0 : behind_weight;
        sum += weight * (is_patch ? texelFetch(picture, pixel + AROUND[max(shown[i], 0)], 0) : behind);
        count += weight;
    }
    covered_color = count > 0.0 ? sum / count : own_color;
}
