#version 460
// A rectangle of the picture around each patch of a cut by error, widened by what its thickness shows beside it.
#include "common/polygon.glsl"
#include "common/patch_setup.glsl"

// The fields of `PatchPlane`.
layout(location = 0) flat out vec4 sides[6];
layout(location = 6) flat out vec4 along_u;
layout(location = 7) flat out vec4 along_v;
layout(location = 8) flat out vec4 plane;
layout(location = 9) flat out vec4 limits;
layout(location = 10) flat out vec4 extent;
layout(location = 11) flat out vec4 normal_and_shape;
layout(location = 12) flat out vec4 shape_and_middle;
layout(location = 13) flat out vec4 color_a;
layout(location = 14) flat out vec4 color_b;
// And the number of the patch.
layout(location = 15) flat out vec2 color_c;

void main() {
    PatchPlane own;
    PatchRectangle rectangle;
    set_up_patch(own, rectangle);
    sides = own.sides;
    along_u = own.along_u;
    along_v = own.along_v;
    plane = own.plane;
    limits = own.limits;
    extent = own.extent;
    normal_and_shape = own.normal_and_shape;
    shape_and_middle = own.shape_and_middle;
    color_a = own.color_a;
    color_b = own.color_b;
    // Whole up to 16 million.
    color_c = vec2(own.color_c, float(gl_InstanceIndex));

    // Corners of the rectangle: 0, 1, 2 and 2, 1, 3.
    int corner = gl_VertexIndex < 3 ? gl_VertexIndex : 6 - gl_VertexIndex - (gl_VertexIndex == 5 ? -2 : 1);
    float margin = limits.z;
    vec2 direction = rectangle.direction;
    vec2 ends = rectangle.ends;
    vec2 across = rectangle.across;
    vec2 at = direction * ((corner & 1) == 0 ? ends.x - margin : ends.y + margin)
        + vec2(-direction.y, direction.x) * ((corner & 2) == 0 ? across.x - margin : across.y + margin);
    vec2 through = (shape_and_middle.zw + at) * frame.ray_scale + frame.ray_offset;
    float distance = rectangle.distance;
    vec3 shown = has_flag(FLAG_ORTHOGRAPHIC) ? vec3(through, -distance) : vec3(through, -1.0) * distance;
    gl_Position = rectangle.is_gone ? vec4(0.0, 0.0, 2.0, 1.0) : frame.clip_from_view * vec4(shown, 1.0);
}
