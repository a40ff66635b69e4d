// The weight in the middle of a kernel, such that a Gaussian deposits the area that its patch covers and the sum of weights is
// coverage.
#include "common/form.glsl"

const float PI = 3.14159265;
// Integral of exp(-2 rho^2) over the unit disc, over pi: (1 - exp(-2)) / 2.
const float GAUSSIAN_MEAN = 0.43233236;
// The least weight in the middle: a pixel that a splat alone decides (exp(-2) of this) must show something.
const float LEAST_DEPOSIT = 1e-3;

// `area_px` in square pixels, negative where it is unknown.
float weight_in_middle(float area_px, Disc disc) {
    float determinant = disc.form.x * disc.form.z - disc.form.y * disc.form.y;
    // A square has no form.
    float weight = determinant > 0.0 ? area_px * sqrt(determinant) / (PI * GAUSSIAN_MEAN)
                                     : area_px / (disc.size_px * disc.size_px);
    return area_px >= 0.0 ? max(weight, LEAST_DEPOSIT) : 1.0;
}
