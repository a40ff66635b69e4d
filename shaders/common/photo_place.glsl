// How a point falls into a photograph: the CPU mirror is src/projective/projected.rs, of lenses src/projective/lens.rs. Who
// includes this has `vec4 camera_of(uint photo, uint row)`: rows of the rotation with focal lengths and least depth (0 to 2);
// center and area; principal point and size; gain and stage; direction and largest radius; coefficients of the lens (7 and 8);
// focal lengths and principal point of the depth map; tint and lens.
layout(constant_id = 0) const bool HAS_LENSES = false;

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

bool is_inside(vec2 at, vec2 size) {
    return all(greaterThanEqual(at, vec2(0.0))) && all(lessThan(at, size));
}
