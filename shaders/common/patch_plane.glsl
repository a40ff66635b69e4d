// A patch of a cut by error on the picture: a rectangle around it, widened by what its thickness shows beside it, and what a
// pixel in it sees.
//
// A pixel is in the widened patch where its signed distance from every side is at least minus the margin, and where it lies in
// the rectangle, which ends along the longest side: at sharp corners sides alone would reach far beyond. The cut sees to it that
// no patch reaches the near plane. All positions are counted from the middle, where the origin of the plane lies.

struct PatchPlane {
    // Signed distances from two sides: x, y and constant of both.
    vec4 sides[6];
    // Along u and v: the direction in view space over the square of the model's scale, and its product with the center.
    vec4 along_u;
    vec4 along_v;
    // Inverse distance (perspective) or distance of the plane: change along x and y, and that of the middle; thickness.
    vec4 plane;
    // Least and greatest distance, margin in pixels, part of the light that is kept.
    vec4 limits;
    // Least and greatest (u, v).
    vec4 extent;
    // Normal in view space at u = v = 0, and the first of the shape operator.
    vec4 normal_and_shape;
    // The other two of the shape operator, and the middle in pixels.
    vec4 shape_and_middle;
    // Color, and its change along u and v.
    vec4 color_a;
    vec4 color_b;
    float color_c;
};

struct PatchPixel {
    // Reversed depth.
    float depth;
    // View space.
    vec3 position;
    // Plane coordinates.
    vec2 foot;
};

// Sets `pixel` to what the ray through a window position sees of a patch that it meets so far inside, pixels.
void patch_pixel_of(PatchPlane patch_plane, vec2 window, float inside, out PatchPixel pixel) {
    vec3 at = vec3(window - patch_plane.shape_and_middle.zw, 1.0);
    bool is_parallel = has_flag(FLAG_ORTHOGRAPHIC);
    float on_plane = dot(patch_plane.plane.xyz, at);
    float distance = is_parallel ? on_plane : 1.0 / on_plane;
    // Rays along the plane meet it nowhere, or behind the eye.
    distance = on_plane > 0.0 || is_parallel ? distance : patch_plane.limits.y;
    distance = clamp(distance, patch_plane.limits.x, patch_plane.limits.y);
    vec2 through = window * frame.ray_scale + frame.ray_offset;
    pixel.position = is_parallel ? vec3(through, -distance) : vec3(through, -1.0) * distance;
    vec2 foot = vec2(
        dot(patch_plane.along_u.xyz, pixel.position) - patch_plane.along_u.w,
        dot(patch_plane.along_v.xyz, pixel.position) - patch_plane.along_v.w
    );
    pixel.foot = clamp(foot, patch_plane.extent.xy, patch_plane.extent.zw);

    // What lies in the widened margin is pushed back by the thickness and its distance from the footprint, so that a neighbor's
    // own area wins.
    float shown = distance;
    if (inside < 0.0) {
        float unit_px = is_parallel ? frame.focal_px : frame.focal_px / distance;
        shown += patch_plane.plane.w - inside / unit_px;
    }
    vec2 depth = frame.clip_from_view[2].zw * -shown + frame.clip_from_view[3].zw;
    // What was pushed back stays in the picture: it may be all that covers this pixel. Nothing is seen at a depth of 0.
    pixel.depth = clamp(depth.x / depth.y, 1e-37, 1.0);
}

// Sets `pixel` to what the ray through a window position sees of a patch; false where that does not reach it.
bool patch_pixel(PatchPlane patch_plane, vec2 window, out PatchPixel pixel) {
    vec3 at = vec3(window - patch_plane.shape_and_middle.zw, 1.0);
    float inside = 1e30;
    for (int i = 0; i < 2; i++) {
        vec4 a = patch_plane.sides[3 * i];
        vec4 b = patch_plane.sides[3 * i + 1];
        vec4 c = patch_plane.sides[3 * i + 2];
        inside = min(inside, min(dot(a.xyz, at), dot(vec3(a.w, b.xy), at)));
        inside = min(inside, min(dot(vec3(b.zw, c.x), at), dot(c.yzw, at)));
    }
    if (inside < -patch_plane.limits.z) {
        return false;
    }
    patch_pixel_of(patch_plane, window, inside, pixel);
    return true;
}

// Normal of the surface there, view space; no unit vector.
vec3 patch_normal(PatchPlane patch_plane, vec2 foot) {
    vec3 shape = vec3(patch_plane.normal_and_shape.w, patch_plane.shape_and_middle.xy);
    vec2 bend = vec2(shape.x * foot.x + shape.y * foot.y, shape.y * foot.x + shape.z * foot.y);
    float squared = frame.model_scale * frame.model_scale;
    return patch_plane.normal_and_shape.xyz + squared * (bend.x * patch_plane.along_u.xyz + bend.y * patch_plane.along_v.xyz);
}

// Color of the surface there.
vec3 patch_color(PatchPlane patch_plane, vec2 foot) {
    vec4 a = patch_plane.color_a;
    vec4 b = patch_plane.color_b;
    vec3 base = a.rgb + foot.x * vec3(a.w, b.xy) + foot.y * vec3(b.zw, patch_plane.color_c);
    return clamp(base, vec3(0.0), vec3(1.0));
}
