//! A page moved from its own zero to that of the whole model, so that pages are drawn together.

use super::DecodedPage;
use crate::math::sphere::round_up;
use glam::{DVec3, Vec3};

/// A sphere of a page's coordinates in those of the model: its center moved and rounded to single precision, its radius
/// grown by the rounding, so that it contains the exact one.
pub(in crate::pages) fn moved_sphere(center: Vec3, radius: f32, base: DVec3) -> (Vec3, f32) {
    let exact = base + center.as_dvec3();
    let center = exact.as_vec3();
    let off = center.as_dvec3().distance(exact);
    let radius = match off > 0.0 {
        true => round_up(f64::from(radius) + off),
        false => radius,
    };
    (center, radius)
}

impl DecodedPage {
    /// The page in the coordinates of a model whose zero is at `origin` in world space. Vertices are rounded to
    /// single precision there: off by at most half a unit in the last place of each coordinate, as in a model that is read
    /// whole. Spheres grow by that.
    #[must_use]
    pub fn in_model_space(mut self, origin: DVec3) -> Self {
        let model = &mut self.model;
        let base = model.origin - origin;
        self.base = DVec3::ZERO;
        model.origin = origin;
        if base == DVec3::ZERO {
            return self;
        }
        for node in &mut *model.tree.nodes {
            (node.center, node.radius) = moved_sphere(node.center, node.radius, base);
        }
        for leaf in &mut *model.tree.leaves {
            (leaf.center, leaf.radius) = moved_sphere(leaf.center, leaf.radius, base);
        }
        for vertex in &mut model.vertices {
            vertex.position = (base + vertex.position.as_dvec3()).as_vec3();
        }
        let (center, radius) = moved_sphere(model.orbit_center, model.orbit_radius, base);
        (model.orbit_center, model.orbit_radius) = (center, radius);
        (model.min, model.max) = (center - radius, center + radius);
        self
    }
}
