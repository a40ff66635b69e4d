//! What drawing keeps of the records of a model: a polygon and two conditions a node.

use super::build;
use super::conditions::{PatchCondition, PatchConditions};
use crate::abi::OrientedPolygon;
use crate::progress::Progress;
use crate::tree::{Error, Model, PatchRecords};
use rayon::prelude::*;
use std::sync::Arc;

/// The nodes of a model as polygons, with what decides when each is drawn so: 184 bytes a node, some 80 a triangle.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ResidentPatches {
    polygons: Vec<OrientedPolygon>,
    /// By means of residuals, and strict.
    conditions: [PatchConditions; 2],
}

/// Makes the records of a model, packed as a tree file keeps them, unless it has them; they stay with the model. A cloud has
/// none. Memory and time as [`build`](super::build()).
///
/// # Errors
/// As there.
pub fn add_records(model: &mut Model, progress: &dyn Progress) -> Result<(), Error> {
    if model.patches.is_none() && model.kind().is_surface() {
        model.patches = Some(Arc::new(packed_records(model, progress)?));
    }
    Ok(())
}

fn packed_records(model: &Model, progress: &dyn Progress) -> Result<PatchRecords, Error> {
    Ok(PatchRecords::new(model, &build::build(model, progress)?))
}

impl ResidentPatches {
    /// Bytes in memory of a node.
    pub const NODE_BYTES: usize = size_of::<OrientedPolygon>() + 2 * size_of::<PatchCondition>();

    /// Makes what drawing needs from the records that the model has, else from records that are made first. Those are packed
    /// too, so that the picture does not depend on where records come from. Memory and time of making them as
    /// [`build`](super::build()).
    ///
    /// # Errors
    /// As there.
    pub fn build(model: &Model, progress: &dyn Progress) -> Result<Self, Error> {
        match &model.patches {
            Some(records) => Ok(Self::of_records(model, records)),
            None => Ok(Self::of_records(model, &packed_records(model, progress)?)),
        }
    }

    fn of_records(model: &Model, records: &PatchRecords) -> Self {
        let (mut polygons, mut means, mut strict) = (Vec::new(), Vec::new(), Vec::new());
        let nodes = model.tree.nodes.par_iter().enumerate().with_min_len(1024);
        let both = nodes.map(|(index, node)| {
            let patch = records.record(index, node);
            let conditions =
                [false, true].map(|is_strict| PatchCondition::new(node, &patch, is_strict));
            (patch.polygon(), conditions)
        });
        let mut conditions = Vec::new();
        match records.records.is_empty() {
            true => {}
            false => both.unzip_into_vecs(&mut polygons, &mut conditions),
        }
        for [mean, largest] in conditions {
            means.push(mean);
            strict.push(largest);
        }
        Self {
            polygons,
            conditions: [
                PatchConditions::of_nodes(means, false),
                PatchConditions::of_nodes(strict, true),
            ],
        }
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::patches::tests::{model_of, of_mesh, sheet};
    use crate::progress::SilentProgress;
    use crate::tree::{PackedPatch, file};
    use bytemuck::Zeroable;
    use glam::Vec3;

    /// A model whose records were written to a file and read back.
    fn through_file(mut model: Model) -> Model {
        add_records(&mut model, &SilentProgress).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.surfel");
        file::write(&model, &path).unwrap();
        file::read(&path).unwrap()
    }

    #[test]
    fn records_of_a_file_draw_what_those_made_now_draw() {
        let mut colored = model_of("torus:2000");
        colored.has_colors = true;
        for vertex in &mut colored.vertices {
            let at = vertex.position;
            vertex.color[0] = (at.x.abs() * 200.0) as u8;
        }
        for model in [model_of("sphere:5000"), colored] {
            let made = ResidentPatches::build(&model, &SilentProgress).unwrap();
            let read = through_file(model.clone());
            let colors = read.patches.as_ref().unwrap().colors.len();
            assert_eq!(colors > 0, model.has_colors);
            assert_eq!(
                ResidentPatches::build(&read, &SilentProgress).unwrap(),
                made
            );
            let drawn = made.conditions(false).nodes.iter();
            assert!(drawn.filter(|node| node.may_be_drawn()).count() > 100);
        }
    }

    #[test]
    fn records_without_sense_are_never_drawn() {
        let mut model = of_mesh(sheet([20, 20], |x, y| Vec3::new(x, y, 0.0), |_, _| false));
        add_records(&mut model, &SilentProgress).unwrap();
        let good = ResidentPatches::build(&model, &SilentProgress).unwrap();
        assert!(good.conditions(false).nodes[0].may_be_drawn(), "one plane");
        // Exponents of a change of shade that is beyond all numbers, and every byte of a record set to each of some values.
        let count = model.tree.nodes.len();
        for byte in 0..size_of::<PackedPatch>() {
            for value in [0, 1, 0x7f, 0x80, 0xff] {
                let mut records = vec![PackedPatch::zeroed(); count];
                let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut records);
                bytes.fill(value);
                for record in bytes.chunks_exact_mut(size_of::<PackedPatch>()) {
                    record[byte] ^= 0xff;
                }
                model.patches = Some(Arc::new(PatchRecords {
                    records,
                    colors: Vec::new(),
                }));
                let found = ResidentPatches::build(&model, &SilentProgress).unwrap();
                for (polygon, node) in found.polygons().iter().zip(&found.conditions[0].nodes) {
                    let OrientedPolygon {
                        center,
                        normal,
                        axis,
                        shading_normal,
                        shape_operator,
                        corners,
                        ..
                    } = polygon;
                    let is_finite = [center, normal, axis, shading_normal]
                        .iter()
                        .all(|v| v.is_finite())
                        && shape_operator.iter().all(|s| s.is_finite())
                        && corners.iter().flatten().all(|c| c.is_finite());
                    assert!(is_finite || !node.may_be_drawn(), "byte {byte} {value}");
                }
            }
        }
    }
}
