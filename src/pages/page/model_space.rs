//! A page moved from its own zero to that of the whole model, so that pages are drawn together.

use super::DecodedPage;
use crate::math::sphere::round_up;
use fearless_simd::{Level, dispatch};
use glam::{DVec3, Vec3};

/// A sphere of a page's coordinates in those of the model: its center moved and rounded to single precision, its radius
/// grown by the rounding, so that it contains the exact one.
#[inline(always)]
pub(in crate::pages) fn moved_sphere(center: Vec3, radius: f32, base: DVec3) -> (Vec3, f32) {
    let exact = base + center.as_dvec3();
    let center = exact.as_vec3();
    let off = center.as_dvec3().distance(exact);
    let grown = round_up(f64::from(radius) + off);
    (center, if off > 0.0 { grown } else { radius })
}

impl DecodedPage {
    /// Tells whether all its spheres are finite in the coordinates of the whole model, in single precision.
    pub(in crate::pages) fn is_finite(&self) -> bool {
        let (model, base) = (&self.model, self.base);
        let is_sound = |center: Vec3, radius: f32| {
            let place = (center.as_dvec3() + base).as_vec3();
            // Zero times what is not finite is no number.
            let [x, y, z] = (place * 0.0).to_array();
            x + y + z + radius * 0.0 == 0.0
        };
        let (nodes, leaves) = (&*model.tree.nodes, &*model.tree.leaves);
        let mut all = is_sound(model.orbit_center, 0.0);
        dispatch!(Level::new(), _simd => {
            for node in nodes {
                all &= is_sound(node.center, node.radius);
            }
            for leaf in leaves {
                all &= is_sound(leaf.center, leaf.radius);
            }
        });
        all
    }

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
        let (nodes, leaves) = (&mut *model.tree.nodes, &mut *model.tree.leaves);
        // Loops without branches, so that they are vectors.
        dispatch!(Level::new(), _simd => {
            for node in nodes {
                (node.center, node.radius) = moved_sphere(node.center, node.radius, base);
            }
            for leaf in leaves {
                (leaf.center, leaf.radius) = moved_sphere(leaf.center, leaf.radius, base);
            }
            for vertex in &mut model.vertices {
                vertex.position = (base + vertex.position.as_dvec3()).as_vec3();
            }
        });
        let (center, radius) = moved_sphere(model.orbit_center, model.orbit_radius, base);
        (model.orbit_center, model.orbit_radius) = (center, radius);
        (model.min, model.max) = (center - radius, center + radius);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::{AlignedRecords, Leaf, Model, Tree};

    #[test]
    fn spheres_that_leave_single_precision_are_found() {
        let is_finite = |center: Vec3, radius: f32, base: f64| {
            let leaves = [Leaf { center, radius }; 3];
            let tree = Tree {
                leaves: AlignedRecords::from(&leaves[..]),
                ..Tree::default()
            };
            let page = DecodedPage {
                model: Model {
                    tree,
                    ..Model::default()
                },
                base: DVec3::X * base,
                children: None,
            };
            page.is_finite()
        };
        let most = f32::MAX;
        assert!(is_finite(Vec3::ONE, 1.0, 1e9));
        assert!(is_finite(Vec3::splat(most), most, 0.0));
        assert!(is_finite(Vec3::X * -most, most, f64::from(most)));
        assert!(!is_finite(Vec3::X * most, 1.0, f64::from(most)));
        assert!(!is_finite(Vec3::new(0.0, -f32::INFINITY, 0.0), 1.0, 0.0));
        assert!(!is_finite(Vec3::new(0.0, 0.0, f32::NAN), 1.0, 0.0));
        assert!(!is_finite(Vec3::ONE, f32::INFINITY, 0.0));
        assert!(!is_finite(Vec3::ONE, f32::NAN, 0.0));
    }
}
