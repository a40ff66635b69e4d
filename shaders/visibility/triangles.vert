#version 460
// Passes visibility.depth (pushed away by the offset of the largest splat at their depth) and visibility.centers (in
// their place): triangles.
#include "common/visibility.glsl"
#include "common/octahedral.glsl"
#include "common/push.glsl"
#include "common/disc.glsl"

// Whether this is the pass of centers.
layout(constant_id = 0) const bool IS_CENTER = false;

layout(location = 0) in vec3 position;
layout(location = 1) in vec2 normal;
layout(location = 2) in vec4 color;

layout(location = 0) out vec3 normal_in_view;
layout(location = 1) out vec3 vertex_color;
layout(location = 2) out float view_distance;

invariant gl_Position;

void main() {
    vec3 position_in_view = (frame.view_from_model * vec4(position, 1.0)).xyz;
    // Alpha 0 marks a vertex without normal: it leaves the others to decide.
    normal_in_view =
        color.a == 0.0 ? vec3(0.0) : mat3(frame.view_from_model) * octahedral_decode(normal) / frame.model_scale;
    vertex_color = color.rgb;
    if (!IS_CENTER) {
        float facing = color.a == 0.0 ? 1.0 : dot(normal_in_view, to_eye(position_in_view));
        position_in_view = push_away(position_in_view, depth_offset(splat_radius(-position_in_view.z), facing));
    }
    view_distance = -position_in_view.z;
    gl_Position = frame.clip_from_view * vec4(position_in_view, 1.0);
}
