// Place of a filtered splat in the picture, and the size that it is drawn with there.
#include "common/seen_patch.glsl"

struct SplatSize {
    // Share of its patch.
    float share;
    // It belongs to a row: the way from one to the next, model space.
    bool is_row;
    vec3 to_next;
    // Diameter in pixels; the rectangle is not larger.
    float diameter_px;
    // The rectangle is as large as the diameter, tilted: for patches that are not dense.
    bool is_own;
};

struct PicturePlace {
    vec2 window_px;
    // Reversed depth, and that of the first pass; 0 where it lies at or behind the far plane.
    float depth;
    float pushed_depth;
    // It lies between the near and the far plane.
    bool is_between;
};

// Of a center in model space that the first pass pushes away by `offset_in_model`.
PicturePlace place_of(vec3 center, float offset_in_model) {
    bool is_orthographic = has_flag(FLAG_ORTHOGRAPHIC);
    vec3 at = vec3(in_view(0, center), in_view(1, center), in_view(2, center));
    precise float offset = offset_in_model * eye.model_scale;
    precise float clip_z = eye.half_depth.z * at.z + eye.half_depth.w;
    // Along the ray, so that the window position stays. With an offset of 0 the factor is exactly 1: a splat is never behind
    // itself.
    precise float size = sqrt(dot_of(at, at));
    precise float along_ray = at.z * ((size + offset) / size);
    precise float along_view = at.z - offset;
    float pushed = is_orthographic ? along_view : along_ray;
    float w = is_orthographic ? 1.0 : -at.z;
    float shift = is_orthographic ? 1.0 : at.z;
    float pushed_w = is_orthographic ? 1.0 : -pushed;
    precise vec2 ndc = (eye.scale_shift.xy * at.xy + eye.scale_shift.zw * shift) / w;
    precise vec2 window_px = ndc * eye.half_depth.xy + eye.half_depth.xy;
    precise float pushed_depth = (eye.half_depth.z * pushed + eye.half_depth.w) / pushed_w;
    precise float depth = clip_z / w;
    bool is_near = all(lessThan(abs(window_px), vec2(FARTHEST_PX)));
    // What cannot be pushed hides nothing; it is drawn still.
    return PicturePlace(
        window_px, depth, pushed_depth > 0.0 ? min(pushed_depth, 1.0) : 0.0,
        is_near && clip_z >= 0.0 && clip_z <= w && w > 0.0
    );
}

// Width of a splat's rectangle along an axis of the picture.
float extent_along(vec3 axis, SummedPatch of, SeenPatch seen, SplatSize size) {
    float largest = max(size.diameter_px, 1.0);
    precise float scale = eye.focal_px / seen.z;
    precise float area = max(seen.vector_length, seen.front) * size.share;
    precise vec3 unit = of.vector_area * (of.is_bare ? 0.0 : inverse_or_zero(seen.vector_length));
    float across = dot_of(unit, axis);
    precise float wide;
    if (size.is_own) {
        precise float flat_share = min(seen.vector_length / of.area, 1.0);
        precise float tilt = 1.0 - across * across * flat_share;
        wide = size.diameter_px * sqrt(max(tilt, 0.0));
    } else if (of.has_edges) {
        float b = dot_of(of.edges[0], axis);
        float c = dot_of(of.edges[1], axis);
        wide = scale * sqrt(max((b * b + c * c - b * c) * (2.0 / 3.0), 0.0));
    } else if (size.is_row) {
        float beside = abs(dot_of(turned(unit, size.to_next), axis));
        float along = abs(dot_of(size.to_next, axis));
        float inverse_square = inverse_or_zero(dot_of(size.to_next, size.to_next));
        wide = scale * (along + area * beside * inverse_square);
    } else {
        precise float tilt = 1.0 - across * across;
        wide = scale * sqrt(area * max(tilt, 0.0));
    }
    bool is_whole = of.is_bare && !size.is_own && !of.has_edges;
    return min(max(is_whole ? largest : wide, LEAST_EXTENT_PX), largest);
}

// How far behind one another the middles of neighboring patches lie whose squares are `half_side` to either side, in the
// world, see `pack::filtered`.
float depth_reach(SummedPatch of, float half_side, float facing, bool is_own) {
    precise float most_of_own = half_side / max(facing, LEAST_FACING_OF_OWN);
    precise float most = half_side / facing;
    precise float tangent = sqrt(max(1.0 - facing * facing, 0.0)) / facing;
    precise float neighbors = of.bend * OFFSET_OF_BEND + OFFSET_OF_NEIGHBORS;
    precise float range = half_side * (tangent + neighbors) + of.half_thickness * OFFSET_OF_THICKNESS / facing;
    return is_own ? most_of_own : min(range, most);
}

// Side of the square of the first pass, pixels.
float side_of(SummedPatch of, SeenPatch seen, SplatSize size) {
    float side = max(size.diameter_px, eye.side_px);
    if (size.is_own || of.reach < 0.0) {
        return side;
    }
    // What is smaller than the threshold needs no square of its size. Beside the axis a ball is seen larger.
    precise float aside_of_axis = seen.distance / (seen.z * seen.z);
    float aside = has_flag(FLAG_ORTHOGRAPHIC) ? 1.0 : aside_of_axis;
    precise float around = of.reach * aside * eye.focal_px * 2.0;
    return min(side, max(around, 1.0));
}

// Projected area of the fronts, square pixels.
float area_px_of(SeenPatch seen) {
    precise float orthographic = eye.focal_px * eye.focal_px * seen.front;
    precise float perspective = orthographic * seen.distance / (seen.z * seen.z * seen.z);
    return has_flag(FLAG_ORTHOGRAPHIC) ? orthographic : perspective;
}
