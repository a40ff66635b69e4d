// A splat from a vertex on the picture, of the fields of common/polygon_parts.glsl: where the ray of a pixel meets its plane.

struct DiscPlane {
    // View space.
    vec3 middle;
    vec3 normal;
    // Directions of u and v, over the square of the model's scale, so that products are coordinates.
    vec3 along_u;
    vec3 along_v;
    // Direction (x, y, -1) through the middle; where that is not before the eye, of no use.
    vec2 ray;
    bool is_before;
};

struct DiscPixel {
    // Reversed depth.
    float depth;
    // View space.
    vec3 position;
    // Plane coordinates.
    vec2 uv;
};

DiscPlane disc_plane() {
    mat3 turn = mat3(frame.view_from_model);
    float over = 1.0 / (frame.model_scale * frame.model_scale);
    DiscPlane own;
    own.middle = (frame.view_from_model * vec4(center, 1.0)).xyz;
    own.normal = turn * normal;
    own.along_u = turn * axis * over;
    own.along_v = turn * second_axis() * over;
    own.is_before = own.middle.z < 0.0;
    own.ray = own.middle.xy / max(-own.middle.z, 1e-30);
    return own;
}

// Sets `pixel` to what the ray through a window position sees of a splat; false where that does not reach it.
bool disc_pixel(DiscPlane own, vec2 window, out DiscPixel pixel) {
    vec2 through = window * frame.ray_scale + frame.ray_offset;
    // Places in the plane, from the middle.
    vec3 way;
    if (has_flag(FLAG_ORTHOGRAPHIC)) {
        vec2 across = through - own.middle.xy;
        way = vec3(across, -dot(own.normal.xy, across) / own.normal.z);
    } else if (own.is_before) {
        // The ray is t (through, -1), and t the distance. Counted from the ray through the middle nothing large cancels.
        vec2 beside = through - own.ray;
        float turned = dot(own.normal.xy, beside);
        float along = -own.middle.z;
        float t = along * dot(own.normal, own.middle) / (dot(own.normal, own.middle) + along * turned);
        float change = -along * along * turned / (dot(own.normal, own.middle) + along * turned);
        way = vec3(own.ray, -1.0) * change + vec3(beside * t, 0.0);
    } else {
        float t = dot(own.normal, own.middle) / dot(own.normal, vec3(through, -1.0));
        way = vec3(through, -1.0) * t - own.middle;
    }
    pixel.position = own.middle + way;
    pixel.uv = vec2(dot(own.along_u, way), dot(own.along_v, way));
    vec2[CORNERS] feet = footprint();
    bool is_inside = dot(pixel.uv, pixel.uv) <= round_radius * round_radius;
    for (int i = 0; i < CORNERS; i++) {
        vec2 edge = feet[(i + 1) % CORNERS] - feet[i];
        vec2 to = pixel.uv - feet[i];
        is_inside = is_inside && edge.x * to.y - edge.y * to.x >= 0.0;
    }
    vec2 depth = frame.clip_from_view[2].zw * pixel.position.z + frame.clip_from_view[3].zw;
    pixel.depth = depth.x / depth.y;
    // The view volume in depth, and nothing that is not finite.
    return is_inside && depth.y > 0.0 && depth.x >= 0.0 && depth.x <= depth.y;
}
