// Eye of the frame as filtered splats need it, and vector operations in the order of the processor.
#include "common/exact.glsl"
#include "common/frame.glsl"

// Mirrored by `abi::FilteredConstants`.
layout(set = 0, binding = 10, std140) uniform FilteredConstants {
    // Rows of the matrix from model to view space.
    vec4 rows[3];
    // Distance along the view direction, model units: factors of a position, and what is added.
    vec4 forward;
    // Model space; of no meaning in an orthographic view.
    vec3 position;
    // Pixels of a model unit at distance 1 (perspective) or everywhere.
    float focal_px;
    // Toward the viewer, a unit vector.
    vec3 backward;
    // Side of the square of a node, pixels.
    float side_px;
    // To the right in the picture, a unit vector.
    vec3 right;
    // Largest diameter, pixels.
    float limit_px;
    // Up in the picture, a unit vector.
    vec3 up;
    // Factor of the depth offset.
    float offset_px;
    // The lamp: a position where w is 1, the unit vector towards it where w is 0.
    vec4 lamp;
    // Factors of x and y in clip space, and shifts.
    vec4 scale_shift;
    // Half the picture, pixels; the third component in clip space is the third of these times z plus the fourth.
    vec4 half_depth;
    // Length in view space of a unit vector in model space.
    float model_scale;
    // 2 f, pixels of a tangent (perspective) or of a unit of view space.
    float twice_focal_px;
} eye;

// 1 / x; 0 where that is no number.
float inverse_or_zero(float x) {
    precise float inverse = 1.0 / x;
    return x > 0.0 ? inverse : 0.0;
}

// The unit vector; zero where there is no direction.
vec3 unit_or_none(vec3 v) {
    precise float size = sqrt(dot_of(v, v));
    precise vec3 unit = v * inverse_or_zero(size);
    return unit;
}

// a x b, each component a difference of two products.
vec3 turned(vec3 a, vec3 b) {
    precise vec3 left = a.yzx * b.zxy;
    precise vec3 right = a.zxy * b.yzx;
    precise vec3 cross = left - right;
    return cross;
}

// A row of the matrix to view space times a position.
float in_view(int row, vec3 at) {
    precise float sum = dot_of(eye.rows[row].xyz, at) + eye.rows[row].w;
    return sum;
}
