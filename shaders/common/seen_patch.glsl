// Areas and angles of a patch as the eye sees them, and its color in the headlight.
#include "common/summed_patch.glsl"

struct SeenPatch {
    // Toward the eye, a unit vector.
    vec3 v;
    // To the eye, and along the view direction, model units (1 in an orthographic view).
    float distance;
    float z;
    // Projected area of the fronts, and of fronts and backs, model units squared.
    float front;
    float both;
    // Cosine of the mean normal, LEAST_FILTERED_FACING to 1.
    float facing;
    // Share of the albedo that the headlight makes of it.
    float lambert;
    // Length of the vector area.
    float vector_length;
    // It covers anything.
    bool is_seen;
};

// The second moment times a vector.
vec3 of_second(SummedPatch of, vec3 v) {
    precise float x = of.squares.x * v.x + of.products.x * v.y + of.products.y * v.z;
    precise float y = of.products.x * v.x + of.squares.y * v.y + of.products.z * v.z;
    precise float z = of.products.y * v.x + of.products.z * v.y + of.squares.z * v.z;
    return vec3(x, y, z);
}

SeenPatch seen_of(SummedPatch of) {
    bool is_orthographic = has_flag(FLAG_ORTHOGRAPHIC);
    precise vec3 to_eye = eye.position - of.center;
    precise float along = dot_of(eye.forward.xyz, of.center) + eye.forward.w;
    vec3 w = is_orthographic ? eye.backward : to_eye;
    float z = is_orthographic ? 1.0 : along;
    precise float distance = sqrt(dot_of(w, w));
    precise vec3 v = w * (1.0 / distance);
    vec3 light = has_flag(FLAG_PARALLEL_LIGHT) ? eye.backward : v;
    float toward = dot_of(of.vector_area, v);
    toward = has_flag(FLAG_CULLS_BACK) ? toward : abs(toward);
    float least = max(dot_of(v, of_second(of, v)), 0.0);
    precise float between = (least + sqrt(least * of.area)) * 0.5;
    precise float of_one = abs(toward * dot_of(of.normal, light));
    float lit = of.has_one_normal ? of_one : abs(dot_of(v, of_second(of, light)));
    float both = max(of.has_one_normal ? 0.0 : between, abs(toward));
    precise float fronts = (both + toward) * 0.5;
    float front = of.is_bare ? of.area : fronts;
    precise float vector_length = sqrt(dot_of(of.vector_area, of.vector_area));
    precise float cosine = toward * inverse_or_zero(vector_length);
    precise float lambert = min(lit / both, 1.0);
    precise float least_front = of.area * LEAST_FRONT;
    return SeenPatch(
        v, distance, z, front, both,
        of.is_bare ? 1.0 : clamp(cosine, LEAST_FILTERED_FACING, 1.0),
        of.is_bare ? 1.0 : lambert,
        vector_length,
        front > least_front && of.area > 0.0 && z > 0.0 && distance > 0.0
    );
}

// The color of the surface itself.
vec3 own_color(SummedPatch of) {
    vec3 color = has_flag(FLAG_USE_COLORS) ? of.color : vec3(1.0);
    return has_flag(FLAG_COLOR_BY_PRIMITIVE) ? vec3(1.0, 0.2, 0.2) : color;
}

vec3 in_headlight(SummedPatch of, SeenPatch seen) {
    precise float value = seen.lambert * ALBEDO;
    precise vec3 color = min(value * own_color(of), vec3(1.0));
    return color;
}
