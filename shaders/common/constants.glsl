// Frame flag: multiply the albedo by the vertex color.
const uint FLAG_USE_COLORS = 1u;
// Frame flag: light both sides of a surface.
const uint FLAG_TWO_SIDED = 2u;
// Frame flag: color by kind of primitive instead of by vertex color.
const uint FLAG_COLOR_BY_PRIMITIVE = 4u;
// Frame flag: parallel light along the view direction (also for every orthographic view).
const uint FLAG_PARALLEL_LIGHT = 8u;
// Frame flag: orthographic projection.
const uint FLAG_ORTHOGRAPHIC = 16u;
// Diffuse albedo of the headlight shading.
const float ALBEDO = 0.8;
// A pixel of fuzzy splats shows something when the sum of its weights is at least this.
const float LEAST_FUZZY_WEIGHT = 1e-4;
