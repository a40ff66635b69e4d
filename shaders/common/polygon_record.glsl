// Oriented polygons as storage. One of them at a time is in the globals that common/polygon_parts.glsl asks for.
#include "common/frame.glsl"
#include "common/list.glsl"
#include "common/polygon_fields.glsl"

layout(set = 0, binding = 2, std430) readonly buffer Polygons {
    PolygonRecord polygons[];
};

vec3 center;
float round_radius;
vec3 normal;
float thickness;
vec3 axis;
vec4 corners_0;
vec4 corners_2;
vec4 corners_4;
vec4 corners_6;
vec3 shading_normal;
vec4 color;
vec3 shape_operator;
float spread;
vec4 slopes_u;
vec4 slopes_v;

#include "common/polygon_parts.glsl"

// Reads a polygon into the globals.
void read_polygon(uint at) {
    PolygonRecord p = polygons[at];
    center = vec3(p.center[0], p.center[1], p.center[2]);
    round_radius = p.round_radius;
    normal = vec3(p.normal[0], p.normal[1], p.normal[2]);
    thickness = p.thickness;
    axis = vec3(p.axis[0], p.axis[1], p.axis[2]);
    corners_0 = vec4(p.corners[0], p.corners[1], p.corners[2], p.corners[3]);
    corners_2 = vec4(p.corners[4], p.corners[5], p.corners[6], p.corners[7]);
    corners_4 = vec4(p.corners[8], p.corners[9], p.corners[10], p.corners[11]);
    corners_6 = vec4(p.corners[12], p.corners[13], p.corners[14], p.corners[15]);
    shading_normal = vec3(p.shading_normal[0], p.shading_normal[1], p.shading_normal[2]);
    color = unpackUnorm4x8(p.color);
    shape_operator = vec3(p.shape_operator[0], p.shape_operator[1], p.shape_operator[2]);
    spread = p.spread;
    slopes_u = unpackSnorm4x8(p.color_slopes[0]);
    slopes_v = unpackSnorm4x8(p.color_slopes[1]);
}
