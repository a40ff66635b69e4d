//! Models that were loaded: what of them is shown together.

use super::kept_models::WholeModel;
use super::text::unopened;
use crate::gpu;
use crate::input::{ColorSetting, FilePart, ReadWarning, set_legend};
use crate::math::up_axis::UpAxis;
use crate::mesh::attributes::PointAttributes;
use crate::mesh::color_legend::ColorLegend;
use crate::mesh::placement::MeshPlacement;
use crate::open::PageReading;
use crate::open::recolor::{CommonColors, RecoloredModel, recolor};
use crate::progress::Progress;
use crate::render::paged_model::PagedModel;
use crate::render::vulkan::scene::DeviceScene;
use crate::tree::Model;
use std::path::PathBuf;
use std::sync::Arc;

/// Why a model could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The model could not be opened, or not be copied to the device.
    #[error(transparent)]
    Open(#[from] crate::Error),
    /// The system has no thread left.
    #[error(transparent)]
    Thread(std::io::Error),
    /// The thread panicked; its message is on standard error.
    #[error("loading stopped unexpectedly")]
    Stopped,
}

impl From<gpu::Error> for LoadError {
    fn from(error: gpu::Error) -> Self {
        Self::Open(error.into())
    }
}

/// Model that is to be opened, and its differences from the options of all.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelRequest {
    /// Name of the model: a path, an address or a generator.
    pub path: PathBuf,
    /// Place and color of the model.
    pub placement: MeshPlacement,
    /// Crease angle of [`crate::tree::BuildOptions`].
    pub crease_degrees: Option<f32>,
    /// Position of being first: its points are colored as it is opened, those of the others once all are there.
    pub is_first: bool,
    /// Amount of a paged file that is read.
    pub page_reading: PageReading,
}

/// A model that was loaded.
#[derive(Debug, Default)]
pub struct LoadedModel {
    /// The model.
    pub model: Arc<Model>,
    /// Paged file that the model stands in for.
    pub pages: Option<PagedModel>,
    /// The axis that is up.
    pub up: UpAxis,
    /// Remarks on what of its file was repaired or left out.
    pub warnings: Vec<ReadWarning>,
    /// Text of the coordinate system that the file names.
    pub coordinate_system: Option<String>,
    /// Attributes of its points, in the order of the model's.
    pub attributes: Arc<PointAttributes>,
    /// Models that are drawn with it, in its space.
    pub more: Vec<LoadedPart>,
    /// Sentences about models that were to be drawn with it and could not be opened.
    pub failures: Vec<String>,
    /// Buffers of the models that are on the device already.
    pub scene: Option<DeviceScene>,
    /// A coarse one; the model itself is still to come.
    pub is_preview: bool,
    /// A preview of a few points: the box of all is not known yet.
    pub is_sample: bool,
    /// Parts of models that are there.
    pub is_part: bool,
    /// Meaning of the colors of parts, where they are others than those of the whole.
    pub legend: Option<ColorLegend>,
}

/// A model that is drawn with another.
#[derive(Debug, Default)]
pub struct LoadedPart {
    /// Name that the model was opened by.
    pub path: PathBuf,
    /// The model.
    pub model: Arc<Model>,
    /// Paged file that the model stands in for.
    pub pages: Option<PagedModel>,
    /// Remarks on what of its file was repaired or left out.
    pub warnings: Vec<ReadWarning>,
    /// Attributes of its points, in the order of the model's.
    pub attributes: Arc<PointAttributes>,
}

impl LoadedModel {
    /// Parts of models that are there.
    pub fn of_parts((parts, common): (Vec<WholeModel>, Option<CommonColors>)) -> Self {
        let part = |own: WholeModel| LoadedPart {
            path: own.path,
            model: own.model,
            attributes: own.attributes,
            ..LoadedPart::default()
        };
        let mut parts = parts.into_iter().map(part);
        let first = parts.next().unwrap_or_default();
        Self {
            model: first.model,
            attributes: first.attributes,
            more: parts.collect(),
            is_part: true,
            legend: common.map(|common| common.legend),
            ..Self::default()
        }
    }

    /// Colors the points of this model and others over the range of all; those that were given a color keep it.
    pub fn share_colors(
        &mut self,
        (own, others): (&ModelRequest, &mut [(ModelRequest, Self)]),
        setting: &ColorSetting,
    ) {
        let others = others
            .iter_mut()
            .map(|(request, other)| (&*request, &mut *other));
        let all = [(own, &mut *self)].into_iter().chain(others);
        let names: Vec<(String, &mut Self)> = all
            .filter(|(request, loaded)| request.placement.color.is_none() && loaded.pages.is_none())
            .map(|(request, loaded)| (request.path.display().to_string(), loaded))
            .collect();
        let mut warned = Vec::new();
        let mut models = Vec::new();
        for (name, loaded) in names {
            models.push((name, &mut loaded.model, &mut loaded.attributes));
            warned.push(&mut loaded.warnings);
        }
        let mut recolored: Vec<RecoloredModel<'_>> = models
            .iter_mut()
            .map(|(name, model, attributes)| RecoloredModel {
                name,
                model: Arc::make_mut(model),
                attributes: Arc::make_mut(attributes),
            })
            .collect();
        // Where none has the attribute the first could not be opened.
        let Ok(common) = recolor(&mut recolored, setting) else {
            return;
        };
        for warnings in warned {
            set_legend(warnings, &common.legend);
        }
        let without = common.without.iter();
        let kept = without.map(|name| format!("{name} has no {} and keeps its colors", setting.by));
        self.failures.extend(kept);
    }

    /// Adds a model that was loaded alone, in the space of the first.
    pub fn add(&mut self, path: PathBuf, other: Self, progress: &dyn Progress) {
        let origin = self.model.origin;
        let mut attributes = other.attributes;
        let moved = match other.pages {
            Some(pages) => pages
                .moved_to(origin)
                .map(|pages| (Arc::new(pages.stand_in().clone()), Some(pages)))
                .map_err(crate::tree::Error::from),
            None => {
                let model = Arc::unwrap_or_clone(other.model);
                let own = Arc::make_mut(&mut attributes);
                (model.moved_to(origin, own, progress)).map(|model| (Arc::new(model), None))
            }
        };
        match moved {
            Ok((model, pages)) => self.more.push(LoadedPart {
                path,
                model,
                pages,
                warnings: other.warnings,
                attributes,
            }),
            Err(error) => {
                let error = LoadError::Open(error.into());
                self.failures.push(unopened(&path, &error.to_string()));
            }
        }
    }
}

/// The longest text of a coordinate system: files name theirs in several ways.
pub fn system_of(parts: &[FilePart]) -> Option<String> {
    let named = (parts.iter()).filter(|part| part.name == "coordinate system");
    let texts = named.map(|part| part.note.clone());
    texts
        .max_by_key(String::len)
        .filter(|text| !text.is_empty())
}
