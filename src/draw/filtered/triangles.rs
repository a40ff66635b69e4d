//! Four triangles at a time become patches.

use super::four::{Four, Normals, Vectors, cross, dot, inverse_or_zero, scaled, vectors};
use super::patch::{Corner, Patch};
use glam::Vec4;

/// A triangle, or a piece of one.
#[derive(Clone, Copy)]
pub(super) struct Triangle {
    pub(super) corners: [Corner; 3],
    pub(super) color: [u8; 4],
}

impl Triangle {
    pub(super) fn patch(&self) -> Patch {
        Patch::of_triangle(self.corners, self.color)
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

impl Four {
    /// As [`Patch::of_triangle`] has them.
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
            normals: Normals::One(normals),
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
