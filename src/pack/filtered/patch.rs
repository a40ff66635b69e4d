//! A patch of surface as its sums have it.

use crate::abi::Vertex;
use crate::math::octahedral;
use crate::tree::{Model, SurfaceMoments};
use glam::{Mat3, Vec3};

/// A patch as the sums have it.
#[derive(Clone, Copy)]
pub(super) struct SummedPatch {
    pub(super) center: Vec3,
    pub(super) area: f32,
    pub(super) vector_area: Vec3,
    /// Sum of shading normals times areas.
    pub(super) normals: Vec3,
    /// There is one shading normal, which may differ from that of the area.
    pub(super) is_triangle: bool,
    /// Zero where there is one shading normal.
    pub(super) second_moment: Mat3,
    pub(super) color: [u8; 4],
    /// The node; none of a leaf.
    pub(super) node: Option<u32>,
    /// Nothing is known of its normals.
    pub(super) is_bare: bool,
    /// How far it reaches along its normal to either side, model units.
    pub(super) half_thickness: f32,
    /// Of a triangle the largest sine of the angle between its normal and those of its corners: what lies next to it is
    /// turned by about twice that. 1 where nothing is known.
    pub(super) bend: f32,
}

/// Mean of three colors.
pub(super) fn mean_color(corners: &[Vertex; 3]) -> [u8; 4] {
    let channel =
        |i: usize| ((corners.iter().map(|v| u32::from(v.color[i])).sum::<u32>() + 1) / 3) as u8;
    [channel(0), channel(1), channel(2), 255]
}

/// Corner of a triangle: position and shading normal, zero where unknown.
pub(super) type Corner = (Vec3, Vec3);

fn middle(a: Corner, b: Corner) -> Corner {
    ((a.0 + b.0) * 0.5, (a.1 + b.1) * 0.5)
}

/// Calls `visit` with the pieces of a triangle whose edges are halved `cuts` times.
pub(super) fn in_pieces([a, b, c]: [Corner; 3], cuts: u32, visit: &mut impl FnMut([Corner; 3])) {
    if cuts == 0 {
        return visit([a, b, c]);
    }
    let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
    for piece in [[a, d, f], [d, b, e], [f, e, c], [d, e, f]] {
        in_pieces(piece, cuts - 1, visit);
    }
}

impl SummedPatch {
    pub(super) fn of_node(model: &Model, id: u32) -> Self {
        let node = &model.tree.nodes[id as usize];
        let attributes = &model.tree.attributes[id as usize];
        let moments = &model.tree.moments[id as usize];
        let unit = |code: i16| f32::from(code) * (1.0 / SurfaceMoments::UNIT);
        let area = attributes.area;
        let [xx, yy, zz, xy, xz, yz] = moments.second_moment.map(|code| unit(code) * area);
        // Normals all around have no mean, and the color is that of a ball in the light; the sums know better.
        let is_bare = !attributes.has_normal() && moments.second_moment == [0; 6];
        let [r, g, b, alpha] = attributes.color;
        let color = if attributes.has_normal() || is_bare {
            attributes.color
        } else {
            let whole = |c: u8| (3 * u32::from(c)).div_ceil(2).min(255) as u8;
            [whole(r), whole(g), whole(b), alpha]
        };
        Self {
            center: node.center + Vec3::from(moments.centroid.map(unit)) * node.radius,
            area,
            vector_area: Vec3::from(moments.vector_area.map(unit)) * area,
            normals: Vec3::from(moments.vector_area.map(unit)) * area,
            is_triangle: false,
            second_moment: Mat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]),
            color,
            node: Some(id),
            is_bare,
            half_thickness: attributes.half_thickness(),
            bend: 0.0,
        }
    }

    /// A triangle. Its shading normal is the mean of its corners', as a picture of triangles interpolates it.
    pub(super) fn of_triangle(corners: [Corner; 3], color: [u8; 4]) -> Self {
        let [a, b, c] = corners.map(|corner| corner.0);
        let vector_area = 0.5 * (b - a).cross(c - a);
        let shading: Vec3 = corners.iter().map(|c| c.1.normalize_or_zero()).sum();
        let face = vector_area.normalize_or_zero();
        let s = shading.normalize_or(face);
        Self {
            center: (a + b + c) / 3.0,
            area: vector_area.length(),
            vector_area,
            normals: s * vector_area.length(),
            is_triangle: true,
            second_moment: Mat3::ZERO,
            color,
            node: None,
            is_bare: false,
            half_thickness: 0.0,
            bend: corners
                .iter()
                .map(|c| match (c.1.normalize_or_zero(), face) {
                    (Vec3::ZERO, _) | (_, Vec3::ZERO) => 1.0,
                    (corner, face) => corner.cross(face).length().min(1.0),
                })
                .fold(0.0, f32::max),
        }
    }

    /// Points in one place without a neighbor to say what they stand for: a square of `side`, model units, in the plane of
    /// their normal.
    pub(super) fn alone(center: Vec3, normal: Option<Vec3>, color: [u8; 4], side: f32) -> Self {
        let area = side * side;
        let n = normal.unwrap_or(Vec3::ZERO);
        Self {
            center,
            area,
            vector_area: n * area,
            normals: n * area,
            is_triangle: true,
            second_moment: Mat3::ZERO,
            color,
            node: None,
            is_bare: normal.is_none(),
            half_thickness: 0.5 * side,
            bend: 1.0,
        }
    }

    /// A point of a cloud with the distance to its neighbors.
    pub(super) fn of_point(point: &Vertex, spacing: f32) -> Self {
        let normal = (point.color[3] != 0).then(|| octahedral::decode(point.normal));
        let side = crate::tree::area_of_point(spacing).sqrt();
        Self {
            half_thickness: spacing,
            ..Self::alone(point.position, normal, point.color, side)
        }
    }
}
