// Mirrored by `abi::OrientedPolygon`.
struct PolygonRecord {
    float center[3];
    float round_radius;
    float normal[3];
    float thickness;
    float axis[3];
    uint corner_count;
    float corners[16];
    float shading_normal[3];
    // Red, green and blue from the lowest byte.
    uint color;
    float shape_operator[3];
    float spread;
    uint color_slopes[2];
};
