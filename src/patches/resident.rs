//! What drawing keeps of the records of a model: a polygon and two conditions a node.

use super::build;
use super::conditions::PatchConditions;
use super::record::NodePatch;
use crate::abi::OrientedPolygon;
use crate::progress::Progress;
use crate::tree::{Error, Model};
use rayon::prelude::*;

/// The nodes of a model as polygons, with what decides when each is drawn so: 184 bytes a node, some 61 a triangle.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ResidentPatches {
    polygons: Vec<OrientedPolygon>,
    /// By means of residuals, and strict.
    conditions: [PatchConditions; 2],
}

impl ResidentPatches {
    /// Makes the records of a model, and keeps what drawing needs. Memory and time as [`build`](super::build()); until it
    /// returns the full records are there as well.
    ///
    /// # Errors
    /// As there.
    pub fn build(model: &Model, progress: &dyn Progress) -> Result<Self, Error> {
        let patches = build::build(model, progress)?;
        let conditions =
            [false, true].map(|is_strict| PatchConditions::new(model, &patches, is_strict));
        Ok(Self {
            polygons: patches.records.par_iter().map(NodePatch::polygon).collect(),
            conditions,
        })
    }

    /// A polygon for each node of the tree, in its order; none of a cloud.
    pub fn polygons(&self) -> &[OrientedPolygon] {
        &self.polygons
    }

    /// Conditions by means of residuals, or strict ones.
    pub fn conditions(&self, is_strict: bool) -> &PatchConditions {
        &self.conditions[usize::from(is_strict)]
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        let conditions: usize = self.conditions.iter().map(PatchConditions::bytes).sum();
        size_of_val(&self.polygons[..]) + conditions
    }
}
