// Patches of surface by their sums, as `pack::filtered` has them: of nodes, triangles and points.
#include "common/filtered_eye.glsl"
#include "common/leaf_buffers.glsl"
#include "common/list.glsl"

// Mirrored by `tree::SurfaceMoments`: centroid, vector area and second moment, two numbers a word.
struct MomentsRecord {
    uint halves[6];
};

layout(set = 0, binding = 7, std430) readonly buffer Nodes {
    NodeRecord nodes[];
};

layout(set = 0, binding = 8, std430) readonly buffer Attributes {
    AttributesRecord attributes[];
};

layout(set = 0, binding = 9, std430) readonly buffer Moments {
    MomentsRecord moments[];
};

struct SummedPatch {
    vec3 center;
    float area;
    vec3 vector_area;
    // Sum of normals times areas, as a lamp asks for it.
    vec3 normals;
    // The mean shading normal, a unit vector or zero.
    vec3 normal;
    // It is the only one; else these are second moments, area included: xx, yy, zz and xy, xz, yz.
    bool has_one_normal;
    vec3 squares;
    vec3 products;
    vec3 color;
    // Nothing is known of the normals.
    bool is_bare;
    float half_thickness;
    float bend;
    // Radius of the ball around the center that the patch lies in; negative where that is not known.
    float reach;
    // Of triangles the ways from the first corner to the others.
    bool has_edges;
    vec3 edges[2];
};

// A corner of a triangle, its normal zero where unknown.
struct PatchCorner {
    vec3 position;
    vec3 normal;
};

// Whether the color is that of the headlight.
bool is_plain() {
    return !has_flag(FLAG_PHONG | FLAG_LIT_SPHERE | FLAG_COLOR_BY_NORMAL | FLAG_COLOR_BY_DEPTH);
}

uvec3 channels_of(uint rgba) {
    return (uvec3(rgba) >> uvec3(0u, 8u, 16u)) & 0xffu;
}

vec3 color_of(uvec3 channels) {
    precise vec3 color = vec3(channels) / 255.0;
    return color;
}

SummedPatch patch_of_node(uint id) {
    NodeRecord node = nodes[id];
    AttributesRecord of = attributes[id];
    MomentsRecord sums_of = moments[id];
    ivec2 xy = halves_of(sums_of.halves[0]);
    ivec2 z_and_x = halves_of(sums_of.halves[1]);
    ivec2 yz = halves_of(sums_of.halves[2]);
    ivec2 xx_yy = halves_of(sums_of.halves[3]);
    ivec2 zz_xy = halves_of(sums_of.halves[4]);
    ivec2 xz_yz = halves_of(sums_of.halves[5]);
    const float UNIT = 1.0 / 32767.0;
    precise float in_radii = node.radius * UNIT;
    precise float in_areas = of.area * UNIT;
    precise vec3 off = vec3(xy, z_and_x.x) * in_radii;
    precise vec3 center = vec3(node.center[0], node.center[1], node.center[2]) + off;
    precise float reach = node.radius + sqrt(dot_of(off, off));
    precise vec3 vector_area = vec3(z_and_x.y, yz) * in_areas;
    precise vec3 squares = vec3(xx_yy, zz_xy.x) * in_areas;
    precise vec3 products = vec3(zz_xy.y, xz_yz) * in_areas;
    uint alpha = of.color >> 24;
    bool has_none = alpha == 0u;
    bool is_bare = has_none && (xx_yy == ivec2(0)) && (zz_xy == ivec2(0)) && (xz_yz == ivec2(0));
    precise float thickness = (255.0 - float(alpha)) * (1.0 / 254.0);
    precise float half_thickness = of.splat_radius * (has_none ? 1.0 : thickness);
    // Normals all around have no mean, and the color is that of a ball in the light; the sums know better.
    bool is_ball = has_none && !is_bare;
    uvec3 channels = channels_of(of.color);
    precise vec3 plain = min(vec3(channels) * (1.0 / 255.0) * (is_ball ? 1.5 : 1.0), vec3(1.0));
    uvec3 whole = is_ball ? min((3u * channels + 1u) / 2u, uvec3(255u)) : channels;
    vec3 normal = is_bare ? vec3(0.0) : unit_of(halves_of(of.normal));
    return SummedPatch(
        center, of.area, vector_area, vector_area, normal, false, squares, products,
        is_plain() ? plain : color_of(whole), is_bare, half_thickness, 0.0, reach, false, vec3[2](vec3(0.0), vec3(0.0))
    );
}

// A square of `side`, model units, in the plane of a normal, where there is one.
SummedPatch patch_alone(vec3 center, uint rgba, uint code, float side) {
    bool has_normal = rgba >> 24 != 0u;
    vec3 n = has_normal ? unit_of(halves_of(code)) : vec3(0.0);
    precise float area = side * side;
    precise vec3 sum = n * area;
    precise vec3 normal = sum * inverse_or_zero(area);
    precise float half_thickness = 0.5 * side;
    return SummedPatch(
        center, area, sum, sum, normal, true, vec3(0.0), vec3(0.0),
        color_of(channels_of(rgba)), !has_normal, half_thickness, 1.0, -1.0, false, vec3[2](vec3(0.0), vec3(0.0))
    );
}

// The side of a square of the threshold's size at a place, model units.
float side_at(vec3 center) {
    precise float in_units = max(-in_view(2, center), 0.0) / eye.model_scale;
    float z = has_flag(FLAG_ORTHOGRAPHIC) ? 1.0 : in_units;
    precise float side = eye.side_px * z / eye.focal_px;
    return side;
}

// A node of a cloud, which may be points in one place.
SummedPatch patch_of_points(uint id) {
    AttributesRecord of = attributes[id];
    if (of.area > 0.0) {
        return patch_of_node(id);
    }
    NodeRecord node = nodes[id];
    vec3 center = vec3(node.center[0], node.center[1], node.center[2]);
    SummedPatch alone = patch_alone(center, of.color, of.normal, side_at(center));
    // A lamp asks the sums of the node.
    alone.normals = vec3(0.0);
    return alone;
}

SummedPatch patch_of_point(uint id) {
    VertexRecord point = vertices[id];
    vec3 center = vec3(point.position[0], point.position[1], point.position[2]);
    float spacing = leaves[id].radius;
    // `tree::area_of_point`.
    precise float side_of_spacing = sqrt(0.5235988 * spacing * spacing);
    bool has_spacing = spacing > 0.0;
    SummedPatch alone = patch_alone(center, point.color, point.normal, has_spacing ? side_of_spacing : side_at(center));
    if (has_spacing) {
        alone.half_thickness = spacing;
    }
    return alone;
}

PatchCorner corner_of(VertexRecord vertex) {
    bool is_known = vertex.color >> 24 != 0u;
    vec3 position = vec3(vertex.position[0], vertex.position[1], vertex.position[2]);
    return PatchCorner(position, is_known ? unit_of(halves_of(vertex.normal)) : vec3(0.0));
}

PatchCorner middle_of(PatchCorner a, PatchCorner b) {
    precise vec3 position = (a.position + b.position) * 0.5;
    precise vec3 normal = (a.normal + b.normal) * 0.5;
    return PatchCorner(position, normal);
}

// One of the pieces of a triangle whose edges are halved so often: two bits a time, the first highest.
void take_piece(inout PatchCorner own[3], uint cuts, uint piece) {
    for (uint left = cuts; left > 0u; --left) {
        PatchCorner d = middle_of(own[0], own[1]);
        PatchCorner e = middle_of(own[1], own[2]);
        PatchCorner f = middle_of(own[2], own[0]);
        uint which = (piece >> (2u * (left - 1u))) & 3u;
        own[0] = which == 0u ? own[0] : (which == 2u ? f : d);
        own[1] = which == 1u ? own[1] : (which == 0u ? d : e);
        own[2] = which == 2u ? own[2] : (which == 1u ? e : f);
    }
}

// A triangle or a piece of it. Its shading normal is the mean of its corners', as a picture of triangles interpolates it.
SummedPatch patch_of_triangle(uint id, uint cuts, uint piece) {
    PatchCorner own[3];
    uvec3 channels = uvec3(1u);
    for (int i = 0; i < 3; ++i) {
        VertexRecord vertex = vertices[corners[3u * id + uint(i)]];
        own[i] = corner_of(vertex);
        channels += channels_of(vertex.color);
    }
    take_piece(own, cuts, piece);
    precise vec3 b = own[1].position - own[0].position;
    precise vec3 c = own[2].position - own[0].position;
    precise vec3 vector_area = turned(b, c) * 0.5;
    precise float area = sqrt(dot_of(vector_area, vector_area));
    vec3 face = unit_or_none(vector_area);
    bool is_unknown = area == 0.0;
    precise vec3 shading = vec3(0.0);
    float bend_squared = 0.0;
    for (int i = 0; i < 3; ++i) {
        vec3 normal = unit_or_none(own[i].normal);
        vec3 off = turned(normal, face);
        bend_squared = max(bend_squared, dot_of(off, off));
        is_unknown = is_unknown || dot_of(normal, normal) == 0.0;
        shading = shading + normal;
    }
    vec3 mean = unit_or_none(shading);
    vec3 normal = mean == vec3(0.0) ? face : mean;
    float bend = is_unknown ? 1.0 : min(sqrt(bend_squared), 1.0);
    precise vec3 to_middle = (b + c) * (1.0 / 3.0);
    precise vec3 center = own[0].position + to_middle;
    precise vec3 from_b = b - to_middle;
    precise vec3 from_c = c - to_middle;
    float reach = max(max(dot_of(to_middle, to_middle), dot_of(from_b, from_b)), dot_of(from_c, from_c));
    return SummedPatch(
        center, area, vector_area, normal * area, normal, true, vec3(0.0), vec3(0.0),
        color_of(channels / 3u), false, 0.0, bend, sqrt(reach), true, vec3[2](b, c)
    );
}
