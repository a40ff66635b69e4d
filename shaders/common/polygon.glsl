// One oriented polygon of a draw list, as a vertex shader reads it. Mirrored by `abi::OrientedPolygon`.
#include "common/frame.glsl"

layout(location = 0) in vec3 center;
layout(location = 1) in float round_radius;
layout(location = 2) in vec3 normal;
layout(location = 3) in float thickness;
layout(location = 4) in vec3 axis;
// (u, v) of two corners each; those past the last repeat it.
layout(location = 5) in vec4 corners_0;
layout(location = 6) in vec4 corners_2;
layout(location = 7) in vec4 corners_4;
layout(location = 8) in vec4 corners_6;
layout(location = 9) in vec3 shading_normal;
layout(location = 10) in vec4 color;
layout(location = 11) in vec3 shape_operator;
layout(location = 12) in float spread;
// Red, green and blue; the last of the first is the exponent of both, over 127.
layout(location = 13) in vec4 slopes_u;
layout(location = 14) in vec4 slopes_v;

#include "common/polygon_parts.glsl"
