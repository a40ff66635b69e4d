//! A sphere around all that is drawn together.

use crate::tree::Model;
use glam::Vec3;

/// A sphere around all parts, model space: distances of all are measured in one unit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WholeSphere {
    /// Center.
    pub center: Vec3,
    /// Radius.
    pub radius: f32,
}

impl WholeSphere {
    /// Sphere of a model's root.
    pub fn of(model: &Model) -> Self {
        let root = model.tree.nodes.first();
        let root = root.map(|node| (node.center, node.radius));
        let leaf = || {
            let leaf = model.tree.leaves.first()?;
            Some((leaf.center, leaf.radius))
        };
        let (center, radius) = root.or_else(leaf).unwrap_or((Vec3::ZERO, 1.0));
        Self { center, radius }
    }
}
