#version 460
// Pass lists.patches: nodes that a draw list names become the polygons that are drawn, those that `patches::packed` would have
// written in their place. An invocation does one.
#include "common/constants.glsl"
#include "common/list.glsl"
#include "common/patch_record.glsl"
#include "common/polygon_fields.glsl"
#include "common/tree.glsl"

layout(local_size_x = 64) in;

// Patches have colors of their own.
layout(constant_id = 0) const bool HAVE_COLORS = false;

layout(set = 0, binding = 2, std430) readonly buffer PatchIds {
    uint ids[];
};

layout(set = 0, binding = 3, std430) readonly buffer Nodes {
    NodeRecord nodes[];
};

layout(set = 0, binding = 4, std430) readonly buffer PatchRecords {
    PatchRecord records[];
};

layout(set = 0, binding = 5, std430) readonly buffer PatchColors {
    PatchColorRecord record_colors[];
};

layout(set = 0, binding = 6, std430) writeonly buffer Polygons {
    PolygonRecord polygons[];
};

float[3] array_of(vec3 v) {
    return float[3](v.x, v.y, v.z);
}

// Corners of the footprint: those of the rectangle, in the order (+,+), (-,+), (-,-), (+,-), less what is cut off each.
void write_corners(uint item, vec2 half_sides, uint cuts) {
    uint count = 0u;
    vec2 last = vec2(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 corner = half_sides * vec2(i == 0 || i == 3 ? 1.0 : -1.0, i < 2 ? 1.0 : -1.0);
        precise float cut = float(byte_of(cuts, i)) / 255.0;
        precise vec2 kept = corner * (1.0 - cut);
        vec2 on_v = vec2(corner.x, kept.y);
        vec2 on_u = vec2(kept.x, corner.y);
        // Counter-clockwise.
        vec2 first = (i & 1) == 0 ? on_v : on_u;
        last = (i & 1) == 0 ? on_u : on_v;
        polygons[item].corners[2u * count] = first.x;
        polygons[item].corners[2u * count + 1u] = first.y;
        ++count;
        if (cut > 0.0) {
            polygons[item].corners[2u * count] = last.x;
            polygons[item].corners[2u * count + 1u] = last.y;
            ++count;
        }
    }
    polygons[item].corner_count = count;
    for (; count < 8u; ++count) {
        polygons[item].corners[2u * count] = last.x;
        polygons[item].corners[2u * count + 1u] = last.y;
    }
}

// Change of the color along both axes in seven bits, with the exponent.
void write_slopes(uint item, PatchColorRecord of, float radius) {
    int exponent = HAVE_COLORS ? signed_byte_of(of.slopes_and_exponent, 2) : 0;
    int codes[6] = int[6](0, 0, 0, 0, 0, 0);
    if (HAVE_COLORS) {
        for (int i = 0; i < 6; ++i) {
            codes[i] = i < 4 ? signed_byte_of(of.slopes, i) : signed_byte_of(of.slopes_and_exponent, i - 4);
        }
    }
    float slopes[6];
    float largest = 0.0;
    for (int i = 0; i < 6; ++i) {
        precise float slope = value_7(codes[i], exponent) / radius;
        slopes[i] = slope;
        largest = max(largest, abs(slope));
    }
    int own = exponent_of(largest);
    uvec2 packed = uvec2(uint(own & 0xff) << 24);
    for (int i = 0; i < 6; ++i) {
        packed[i / 3] |= uint(bits_7(slopes[i], own) & 0xff) << (8 * (i % 3));
    }
    polygons[item].color_slopes = uint[2](packed.x, packed.y);
}

void main() {
    if (ITEM >= list.count) {
        return;
    }
    uint item = list.begin + ITEM;
    uint id = ids[item];
    NodeRecord node = nodes[id];
    PatchRecord of = records[id];
    float radius = node.radius;
    vec3 unit = normal_of_plane(of.plane);
    vec3 along_u = axis_of_plane(of.plane, unit);
    vec3 along_v = cross_of(unit, along_u);

    ivec2 height_and_u = halves_of(of.height_and_u);
    precise vec3 place = vec3(height_and_u, halves_of(of.v_and_side_u).x) / 32767.0;
    precise vec3 offset = ((along_u * place.y + along_v * place.z) + unit * place.x) * radius;
    precise vec3 origin = vec3(node.center[0], node.center[1], node.center[2]) + offset;
    precise vec2 half_sides =
        vec2(of.v_and_side_u >> 16, of.side_v & 0xffffu) * PATCH_SIDE_STEP * radius;
    precise float squared = half_sides.x * half_sides.x + half_sides.y * half_sides.y;
    precise float reach = sqrt(squared) * 1.0001;
    precise float thickness = length_of(byte_of(of.thickness_and_tangents, 0)) * radius;
    polygons[item].center = array_of(origin);
    polygons[item].round_radius = reach;
    polygons[item].normal = array_of(unit);
    polygons[item].thickness = thickness;
    polygons[item].axis = array_of(along_u);
    write_corners(item, half_sides, of.cuts);

    // The normal for light, in the plane's frame.
    uint tangents = of.thickness_and_tangents >> 16 | byte_of(of.tangents_and_shape, 0) << 16;
    precise vec3 mean = vec3(value_12(tangents) * 2.0, value_12(tangents >> 12) * 2.0, 1.0);
    precise float share = float(byte_of(of.tangents_and_shape, 1)) / 255.0;
    precise float scale = share / sqrt(dot_of(mean, mean));
    precise vec3 lit = ((along_u * mean.x + along_v * mean.y) + unit * mean.z) * scale;
    polygons[item].shading_normal = array_of(lit);
    int exponent = signed_byte_of(of.shape_and_residuals, 1);
    ivec3 shape = ivec3(
        signed_byte_of(of.tangents_and_shape, 2), signed_byte_of(of.tangents_and_shape, 3),
        signed_byte_of(of.shape_and_residuals, 0)
    );
    precise vec3 change =
        vec3(value_7(shape.x, exponent), value_7(shape.y, exponent), value_7(shape.z, exponent)) / radius * scale;
    polygons[item].shape_operator = array_of(change);
    polygons[item].spread = 1.0;
    PatchColorRecord colored = PatchColorRecord(0u, 0u, 0u);
    if (HAVE_COLORS) {
        colored = record_colors[id];
    }
    polygons[item].color = HAVE_COLORS ? colored.color | 0xff000000u : 0xffffffffu;
    write_slopes(item, colored, radius);
}
