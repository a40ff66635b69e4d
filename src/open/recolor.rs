//! Other colors of models that are there: by what their points carry, over one range for all.

use super::OpenedModel;
use crate::input::{self, AttributeColors, AttributedPoints, ColorSetting, PointColoring};
use crate::mesh::attributes::PointAttributes;
use crate::mesh::color_legend::{ColorLegend, LegendEntries};
use crate::tree::Model;
use std::path::Path;

/// A model that takes other colors.
#[derive(Debug)]
pub struct RecoloredModel<'a> {
    /// Name of the file, for messages.
    pub name: &'a str,
    /// The model.
    pub model: &'a mut Model,
    /// Attributes of its points, in their order.
    pub attributes: &'a mut PointAttributes,
}

/// Meaning of the colors of several models.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonColors {
    /// Colors and values.
    pub legend: ColorLegend,
    /// Names of the models that have no such attribute, and keep their colors.
    pub without: Vec<String>,
}

/// Does something with the vertices of a model as they are colored; `None` for what is not in memory, and for attributes of a
/// surface.
fn with_points<T>(
    (model, attributes): (&Model, &PointAttributes),
    name: &str,
    by: &PointColoring,
    work: impl FnOnce(&AttributedPoints<'_>) -> T,
) -> Option<T> {
    let has_attributes = model.kind().is_points() || *by == PointColoring::Height;
    (has_attributes && !model.vertices.is_empty()).then(|| {
        work(&AttributedPoints {
            path: Path::new(name),
            count: model.vertices.len(),
            height: &|at| model.origin.z + f64::from(model.vertices[at].position.z),
            attributes,
        })
    })
}

/// Colors models by one setting; a range that is not given is around those of all. A surface has no attributes but its height.
///
/// # Errors
/// [`input::Error::UnknownAttribute`] where no model has the attribute.
pub fn recolor(
    models: &mut [RecoloredModel<'_>],
    setting: &ColorSetting,
) -> Result<CommonColors, input::Error> {
    let setting = ColorSetting {
        range: setting.range.or_else(|| {
            let models = models.iter().map(|own| (&*own.model, &*own.attributes));
            common_range(models, &setting.by)
        }),
        ..setting.clone()
    };
    let mut common: Option<ColorLegend> = None;
    let (mut without, mut fault) = (Vec::new(), None);
    for own in models {
        let points = (&*own.model, &*own.attributes);
        let found = with_points(points, own.name, &setting.by, |points| {
            points.colors(&setting)
        });
        let AttributeColors { colors, legend, .. } = match found {
            Some(Ok(found)) => found,
            unknown => {
                fault = fault.or(unknown.and_then(Result::err));
                without.push(own.name.to_owned());
                continue;
            }
        };
        let are_categories = matches!(legend.entries, LegendEntries::List(_));
        own.model.recolor(&colors, are_categories);
        own.attributes.are_colors_categories = are_categories;
        match &mut common {
            None => common = Some(legend),
            Some(common) => common.join(legend),
        }
    }
    let none = || input::Error::UnknownAttribute {
        path: without.join(", ").into(),
        name: setting.by.to_string(),
        known: "no points that carry anything".to_owned(),
    };
    match common {
        Some(legend) => Ok(CommonColors { legend, without }),
        None => Err(fault.unwrap_or_else(none)),
    }
}

/// The range around those of all models that have an attribute; `None` for categories, and where none has it.
pub fn common_range<'a>(
    models: impl IntoIterator<Item = (&'a Model, &'a PointAttributes)>,
    by: &PointColoring,
) -> Option<[f64; 2]> {
    let ranges = models.into_iter().filter_map(|own| {
        let range = with_points(own, "", by, |points| points.usual_range(by))?;
        range.ok().flatten()
    });
    ranges.reduce(|[low, high], [least, most]| [low.min(least), high.max(most)])
}

/// Refuses other colors of a model whose points carry nothing.
pub(super) fn refused(source: &Path, setting: &ColorSetting) -> input::Error {
    input::Error::UnknownAttribute {
        path: source.to_owned(),
        name: setting.by.to_string(),
        known: "nothing but its own colors (color the file that it is built from)".to_owned(),
    }
}

/// Colors opened models by one setting, as [`recolor`] does.
///
/// # Errors
/// [`input::Error::UnknownAttribute`] where no model has the attribute.
pub fn recolor_opened<'a>(
    models: impl IntoIterator<Item = &'a mut OpenedModel>,
    setting: &ColorSetting,
) -> Result<CommonColors, input::Error> {
    let own = |opened: &'a mut OpenedModel| RecoloredModel {
        name: &opened.name,
        model: &mut opened.model,
        attributes: &mut opened.attributes,
    };
    let mut models: Vec<RecoloredModel<'_>> = models.into_iter().map(own).collect();
    recolor(&mut models, setting)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::open::OpenOptions;
    use crate::progress::SilentProgress;

    /// A cloud of 20 x 20 points from a file; its intensity is ten times x, its class 2 to 4.
    fn opened(folder: &Path, name: &str, left: u32, color: Option<ColorSetting>) -> OpenedModel {
        let path = folder.join(name);
        let row = |i: u32| {
            let x = left + i % 20;
            format!("{x},{},{},{},{}\n", i / 20, i / 20, 2 + i % 3, 10 * x)
        };
        let rows: String = (0..400).map(row).collect();
        std::fs::write(&path, format!("x,y,z,class,intensity\n{rows}")).unwrap();
        let mut options = OpenOptions::default();
        options.input.color = color;
        crate::open(&path, &options, &SilentProgress).unwrap()
    }

    fn setting(name: &str, range: Option<[f64; 2]>) -> ColorSetting {
        let by = name.parse().unwrap();
        ColorSetting { by, range }
    }

    fn colors(model: &Model) -> Vec<[u8; 4]> {
        let nodes = model.tree.attributes.iter().map(|own| own.color);
        let points = model.vertices.iter().map(|own| own.color);
        points.chain(nodes).collect()
    }

    #[test]
    fn other_colors_are_those_of_opening_with_them() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["intensity", "class", "height"] {
            let wanted = opened(folder.path(), "a.csv", 5, Some(setting(name, None)));
            let mut own = opened(folder.path(), "a.csv", 5, None);
            let common = recolor_opened([&mut own], &setting(name, None)).unwrap();
            assert_eq!(
                Some(&common.legend),
                input::legend_of(&wanted.warnings),
                "{name}"
            );
            for (own, wanted) in colors(&own.model).iter().zip(colors(&wanted.model)) {
                let apart = (0..4).map(|c| own[c].abs_diff(wanted[c])).max();
                assert!(apart <= Some(1), "{name}: {own:?}, {wanted:?}");
            }
            assert_eq!(own.attributes.are_colors_categories, name == "class");
        }
    }

    #[test]
    fn several_models_have_one_range_and_one_legend() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let mut models = [
            opened(at, "left.csv", 0, None),
            opened(at, "right.csv", 20, None),
        ];
        let common = recolor_opened(&mut models, &setting("intensity", None)).unwrap();
        // Two hundredths at each end of each: 20 points have one value, so no value is left out.
        assert_eq!(common.legend.range(), Some([0.0, 390.0]));
        assert!(common.without.is_empty());
        // Points of the same intensity would have the same color: that of the right begins where that of the left ends.
        let of_value = |opened: &OpenedModel, value: f64| {
            let column = opened.attributes.find("intensity").unwrap();
            let at = (0..400).position(|i| column.value(i) == Some(value));
            f64::from(opened.model.vertices[at.unwrap()].color[1])
        };
        let [end, start] = [of_value(&models[0], 190.0), of_value(&models[1], 200.0)];
        assert!(start > end && start - end < 8.0, "{end} {start}");
        // Categories of both, once each; what has none of them keeps its colors.
        let mut plain = opened(at, "plain.csv", 0, None);
        plain.attributes = PointAttributes::default();
        let before = colors(&plain.model);
        let all = models.iter_mut().chain([&mut plain]);
        let common = recolor_opened(all, &setting("class", None)).unwrap();
        let LegendEntries::List(entries) = &common.legend.entries else {
            panic!("{common:?}")
        };
        let names: Vec<&str> = entries.iter().map(|(_, name)| name.as_str()).collect();
        assert_eq!(
            names,
            ["2 ground", "3 low vegetation", "4 medium vegetation"]
        );
        assert!(common.without.len() == 1 && common.without[0].ends_with("plain.csv"));
        assert_eq!(colors(&plain.model), before);
        let error = recolor_opened([&mut plain], &setting("class", None)).unwrap_err();
        assert!(error.to_string().contains("class"), "{error}");
    }
}
