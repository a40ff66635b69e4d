//! What a first view frames: all of a model but what lies far off.
//!
//! One stray triangle a thousand sizes away leaves the model a dot in the middle of nothing. The box between the twentieths
//! of the vertices, axis by axis, says where the model is, whatever the rest does.

use super::Model;
use glam::Vec3;
use rayon::prelude::*;

/// Vertices that are sorted to find the box.
const SAMPLES: usize = 1 << 14;

/// Far off is further from the middle of the box than this many times half its diagonal. The ground around a house is not.
pub(super) const FAR: f32 = 25.0;

/// Half diagonals beyond which points that calibrated cameras are strays: matches that are wrong, or of a far background. In
/// four reconstructions of two scenes the last real point is at 1.55 to 1.76, and the first stray at 2.5 or more.
pub(crate) const FAR_OF_SPARSE: f32 = 2.0;

/// The part of a model that a first view frames, where something lies far off; model space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FramedPart {
    /// Middle of the part's box.
    pub center: Vec3,
    /// Largest distance of a vertex of the part from it.
    pub radius: f32,
    /// Used vertices that lie far off.
    pub far_vertices: u64,
    /// Largest distance of one of them from the center.
    pub farthest: f32,
    /// Half diagonals of the box of most vertices beyond which something is far off.
    pub reach: f32,
}

/// The part that is framed where what lies beyond `far` half diagonals does not count; `None` when that is all.
pub(super) fn within(model: &Model, far: f32) -> Option<FramedPart> {
    let vertices = &model.vertices[..model.used_vertices as usize];
    let step = (vertices.len() / SAMPLES).max(1);
    let sample: Vec<Vec3> = vertices.iter().step_by(step).map(|v| v.position).collect();
    let rank = sample.len() / 20;
    if rank == 0 {
        return None;
    }
    let (mut low, mut high) = (Vec3::ZERO, Vec3::ZERO);
    for axis in 0..3 {
        let mut values: Vec<f32> = sample.iter().map(|p| p[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        (low[axis], high[axis]) = (values[rank], values[values.len() - 1 - rank]);
    }
    let middle = 0.5 * (low + high);
    let reach = far * 0.5 * (high - low).length();
    // Without a size nothing says what is far.
    if !(reach > 0.0 && reach.is_finite()) {
        return None;
    }
    let is_far = |p: Vec3| p.distance(middle) > reach;
    let corner = (model.min - middle).abs().max((model.max - middle).abs());
    if corner.length() <= reach {
        return None;
    }
    let near = CountedBox::of(
        vertices
            .par_iter()
            .map(|v| v.position)
            .filter(|&p| !is_far(p)),
    );
    let far_vertices = vertices.len() as u64 - near.count;
    if far_vertices == 0 {
        return None;
    }
    let center = 0.5 * (near.min + near.max);
    let largest = |far: bool| {
        vertices
            .par_iter()
            .map(|v| v.position)
            .filter(|&p| is_far(p) == far)
            .map(|p| p.distance(center))
            .reduce(|| 0.0, f32::max)
    };
    Some(FramedPart {
        center,
        radius: largest(false),
        far_vertices,
        farthest: largest(true),
        reach: far,
    })
}

impl Model {
    /// Frames what lies within so many half diagonals of the box of most vertices.
    pub(crate) fn frame_within(&mut self, far: f32) {
        self.framed = within(self, far);
    }
}

/// A box and the number of points in it.
#[derive(Debug, Clone, Copy)]
struct CountedBox {
    min: Vec3,
    max: Vec3,
    count: u64,
}

impl CountedBox {
    fn of(points: impl ParallelIterator<Item = Vec3>) -> Self {
        let point = |p| Self {
            min: p,
            max: p,
            count: 1,
        };
        let none = || Self {
            min: Vec3::INFINITY,
            max: Vec3::NEG_INFINITY,
            count: 0,
        };
        points.map(point).reduce(none, |a, b| Self {
            min: a.min.min(b.min),
            max: a.max.max(b.max),
            count: a.count + b.count,
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use crate::mesh::Mesh;
    use crate::progress::SilentProgress;
    use crate::tree::{BuildOptions, Model, build};
    use glam::{DVec3, Vec3};

    /// A grid of 20 by 20 points, and one triangle `distance` away.
    fn model(distance: f32) -> Model {
        let mut positions: Vec<Vec3> = (0..400)
            .map(|i| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0))
            .collect();
        let mut triangles: Vec<[u32; 3]> = (0..379).map(|i| [i, i + 1, i + 20]).collect();
        positions.extend([Vec3::X, Vec3::Y, Vec3::Z].map(|p| p + Vec3::X * distance));
        triangles.push([400, 401, 402]);
        let mesh = Mesh {
            positions,
            triangles,
            origin: DVec3::Y * 7.0,
            ..Mesh::default()
        };
        build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
    }

    #[test]
    fn what_lies_far_off_is_not_framed() {
        let far = model(50_000.0);
        let framed = far.framed.unwrap();
        assert_eq!(framed.far_vertices, 3);
        assert!((framed.farthest - 50_000.0).abs() < 20.0, "{framed:?}");
        let sphere = far.orbit_sphere();
        assert!(sphere.center.distance(DVec3::new(9.5, 16.5, 0.0)) < 1e-3);
        assert!((sphere.radius - 9.5 * 2f64.sqrt()).abs() < 1e-3);
        // The facts are of all of it.
        assert!(far.orbit_radius > 20_000.0 && far.max.x > 49_999.0);
        let near = model(100.0);
        assert_eq!(near.framed, None);
        assert!(near.orbit_sphere().radius > 50.0);
        assert_eq!(Model::default().framed, None);
    }
}
