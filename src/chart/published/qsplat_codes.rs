//! Costs of QSplat's codes of spheres and cones: errors of decoded spheres, and the part of what exact cones cull that
//! coded ones cull as well.

use crate::math::camera::View;
use crate::pages::qs::{QsNode, QsTree, of_model, qs_normal, to_bytes};
use crate::pages::quantize::{CONE_SINES, PageSphere, decode_sphere};
use crate::tree::{Model, NormalCone};
use glam::{DVec3, Vec3};
use std::collections::VecDeque;

/// Measurements of a model's tree in the codes of `.qs` files.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct CodeFindings {
    /// Bytes of a file over the number of leaves: without colors, with colors.
    pub(super) bytes_a_leaf: [f64; 2],
    /// Mean distance of decoded centers from true ones along an axis; decoded radius of the parent 1.
    pub(super) axis_error: f64,
    /// Mean of what decoded radii are larger; decoded radius of the parent 1.
    pub(super) radius_error: f64,
    /// Part of all leaves that lie below spheres that face away: by exact cones and spheres, by decoded ones.
    pub(super) culled: [f64; 2],
}

impl CodeFindings {
    /// Walks a model's tree beside its codes, as an eye sees it. `None` without leaves.
    pub(super) fn of(model: &Model, view: &View) -> Option<Self> {
        let tree = of_model(model)?;
        let leaves = tree.leaf_count() as f64;
        let bytes = [false, true].map(|has_colors| {
            let tree = QsTree {
                has_colors,
                ..tree.clone()
            };
            to_bytes(&tree).map_or(f64::NAN, |bytes| bytes.len() as f64 / leaves)
        });
        let mut found = Self {
            bytes_a_leaf: bytes,
            ..Self::default()
        };
        found.walk(model, &tree, view.eye);
        let count = tree.nodes.len().max(1) as f64;
        found.axis_error /= count;
        found.radius_error /= count;
        found.culled = found.culled.map(|sum| sum / leaves);
        Some(found)
    }

    /// Adds the errors of all nodes, and the leaves that are culled. Codes are in the order of the tree's levels.
    fn walk(&mut self, model: &Model, codes: &QsTree, eye: Vec3) {
        let tree = &model.tree;
        // Files have world positions, the tree those of the model.
        let root = PageSphere {
            center: (codes.root.center.as_dvec3() - model.origin).as_vec3(),
            ..codes.root
        };
        let mut parents = VecDeque::new();
        if !tree.nodes.is_empty() {
            parents.push_back((0u32, root, [false; 2]));
        }
        let mut codes = codes.nodes.iter();
        while let Some((id, parent, were_culled)) = parents.pop_front() {
            let holds_leaves = tree.nodes[id as usize].has_leaves();
            for (child, code) in tree.children(id).zip(codes.by_ref()) {
                let exact = match holds_leaves {
                    true => SeenSphere::of_leaf(model, child, code),
                    false => SeenSphere::of_node(model, child),
                };
                let sphere = decode_sphere(&parent, code.sphere);
                let scale = f64::from(parent.radius).max(f64::MIN_POSITIVE);
                let off = (sphere.center - exact.sphere.center).abs().as_dvec3();
                self.axis_error += (off.x + off.y + off.z) / 3.0 / scale;
                self.radius_error += f64::from(sphere.radius - exact.sphere.radius) / scale;
                let decoded = SeenSphere::decoded(sphere, code);
                let are_culled = [
                    were_culled[0] || exact.faces_away(eye),
                    were_culled[1] || decoded.faces_away(eye),
                ];
                match holds_leaves {
                    true => {
                        for (sum, is_culled) in self.culled.iter_mut().zip(are_culled) {
                            *sum += f64::from(u8::from(is_culled));
                        }
                    }
                    false => parents.push_back((child, sphere, are_culled)),
                }
            }
        }
    }
}

/// A sphere with the cone of what it holds.
#[derive(Debug, Clone, Copy)]
struct SeenSphere {
    sphere: PageSphere,
    axis: Vec3,
    /// Sine of the half angle, 1 of cones that never cull.
    sine: f64,
}

impl SeenSphere {
    fn of_node(model: &Model, id: u32) -> Self {
        let node = &model.tree.nodes[id as usize];
        Self {
            sphere: PageSphere {
                center: node.center,
                radius: node.radius,
            },
            axis: node.cone.axis(),
            sine: match node.cone.sin_half_angle {
                NormalCone::NEVER => 1.0,
                _ => f64::from(node.cone.sin_half_angle()),
            },
        }
    }

    /// A leaf has one normal, whose code is near enough: only its cone has a width that is not exact.
    fn of_leaf(model: &Model, leaf: u32, code: &QsNode) -> Self {
        let own = model.tree.leaves[leaf as usize];
        Self {
            sphere: PageSphere {
                center: own.center,
                radius: own.radius,
            },
            axis: qs_normal(code.normal),
            sine: if code.cone == 3 { 1.0 } else { 0.0 },
        }
    }

    fn decoded(sphere: PageSphere, code: &QsNode) -> Self {
        Self {
            sphere,
            axis: qs_normal(code.normal),
            sine: CONE_SINES[usize::from(code.cone.min(3))],
        }
    }

    /// Tells whether every normal of the cone points away from an eye at every point of the sphere: the least of
    /// n · (p - eye) is |c - eye| cos(t + a) - r, where t lies between the axis and c - eye, and a is the half angle.
    fn faces_away(&self, eye: Vec3) -> bool {
        if self.sine >= 1.0 {
            return false;
        }
        let to_center: DVec3 = (self.sphere.center - eye).as_dvec3();
        let axis = self.axis.as_dvec3();
        let along = axis.dot(to_center);
        let across = axis.cross(to_center).length();
        let cosine = (1.0 - self.sine * self.sine).sqrt();
        // Beyond a quarter turn the quotient of the two is no sine of t + a any more.
        along > 0.0 && along * cosine - across * self.sine >= f64::from(self.sphere.radius)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use crate::chart::run::orbit;
    use crate::generate::{self, GeneratedShape, ShapeSpec};
    use crate::progress::SilentProgress;
    use crate::tree::{self, BuildOptions};

    #[test]
    fn a_sphere_has_the_errors_and_the_back_that_it_should() {
        let spec = ShapeSpec::with_triangles(GeneratedShape::Sphere, 64_000).unwrap();
        let mesh = generate::mesh(&spec);
        let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
        let view = orbit(&model, (500, 500), 1.0, 0, 4).unwrap();
        let found = CodeFindings::of(&model, &view).unwrap();
        // 1.33 nodes a leaf of 4 or 6 bytes, and a pointer for each group of groups.
        let [plain, colored] = found.bytes_a_leaf;
        assert!(plain > 5.3 && plain < 6.0, "{plain}");
        assert!((colored - plain - 2.0 * 1.34).abs() < 0.05, "{colored}");
        // Uniform roundings to a grid of 2/13 have 1/26; the smallest that contains is larger than need be.
        assert!(found.axis_error > 0.02 && found.axis_error < 0.05);
        assert!(found.radius_error > 0.05 && found.radius_error < 0.2);
        // An eye at distance d sees (1 - 1/d)/2 of a sphere's area; triangles are smaller toward the poles.
        let distance = f64::from(view.eye.length() / model.orbit_radius);
        let hidden = (1.0 + 1.0 / distance) / 2.0;
        let [exact, coded] = found.culled;
        assert!((exact - hidden).abs() < 0.05, "{exact} of {hidden}");
        assert!(coded <= exact && coded > 0.8 * exact, "{coded} of {exact}");
    }
}
