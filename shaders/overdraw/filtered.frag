#version 460
// Pass overdraw.count, filtered splats: one for every pixel that the rectangle overlaps.

layout(location = 1) flat in vec3 extent_and_size_px;

layout(location = 0) out float count;

void main() {
    vec2 distance = abs(gl_PointCoord - 0.5) * extent_and_size_px.z;
    count = all(lessThan(distance, 0.5 * (extent_and_size_px.xy + 1.0))) ? 1.0 : 0.0;
}
