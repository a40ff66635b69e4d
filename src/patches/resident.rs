//! Records of a model as drawing keeps them: packed, and with what decides when each is drawn.

use super::build;
use super::conditions::{PatchCondition, PatchConditions};
use super::texture;
use crate::abi::{OrientedPolygon, PatchTexture};
use crate::progress::Progress;
use crate::tree::{Error, Model, PatchRecords};
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// The nodes of a model as polygons, with what decides when each is drawn so: 52 bytes a node (with colors 64), some 25 a
/// triangle; 32 more a node of a model with images. The processor's own drawing asks for [`ResidentPatches::polygons`] besides: 152 bytes a node.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ResidentPatches {
    records: Arc<PatchRecords>,
    /// One a record of a model with images.
    textures: Vec<PatchTexture>,
    polygons: OnceLock<Vec<OrientedPolygon>>,
    /// By means of residuals, and strict.
    conditions: [OnceLock<PatchConditions>; 2],
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
    /// Bytes in memory of a node beside its packed record, at most: its polygon and a condition.
    pub const NODE_BYTES: usize = size_of::<OrientedPolygon>() + size_of::<PatchCondition>();

    /// Takes the records that the model has, else makes them first. Those are packed too, so that the picture does not depend
    /// on where records come from. Memory and time of making them as [`build`](super::build()).
    ///
    /// # Errors
    /// As there.
    pub fn build(model: &Model, progress: &dyn Progress) -> Result<Self, Error> {
        let records = match &model.patches {
            Some(records) => records.clone(),
            None => Arc::new(packed_records(model, progress)?),
        };
        let made = Self {
            textures: texture::textures_of(model, &records),
            records,
            ..Self::default()
        };
        made.conditions(model, false);
        Ok(made)
    }

    /// The packed records, one for each node of the tree in its order; none of a cloud.
    pub fn records(&self) -> &PatchRecords {
        &self.records
    }

    /// Places in images, one for each record of a model with images; none of others.
    pub fn textures(&self) -> &[PatchTexture] {
        &self.textures
    }

    /// A polygon for each node of the tree, in its order; none of a cloud. Made at the first call. Those of nodes that are
    /// never drawn mean nothing.
    pub fn polygons(&self, model: &Model) -> &[OrientedPolygon] {
        let made = || {
            self.of_nodes(model, |records, index| {
                records.polygon(index, &model.tree.nodes[index])
            })
        };
        self.polygons.get_or_init(made)
    }

    /// Conditions by means of residuals, or strict ones. Made at the first call.
    pub fn conditions(&self, model: &Model, is_strict: bool) -> &PatchConditions {
        let made = || {
            let conditions = self.of_nodes(model, |records, index| {
                let node = &model.tree.nodes[index];
                let patch = records.record(index, node);
                PatchCondition::new(node, (&patch, self.textures.get(index)), is_strict)
            });
            PatchConditions::of_nodes(conditions, is_strict)
        };
        self.conditions[usize::from(is_strict)].get_or_init(made)
    }

    /// Something of each node that has a record.
    fn of_nodes<T: Send>(
        &self,
        model: &Model,
        make: impl Fn(&PatchRecords, usize) -> T + Sync + Send,
    ) -> Vec<T> {
        let count = self.records.records.len().min(model.tree.nodes.len());
        let indices = (0..count).into_par_iter().with_min_len(1024);
        indices.map(|index| make(&self.records, index)).collect()
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
            let of_read = ResidentPatches::build(&read, &SilentProgress).unwrap();
            assert_eq!(of_read, made);
            assert_eq!(of_read.polygons(&read), made.polygons(&model));
            let drawn = made.conditions(&model, false).nodes.iter();
            assert!(drawn.filter(|node| node.may_be_drawn()).count() > 100);
        }
    }

    #[test]
    fn records_without_sense_are_never_drawn() {
        let mut model = of_mesh(sheet([20, 20], |x, y| Vec3::new(x, y, 0.0), |_, _| false));
        add_records(&mut model, &SilentProgress).unwrap();
        let good = ResidentPatches::build(&model, &SilentProgress).unwrap();
        assert!(
            good.conditions(&model, false).nodes[0].may_be_drawn(),
            "one plane"
        );
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
                let conditions = found.conditions(&model, false);
                for (polygon, node) in found.polygons(&model).iter().zip(&conditions.nodes) {
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
