// The packed record of a patch, and its parts as numbers: the steps of `patches::packed`, in its order, so that both find the
// same.
#include "common/exact.glsl"

// Mirrored by `tree::PackedPatch`.
struct PatchRecord {
    uint plane;
    // Two halves of 16 bits each.
    uint height_and_u;
    uint v_and_side_u;
    uint side_v;
    // Four bytes each.
    uint cuts;
    uint thickness_and_tangents;
    uint tangents_and_shape;
    uint shape_and_residuals;
    uint residuals_and_angle;
};

// Mirrored by `tree::PackedPatchColors`: four bytes each.
struct PatchColorRecord {
    uint color;
    uint slopes;
    uint slopes_and_exponent;
};

// A byte of a word, the lowest is the first.
uint byte_of(uint word, int number) {
    return bitfieldExtract(word, 8 * number, 8);
}

int signed_byte_of(uint word, int number) {
    return bitfieldExtract(int(word), 8 * number, 8);
}

float power_of_two(int exponent) {
    return uintBitsToFloat(uint(clamp(exponent, -126, 127) + 127) << 23);
}

// The length of a logarithm, radii.
float length_of(uint code) {
    int sixteenths = int(code) - 255;
    precise float value = LARGEST_PATCH_LENGTH * power_of_two(sixteenths >> 4);
    precise float with_half = (sixteenths & 8) != 0 ? value * ROOT_2 : value;
    precise float with_quarter = (sixteenths & 4) != 0 ? with_half * ROOT_4 : with_half;
    precise float with_eighth = (sixteenths & 2) != 0 ? with_quarter * ROOT_8 : with_quarter;
    precise float with_all = (sixteenths & 1) != 0 ? with_eighth * ROOT_16 : with_eighth;
    return with_all;
}

// A value of -1 to 1 of the lowest 12 bits.
float value_12(uint bits) {
    precise float value = float(bitfieldExtract(int(bits), 0, 12)) / 2047.0;
    return max(value, -1.0);
}

// A value of a byte and the exponent of several.
float value_7(int bits, int exponent) {
    precise float value = float(bits) / 127.0 * power_of_two(exponent);
    return value;
}

// The exponent from which on a value has room in seven bits.
int exponent_of(float largest) {
    precise float more = max(largest, 1e-30) * 1.001001;
    uint bits = floatBitsToUint(more);
    return clamp(int(bits >> 23) - 127 + ((bits & 0x007fffffu) != 0u ? 1 : 0), -100, 100);
}

int bits_7(float value, int exponent) {
    precise float units = value * power_of_two(-exponent) * 127.0;
    // Halves away from 0.
    float whole = trunc(units);
    float rounded = abs(units - whole) >= 0.5 ? whole + sign(units) : whole;
    return int(clamp(rounded, -127.0, 127.0));
}

vec3 cross_of(vec3 a, vec3 b) {
    precise vec3 first = a.yzx * b.zxy;
    precise vec3 second = b.yzx * a.zxy;
    precise vec3 both = first - second;
    return both;
}

// Normal of a plane.
vec3 normal_of_plane(uint plane) {
    vec3 at = unfolded(vec2(value_12(plane), value_12(plane >> 12)), 1.0);
    at = mix(at, vec3(0.0), lessThan(abs(at), vec3(1e-6)));
    precise float inverse = 1.0 / sqrt(dot_of(at, at));
    precise vec3 unit = at * inverse;
    return unit;
}

// Sine of a part of a quarter turn, 0 to 256.
float sine_of_turn(float turn) {
    precise float x = turn * PATCH_TURN;
    precise float square = x * x;
    precise float sum = 1.0 - square / 156.0 * 1.0;
    sum = 1.0 - square / 110.0 * sum;
    sum = 1.0 - square / 72.0 * sum;
    sum = 1.0 - square / 42.0 * sum;
    sum = 1.0 - square / 20.0 * sum;
    sum = 1.0 - square / 6.0 * sum;
    precise float sine = x * sum;
    return sine;
}

// Direction of u in a plane of this normal.
vec3 axis_of_plane(uint plane, vec3 unit) {
    // Duff and others, Building an Orthonormal Basis, Revisited, 2017.
    float side = unit.z < 0.0 ? -1.0 : 1.0;
    precise float a = -1.0 / (side + unit.z);
    precise vec3 first = vec3(unit.x * unit.y * a, side + unit.y * unit.y * a, -unit.y);
    float turn = float(plane >> 24);
    precise vec3 axis = first * sine_of_turn(256.0 - turn) + cross_of(unit, first) * sine_of_turn(turn);
    return axis;
}
