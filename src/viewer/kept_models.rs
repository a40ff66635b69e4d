//! Parts of models that a filter keeps, from trees that are there.

use crate::input::{self, ColorSetting, PointFilter};
use crate::mesh::attributes::PointAttributes;
use crate::open::keep::{kept_leaves, kept_part};
use crate::open::recolor::{CommonColors, RecoloredModel, common_range, recolor};
use crate::progress::Progress;
use crate::tree::Model;
use std::path::PathBuf;
use std::sync::Arc;

/// A model that parts are kept of, or such a part.
#[derive(Debug, Clone)]
pub struct WholeModel {
    /// Place where it came from.
    pub path: PathBuf,
    /// The model.
    pub model: Arc<Model>,
    /// Attributes of its points.
    pub attributes: Arc<PointAttributes>,
}

/// Parts and colors that are to be shown of models that are there.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PartWish {
    /// Conditions on the points that are kept.
    pub filter: PointFilter,
    /// Quantity that colors points; `None` for the colors that they were opened with.
    pub color: Option<ColorSetting>,
}

/// Makes what is wished for of models, and tells what other colors mean.
///
/// # Errors
/// A field or attribute that no model has, nothing kept, cancelled.
pub fn make(
    wholes: &[WholeModel],
    wish: &PartWish,
    progress: &dyn Progress,
) -> Result<(Vec<WholeModel>, Option<CommonColors>), crate::Error> {
    let mut parts = keep(wholes, &wish.filter, progress)?;
    let Some(setting) = &wish.color else {
        return Ok((parts, None));
    };
    progress.stage("coloring points", 0);
    // Of all points, so that a part has the colors that it has in the whole.
    let all = wholes.iter().map(|own| (&*own.model, &*own.attributes));
    let setting = &ColorSetting {
        range: setting.range.or_else(|| common_range(all, &setting.by)),
        ..setting.clone()
    };
    let names: Vec<String> = parts
        .iter()
        .map(|own| own.path.display().to_string())
        .collect();
    let own = parts.iter_mut().zip(&names);
    let mut models: Vec<RecoloredModel<'_>> = own
        .map(|(own, name)| RecoloredModel {
            name,
            model: Arc::make_mut(&mut own.model),
            attributes: Arc::make_mut(&mut own.attributes),
        })
        .collect();
    let common = recolor(&mut models, setting)?;
    Ok((parts, Some(common)))
}

/// Makes the parts of models that a filter keeps; a model of which everything is kept is the same again. Of conditions on a
/// field that only some models have, the others know nothing.
///
/// # Errors
/// A field that no model has, nothing kept, cancelled.
pub fn keep(
    wholes: &[WholeModel],
    filter: &PointFilter,
    progress: &dyn Progress,
) -> Result<Vec<WholeModel>, crate::Error> {
    let has_field = |condition: &PointFilter| {
        let mut wholes = wholes.iter();
        wholes.any(|own| !condition.known_to(&carried(own)).is_empty())
    };
    let singles = filter.conditions.iter().map(|condition| PointFilter {
        conditions: vec![condition.clone()],
    });
    let unknown = singles.filter(|condition| !has_field(condition));
    let unknown: Vec<PointFilter> = unknown.collect();
    let mut parts = Vec::with_capacity(wholes.len());
    let mut nothing = None;
    for own in wholes {
        let name = own.path.display().to_string();
        let known = match unknown.first() {
            None => filter.known_to(&carried(own)),
            // Says which field it is, and which there are.
            Some(condition) => condition.clone(),
        };
        if known.is_empty() {
            parts.push(own.clone());
            continue;
        }
        let mask = match kept_leaves(&own.model, &own.attributes, &known, &name) {
            Err(error @ input::Error::NothingKept { .. }) => {
                nothing.get_or_insert(error);
                vec![false; own.model.tree.leaves.len()]
            }
            mask => mask?,
        };
        let (model, attributes) = kept_part((&own.model, &own.attributes), &mask, progress)?;
        parts.push(WholeModel {
            path: own.path.clone(),
            model: Arc::new(model),
            attributes: Arc::new(attributes),
        });
    }
    let is_empty = parts.iter().all(|own| own.model.tree.leaves.is_empty());
    match nothing.filter(|_| is_empty) {
        Some(error) => Err(error.into()),
        None => Ok(parts),
    }
}

/// Attributes of the points of a model; none of a surface.
fn carried(own: &WholeModel) -> Arc<PointAttributes> {
    match own.model.kind().is_points() {
        true => own.attributes.clone(),
        false => Arc::default(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]
    use super::*;
    use crate::generate::{self, ShapeSpec};
    use crate::mesh::Mesh;
    use crate::mesh::attributes::{AttributeColumn, AttributeKind, AttributeValues, NumberType};
    use crate::progress::SilentProgress;
    use crate::tree::{BuildOptions, build, build_ordered};
    use glam::Vec3;

    /// A thousand points on a line, of classes 0 to 9.
    fn cloud() -> WholeModel {
        let mesh = Mesh {
            positions: (0..1000).map(|i| Vec3::X * i as f32).collect(),
            ..Mesh::default()
        };
        let (model, order) =
            build_ordered(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
        let values: Vec<u8> = (0..1000_u32).map(|i| (i % 10) as u8).collect();
        let mut attributes = PointAttributes {
            columns: vec![AttributeColumn {
                values: AttributeValues::of(values),
                ..AttributeColumn::new("class", AttributeKind::Category, NumberType::U8)
            }],
            grid: None,
            are_colors_categories: false,
        };
        attributes.reorder(&order);
        WholeModel {
            path: "cloud".into(),
            model: Arc::new(model),
            attributes: Arc::new(attributes),
        }
    }

    fn kept(wholes: &[WholeModel], text: &str) -> Result<Vec<WholeModel>, String> {
        let filter = PointFilter::of_words(text).unwrap();
        keep(wholes, &filter, &SilentProgress).map_err(|error| error.to_string())
    }

    #[test]
    fn parts_have_the_points_and_attributes_that_are_kept() {
        let whole = cloud();
        let parts = kept(std::slice::from_ref(&whole), "class=3,4 x=100..").unwrap();
        let (model, attributes) = (&parts[0].model, &parts[0].attributes);
        assert_eq!(model.tree.leaves.len(), 180);
        for (leaf, own) in model.tree.leaves.iter().enumerate() {
            let class = attributes.columns[0].value(leaf).unwrap();
            assert!([3.0, 4.0].contains(&class) && own.center.x >= 100.0);
            assert_eq!(f64::from(own.center.x) % 10.0, class);
        }
        assert!(crate::tree::check(model).is_clean());
        // Everything is the same again, not a copy.
        let all = kept(std::slice::from_ref(&whole), "").unwrap();
        assert!(Arc::ptr_eq(&all[0].model, &whole.model));
    }

    #[test]
    fn models_without_a_field_stay_beside_those_that_have_it() {
        let spec: ShapeSpec = "square:200".parse().unwrap();
        let surface = build(
            generate::mesh(&spec),
            &BuildOptions::default(),
            &SilentProgress,
        );
        let surface = WholeModel {
            path: "surface".into(),
            model: Arc::new(surface.unwrap()),
            attributes: Arc::default(),
        };
        let both = [surface.clone(), cloud()];
        let parts = kept(&both, "class=7").unwrap();
        assert!(Arc::ptr_eq(&parts[0].model, &surface.model));
        assert_eq!(parts[1].model.tree.leaves.len(), 100);
        // All of one and nothing of the other.
        let parts = kept(&both, "x=..10").unwrap();
        assert_eq!(
            parts[0].model.tree.leaves.len(),
            surface.model.tree.leaves.len()
        );
        assert_eq!(parts[1].model.tree.leaves.len(), 11);
        let parts = kept(&both, "x=500..").unwrap();
        assert!(parts[0].model.tree.leaves.is_empty());
        let error = kept(&both, "class=77 x=9000..").unwrap_err();
        assert!(error.contains("none of"), "{error}");
        let error = kept(&both, "label=1").unwrap_err();
        assert!(error.contains("no field `label`"), "{error}");
        let error = kept(&[surface], "class=1").unwrap_err();
        assert!(error.contains("x, y, z and height only"), "{error}");
    }
}
