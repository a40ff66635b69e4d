//! Four triangles at a time become patches.

use crate::abi::Vertex;
use crate::math::octahedral;
use crate::pack::filtered::patch::{Corner, SummedPatch, mean_color};
use crate::pack::filtered::patch_x4::{
    FourPatches, PatchNormals, Vectors, cross, dot, inverse_or_zero, scaled, vectors,
};
use crate::tree::{Model, ModelTextures};
use glam::{Vec3, Vec4};

/// A triangle, or a piece of one.
#[derive(Clone, Copy)]
pub(super) struct Triangle {
    pub(super) corners: [Corner; 3],
    pub(super) color: [u8; 4],
}

impl Triangle {
    pub(super) fn patch(&self) -> SummedPatch {
        SummedPatch::of_triangle(self.corners, self.color)
    }
}

fn minus(a: &Vectors, b: &Vectors) -> Vectors {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn plus(a: &Vectors, b: &Vectors) -> Vectors {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Unit vectors, zero where there is no direction.
fn normalized(v: &Vectors) -> Vectors {
    scaled(v, inverse_or_zero(dot(v, v).sqrt()))
}

impl FourPatches {
    /// Corners as [`SummedPatch::of_triangle`] has them.
    #[inline]
    pub(super) fn of_triangles(triangles: [&Triangle; 4]) -> Self {
        let corner = |i: usize| vectors(triangles.map(|t| t.corners[i].0));
        let [a, b, c] = [corner(0), corner(1), corner(2)];
        let edges = [minus(&b, &a), minus(&c, &a)];
        let vector_area = scaled(&cross(&edges[0], &edges[1]), Vec4::splat(0.5));
        let area = dot(&vector_area, &vector_area).sqrt();
        let face = normalized(&vector_area);
        let has_no_face = area.cmpeq(Vec4::ZERO);
        let mut shading = [Vec4::ZERO; 3];
        let (mut bend_squared, mut is_unknown) = (Vec4::ZERO, has_no_face);
        for i in 0..3 {
            let normal = normalized(&vectors(triangles.map(|t| t.corners[i].1)));
            let turned = cross(&normal, &face);
            bend_squared = bend_squared.max(dot(&turned, &turned));
            is_unknown |= dot(&normal, &normal).cmpeq(Vec4::ZERO);
            shading = plus(&shading, &normal);
        }
        let mean = normalized(&shading);
        let has_no_mean = dot(&mean, &mean).cmpeq(Vec4::ZERO);
        let normals = [0, 1, 2].map(|i| Vec4::select(has_no_mean, face[i], mean[i]));
        let bend = Vec4::select(is_unknown, Vec4::ONE, bend_squared.sqrt().min(Vec4::ONE));
        let color = |i: usize| Vec4::from_array(triangles.map(|t| f32::from(t.color[i]))) / 255.0;
        let to_middle = scaled(&plus(&edges[0], &edges[1]), Vec4::splat(1.0 / 3.0));
        let reach = [
            to_middle,
            minus(&edges[0], &to_middle),
            minus(&edges[1], &to_middle),
        ];
        let reach = reach.iter().map(|v| dot(v, v)).fold(Vec4::ZERO, Vec4::max);
        Self {
            center: plus(&a, &to_middle),
            area,
            vector_area,
            normals: PatchNormals::One(normals),
            half_thickness: Vec4::ZERO,
            bend,
            color: [color(0), color(1), color(2)],
            bare: Vec4::ZERO,
            reach: reach.sqrt(),
            has_edges: true,
            edges,
        }
    }
}

/// A leaf that is a triangle.
#[inline]
pub(super) fn triangle_of(model: &Model, leaf: usize) -> Triangle {
    let corners = model.triangles[leaf].map(|i| model.vertices[i as usize]);
    let corner = |v: Vertex| {
        let is_known = v.color[3] != 0;
        let normal = is_known.then(|| octahedral::decode(v.normal));
        (v.position, normal.unwrap_or(Vec3::ZERO))
    };
    let textures = model.textures.as_deref();
    let mean = textures.and_then(|textures| textures.leaf_color(leaf));
    Triangle {
        corners: corners.map(corner),
        color: match mean {
            Some([red, green, blue]) => [red, green, blue, 255],
            None => mean_color(&corners),
        },
    }
}

/// The color of the texels about a piece of a triangle; `None` where it has none.
#[cold]
pub(super) fn piece_color(
    model: &Model,
    textures: &ModelTextures,
    leaf: u32,
    piece: &[Corner; 3],
) -> Option<[u8; 4]> {
    let triangle = model.triangles[leaf as usize];
    let (image, places) = textures.of_triangle(triangle)?;
    let [a, b, c] = triangle.map(|corner| model.vertices[corner as usize].position);
    let (one, other) = (b - a, c - a);
    let normal = one.cross(other);
    let squared = normal.length_squared();
    if squared <= 0.0 {
        return None;
    }
    let place = |&(position, _): &Corner| {
        let offset = position - a;
        let second = offset.cross(other).dot(normal) / squared;
        let third = one.cross(offset).dot(normal) / squared;
        places[0] + (places[1] - places[0]) * second + (places[2] - places[0]) * third
    };
    let [a, b, c] = piece;
    let color = image.about([place(a), place(b), place(c)]);
    let [red, green, blue] = color.to_array().map(|value| (value * 255.0).round() as u8);
    Some([red, green, blue, 255])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A repeatable number in -1..1.
    fn number(i: u32) -> f32 {
        let hash =
            (i ^ (i >> 7)).wrapping_mul(0x9e37_79b9).rotate_left(11) ^ i.wrapping_mul(0x85eb_ca6b);
        (hash >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    fn vector(i: u32) -> Vec3 {
        Vec3::new(number(3 * i), number(3 * i + 1), number(3 * i + 2))
    }

    #[test]
    fn four_triangles_are_what_each_of_them_is() {
        let any = |i: u32| Triangle {
            corners: [0, 1, 2].map(|k| (vector(100 * i + k), vector(100 * i + 50 + k))),
            color: [0, 51, 255, 255],
        };
        let without_normals = |t: Triangle| Triangle {
            corners: t.corners.map(|(place, _)| (place, Vec3::ZERO)),
            ..t
        };
        for i in 0..50 {
            let line = Triangle {
                corners: [(Vec3::X, Vec3::Y); 3],
                ..any(4 * i)
            };
            let triangles = [
                any(4 * i),
                any(4 * i + 1),
                without_normals(any(4 * i + 2)),
                line,
            ];
            let four = FourPatches::of_triangles(triangles.each_ref());
            let PatchNormals::One(normals) = &four.normals else {
                panic!("triangles have one normal");
            };
            for (lane, triangle) in triangles.iter().enumerate() {
                let patch = triangle.patch();
                let of = |v: &Vectors| Vec3::from(v.map(|c| c[lane]));
                let is = |a: Vec3, b: Vec3| (a - b).abs().max_element() < 1e-5;
                assert!(is(of(&four.center), patch.center), "{i} {lane}");
                assert!(is(of(&four.vector_area), patch.vector_area), "{i} {lane}");
                assert!((four.area[lane] - patch.area).abs() < 1e-5, "{i} {lane}");
                if patch.area > 0.0 {
                    let normal = patch.normals / patch.area;
                    assert!(is(of(normals), normal), "{i} {lane}");
                }
                assert!((four.bend[lane] - patch.bend).abs() < 1e-4, "{i} {lane}");
                let farthest = triangle.corners.map(|c| c.0.distance(patch.center));
                let farthest = farthest.into_iter().fold(0.0, f32::max);
                assert!((four.reach[lane] - farthest).abs() < 1e-5, "{i} {lane}");
                assert!(is(of(&four.color), Vec3::new(0.0, 0.2, 1.0)), "{i} {lane}");
            }
        }
    }
}
