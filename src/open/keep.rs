//! Parts of opened models.

use super::OpenedModel;
use crate::Error;
use crate::input::{self, FilteredPoints, PointFilter, ReadWarning};
use crate::mesh::Mesh;
use crate::mesh::attributes::{AttributeColumn, PointAttributes};
use crate::progress::Progress;
use crate::tree::{self, BuildOptions, Model};
use glam::Vec3;
use std::path::Path;

/// Builds the tree, and puts what the points of a cloud carry into its order.
pub(super) fn build(
    mesh: Mesh,
    options: &BuildOptions,
    attributes: &mut PointAttributes,
    progress: &dyn Progress,
) -> Result<Model, tree::Error> {
    // Colors by categories come from a column.
    if attributes.is_empty() || !mesh.is_cloud() {
        return tree::build(mesh, options, progress);
    }
    let (mut model, order) = tree::build_ordered(mesh, options, progress)?;
    if attributes.are_colors_categories {
        model.color_by_majority();
    }
    attributes.reorder(&order);
    Ok(model)
}

/// Marks the leaves of a model that a filter keeps; its attributes are in the order of the model's points. `name` is for
/// messages.
///
/// # Errors
/// [`input::Error::UnknownField`], [`input::Error::NothingKept`].
pub(crate) fn kept_leaves(
    model: &Model,
    attributes: &PointAttributes,
    filter: &PointFilter,
    name: &str,
) -> Result<Vec<bool>, input::Error> {
    let place = |leaf: usize| match model.triangles.get(leaf) {
        None => model.vertices[leaf].position,
        Some(triangle) => {
            let corners = triangle.map(|corner| model.vertices[corner as usize].position);
            corners.iter().sum::<Vec3>() / 3.0
        }
    };
    let none = PointAttributes::default();
    let is_cloud = model.kind().is_points();
    let mask = filter.mask(&FilteredPoints {
        path: Path::new(name),
        count: model.tree.leaves.len(),
        place: &place,
        origin: model.origin,
        attributes: if is_cloud { attributes } else { &none },
    })?;
    if mask.contains(&true) {
        return Ok(mask);
    }
    Err(input::Error::NothingKept {
        path: name.into(),
        count: mask.len() as u64,
        what: what_leaves_are(model),
        filter: filter.to_string(),
    })
}

/// `points` or `triangles`.
fn what_leaves_are(model: &Model) -> &'static str {
    if model.triangles.is_empty() {
        "points"
    } else {
        "triangles"
    }
}

/// The part of a model whose leaves are marked, and what its points carry.
///
/// # Errors
/// A choice for another number of leaves; cancelled.
pub(crate) fn kept_part(
    (model, attributes): (&Model, &PointAttributes),
    mask: &[bool],
    progress: &dyn Progress,
) -> Result<(Model, PointAttributes), tree::Error> {
    let kept: Vec<u32> = (0..mask.len() as u32)
        .filter(|&leaf| mask[leaf as usize])
        .collect();
    let columns = match model.kind().is_points() {
        true => attributes.columns.as_slice(),
        false => &[],
    };
    let columns = columns.iter().map(|column| AttributeColumn {
        values: column.values.ordered(&kept),
        name: column.name.clone(),
        ..*column
    });
    let attributes = PointAttributes {
        columns: columns.collect(),
        grid: attributes.grid,
        are_colors_categories: attributes.are_colors_categories,
    };
    let mut part = model.kept(mask, progress)?;
    if attributes.are_colors_categories {
        part.color_by_majority();
    }
    Ok((part, attributes))
}

impl OpenedModel {
    /// Tells whether its leaves are points.
    pub fn has_points(&self) -> bool {
        match &self.paged {
            Some(file) => !file.is_surface(),
            None => self.model.kind().is_points(),
        }
    }

    /// The part of the model that a filter keeps, with a remark on how much that is.
    ///
    /// # Errors
    /// [`input::Error::UnknownField`], [`input::Error::NothingKept`]; a paged file that is not in memory; cancelled.
    pub fn kept(mut self, filter: &PointFilter, progress: &dyn Progress) -> Result<Self, Error> {
        let mask = kept_leaves(&self.model, &self.attributes, filter, &self.name)?;
        let what = what_leaves_are(&self.model);
        (self.model, self.attributes) =
            kept_part((&self.model, &self.attributes), &mask, progress)?;
        self.warnings.push(ReadWarning::PartKept {
            kept: self.model.tree.leaves.len() as u64,
            count: mask.len() as u64,
            what,
            filter: filter.to_string(),
        });
        Ok(self)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::input::{ColorSetting, PointColoring};
    use crate::open::OpenOptions;
    use crate::progress::SilentProgress;
    use std::collections::BTreeSet;

    #[test]
    fn nodes_of_categories_have_no_color_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let row = |i: u32| format!("{},{},0,{},{i}\n", i % 20, i / 20, 2 + i % 3);
        let rows: String = (0..400).map(row).collect();
        std::fs::write(&path, format!("x,y,z,class,intensity\n{rows}")).unwrap();
        let opened = |name: &str| {
            let mut options = OpenOptions::default();
            options.input.color = Some(ColorSetting {
                by: PointColoring::Attribute(name.to_owned()),
                range: None,
            });
            crate::open(&path, &options, &SilentProgress).unwrap()
        };
        let colors_of = |model: &Model| {
            let rgb = |[red, green, blue, _]: [u8; 4]| [red, green, blue];
            let points: BTreeSet<_> = model.vertices.iter().map(|v| rgb(v.color)).collect();
            let nodes: BTreeSet<_> = (model.tree.attributes.iter())
                .map(|own| rgb(own.color))
                .collect();
            (points, nodes)
        };
        let classes = opened("class");
        let mask: Vec<bool> = (0..400).map(|i| i % 4 != 0).collect();
        let whole = (&classes.model, &classes.attributes);
        let (part, _) = kept_part(whole, &mask, &SilentProgress).unwrap();
        for model in [&classes.model, &part] {
            let (points, nodes) = colors_of(model);
            assert!(points.len() == 3 && nodes.is_subset(&points), "{nodes:?}");
        }
        // Quantities have means.
        let (points, nodes) = colors_of(&opened("intensity").model);
        assert!(!nodes.is_subset(&points));
    }
}
