//! Edges that make silhouettes: open ones and sharp ones, as flags of leaves.
//!
//! Edges are matched by the positions of their ends, so that seams of doubled vertices are no edges of the surface. They are
//! sorted in passes, each of those whose first end lies in a range of vertices, so that the memory is bounded: 8 bytes a vertex,
//! and 16 bytes for each edge of a pass.

use super::record::NodePatch;
use crate::tree::{Model, geometric_normal};
use glam::DVec3;
use rayon::prelude::*;

/// Edges of a pass, about.
const PASS: usize = 6 << 20;

/// Cosine of the angle between neighbors beyond which the edge is sharp: 30 degrees.
const SHARP_COS: f64 = 0.866_025_403_784_438_6;

/// One side of an edge: its ends, the lower one first, and the triangle, whose lowest bit says which way the edge runs there.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct EdgeSide {
    ends: u64,
    triangle: u64,
}

/// For each vertex the first one, in order, at the same position.
fn welded(model: &Model) -> Vec<u32> {
    let key = |vertex: u32| {
        // Adding zero turns -0 into +0.
        let position = model.vertices[vertex as usize].position + glam::Vec3::ZERO;
        (position.to_array().map(f32::to_bits), vertex)
    };
    let mut order: Vec<u32> = (0..model.used_vertices).collect();
    order.par_sort_unstable_by_key(|&vertex| key(vertex));
    let mut first_of = vec![0; model.vertices.len()];
    let mut run = None;
    for &vertex in &order {
        let (position, _) = key(vertex);
        let first = match run {
            Some((same, first)) if same == position => first,
            _ => vertex,
        };
        run = Some((position, first));
        first_of[vertex as usize] = first;
    }
    first_of
}

/// [`NodePatch::OPEN_EDGE`] and [`NodePatch::SHARP_EDGE`] of each triangle. Triangles whose corners coincide have no edges.
pub(super) fn leaf_flags(model: &Model) -> Vec<u8> {
    let mut flags = vec![0; model.triangles.len()];
    let welded = welded(model);
    let passes = (3 * model.triangles.len()).div_ceil(PASS).max(1);
    let vertices = model.used_vertices as usize;
    let bound = |pass: usize| (vertices * pass).div_ceil(passes) as u32;
    let mut sides: Vec<EdgeSide> = Vec::new();
    for pass in 0..passes {
        let range = bound(pass)..bound(pass + 1);
        sides.clear();
        sides.par_extend(
            (0..model.triangles.len())
                .into_par_iter()
                .flat_map_iter(|triangle| {
                    let corners = model.triangles[triangle].map(|corner| welded[corner as usize]);
                    let [a, b, c] = corners;
                    let has_edges = a != b && b != c && c != a;
                    let range = range.clone();
                    let edges = [(a, b), (b, c), (c, a)];
                    edges
                        .into_iter()
                        .filter(move |_| has_edges)
                        .filter_map(move |(from, to)| {
                            let (low, high) = (from.min(to), from.max(to));
                            range.contains(&low).then_some(EdgeSide {
                                ends: u64::from(low) << 32 | u64::from(high),
                                triangle: (triangle as u64) << 1 | u64::from(from < to),
                            })
                        })
                }),
        );
        sides.par_sort_unstable();
        for edge in sides.chunk_by(|a, b| a.ends == b.ends) {
            let flag = flag_of(model, edge);
            if flag != 0 {
                for side in edge {
                    flags[(side.triangle >> 1) as usize] |= flag;
                }
            }
        }
    }
    flags
}

fn flag_of(model: &Model, edge: &[EdgeSide]) -> u8 {
    let &[one, two] = edge else {
        return NodePatch::OPEN_EDGE;
    };
    // Where both run the same way the two sides are not sides of one surface.
    if one.triangle & 1 == two.triangle & 1 {
        return NodePatch::OPEN_EDGE;
    }
    let [one, two] = [one, two].map(|side| {
        let corners = model.triangles[(side.triangle >> 1) as usize];
        geometric_normal(corners.map(|corner| model.vertices[corner as usize].position)).0
    });
    let is_known = one != DVec3::ZERO && two != DVec3::ZERO;
    if is_known && one.dot(two) < SHARP_COS {
        NodePatch::SHARP_EDGE
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;
    use crate::patches::tests::{of_mesh, sheet};
    use glam::Vec3;

    /// How many triangles have an open edge, and how many a sharp one.
    fn counts(mesh: Mesh) -> [usize; 2] {
        let flags = leaf_flags(&of_mesh(mesh));
        [NodePatch::OPEN_EDGE, NodePatch::SHARP_EDGE]
            .map(|flag| flags.iter().filter(|flags| *flags & flag != 0).count())
    }

    #[test]
    fn borders_are_open_and_folds_are_sharp() {
        let flat = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        // Of a sheet of 5 by 4 cells 18 triangles lie at the border; two of them, at corners, with two edges.
        assert_eq!(counts(sheet([5, 4], flat, |_, _| false)), [18 - 2, 0]);
        let fold = |angle: f32| {
            let (sin, cos) = angle.to_radians().sin_cos();
            let bend = move |x: f32, y: f32| {
                let beyond = (x - 0.5).max(0.0);
                Vec3::new(x.min(0.5) + beyond * cos, y, beyond * sin)
            };
            counts(sheet([4, 4], bend, |_, _| false))[1]
        };
        assert_eq!((fold(29.0), fold(31.0)), (0, 8));
    }

    #[test]
    fn doubled_vertices_are_no_border_and_three_triangles_at_an_edge_are() {
        let flat = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        let whole = sheet([4, 4], flat, |_, _| false);
        let mut apart = Mesh::default();
        for triangle in &whole.triangles {
            let first = apart.positions.len() as u32;
            (apart.positions).extend(triangle.map(|corner| whole.positions[corner as usize]));
            apart.triangles.push([first, first + 1, first + 2]);
        }
        assert_eq!(counts(apart), counts(whole.clone()));
        let mut fin = whole;
        let top = fin.positions.len() as u32;
        fin.positions.push(Vec3::new(0.5, 0.5, 1.0));
        // On an edge between two triangles in the middle.
        let open = counts(fin.clone())[0];
        fin.triangles.push([6, 7, top]);
        assert_eq!(counts(fin), [open + 3, 0]);
    }
}
