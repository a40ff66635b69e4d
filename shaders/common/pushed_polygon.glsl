// A splat from a vertex where it is blended, as a vertex shader reads it.
#include "common/polygon.glsl"
#include "common/push_polygon.glsl"
