// Places on the surface that pixels show: the CPU mirror is src/projective/surface_rays.rs.
#include "common/frame.glsl"
#include "common/distance.glsl"
#include "common/photo_header.glsl"

layout(set = 0, binding = 1) uniform sampler2D picture;
layout(set = 0, binding = 2) uniform sampler2D depths;
// That of colors again where there are no normals.
layout(set = 0, binding = 3) uniform sampler2D normals;

layout(constant_id = 1) const bool HAS_SURFACE_NORMALS = false;

const float LONGEST_STEP = 8.0;

// A pixel's place on the surface, in model space.
struct SurfacePixel {
    vec3 position;
    vec3 normal;
    vec3 across;
    vec3 down;
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
