// A footprint on the picture: a quadratic form around a center, which common/disc.glsl derives.

struct Disc {
    // Framebuffer position of the projected center.
    vec2 center_px;
    // xx, xy, yy of the quadratic form, 1 / pixels^2; all 0 where the footprint is the whole square.
    vec3 form;
    // 1 / pixels.
    vec2 skew;
    // Side of a square around the center that contains the footprint, pixels; at least 1.
    float size_px;
    // Change of reversed depth, which is affine on the picture of a plane; 1 / pixels.
    vec2 lean;
    // Reversed depth lost per unit of the form: an opaque splat is a dome, so that of two that overlap each shows its middle.
    float dome;
};

// Height of a dome over its radius, along its normal. Of discs that touch a ball those up to half of its radius end as cells
// instead of lying on each other, outermost rim in front.
const float DOME_HEIGHT = 0.25;

// A circle of a smaller diameter may lie between the centers of pixels: it is the square around it instead, of one pixel
// at least, so that no splat vanishes.
const float LEAST_ROUND_PX = 1.41421356;

// A smaller disc has the depth of its center in all of its pixels: nobody sees where planes meet there, and what is nearest
// would change with every move of the camera. It is no dome either.
const float LEAST_LEANING_PX = 3.0;

// Width and height of the rectangle around the center that contains the ellipse rho = 1, from the inverse of its form.
vec2 sides_of(vec3 inverse, vec2 skew) {
    vec2 shift = vec2(dot(inverse.xy, skew), dot(inverse.yz, skew));
    float rest = 1.0 - dot(skew, shift);
    return 2.0 * (abs(shift) + sqrt(inverse.xz * rest + shift * shift)) / rest;
}

// Side of the square that contains it.
float size_of(vec3 inverse, vec2 skew) {
    vec2 sides = sides_of(inverse, skew);
    return max(sides.x, sides.y);
}

vec3 inverse_form(vec3 form) {
    return vec3(form.z, -form.y, form.x) / (form.x * form.z - form.y * form.y);
}

// rho^2 at an offset from the center, pixels; above 1 is outside.
float rho_squared(vec3 form, vec2 skew, vec2 offset) {
    float w = 1.0 + dot(skew, offset);
    float squared = form.x * offset.x * offset.x + 2.0 * form.y * offset.x * offset.y + form.z * offset.y * offset.y;
    return w > 0.0 ? squared / (w * w) : 2.0;
}
