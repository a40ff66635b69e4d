//! Photographs of a frame: those that were chosen for it, with what they hold.

use crate::projective::depth_map::PhotoDepth;
use crate::projective::look::{LookPhoto, LookSettings};
use crate::projective::projected::ProjectedPhoto;
use crate::projective::pyramid::PhotoPyramid;
use crate::projective::surface_rays::SurfaceRays;
use std::sync::Arc;

/// Photographs that a frame uses at most.
pub const MOST_PHOTOS: usize = 64;

/// A photograph that was chosen for a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct ChosenPhoto {
    /// Camera and place in the choice.
    pub photo: ProjectedPhoto,
    /// Pixels of the photograph.
    pub pixels: Arc<PhotoPyramid>,
    /// What it sees of the surface.
    pub depth: Arc<PhotoDepth>,
    /// Mask of the photograph, where it has one: what is dark is not used.
    pub mask: Option<Arc<PhotoPyramid>>,
}

impl ChosenPhoto {
    /// The photograph as the look takes it.
    pub fn look(&self) -> LookPhoto<'_> {
        LookPhoto {
            photo: &self.photo,
            pixels: &self.pixels,
            depth: &self.depth,
            mask: self.mask.as_deref(),
        }
    }
}

/// A photograph that is laid over a part of the picture, as it is: for a camera in its pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComparedPhoto {
    /// Place in the list of photographs.
    pub list_index: u32,
    /// Part of the picture's width, from the left, that shows it: 0 to 1.
    pub part: f32,
}

/// Photographs of a frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FramePhotos {
    /// Photographs that were chosen, at most [`MOST_PHOTOS`]; ties go to the first.
    pub photos: Vec<ChosenPhoto>,
    /// Direction that they were chosen for.
    pub direction: glam::Vec3,
    /// How they are weighed.
    pub settings: LookSettings,
    /// The one that is laid over a part of the picture.
    pub compared: Option<ComparedPhoto>,
}

impl FramePhotos {
    /// All as the look takes them.
    pub fn look(&self) -> Vec<LookPhoto<'_>> {
        self.photos.iter().map(ChosenPhoto::look).collect()
    }

    /// The photograph laid over the picture at a position of `width` columns, where it is.
    pub fn compared_at(&self, x: f32, width: u32) -> Option<&ChosenPhoto> {
        let compared = self.compared?;
        (x < compared.part * width as f32)
            .then(|| self.photos.get(compared.list_index as usize))
            .flatten()
    }

    /// Color of the photograph that is laid over a picture of `width` columns, at a position in pixels; `None` where none is or
    /// it does not reach.
    pub fn compared_color(
        &self,
        rays: &SurfaceRays,
        [x, y]: [f32; 2],
        width: u32,
    ) -> Option<[f32; 3]> {
        let chosen = self.compared_at(x, width)?;
        let place = chosen
            .photo
            .place(chosen.photo.center + rays.direction(x, y))?;
        let at = (place.pixel / chosen.photo.size).to_array();
        Some(chosen.pixels.sample(at, 0.0))
    }
}

/// Color that stands for a photograph by its index in the scene; red, green, blue, 0..=1.
pub fn photo_tint(index: u32) -> [f32; 3] {
    // Hues apart by the golden ratio, so that neighbors differ.
    let hue = (index as f32 * 0.618_034).fract() * 6.0;
    let channel = |offset: f32| {
        let distance = ((hue + offset) % 6.0 - 3.0).abs();
        0.25 + 0.75 * (distance - 1.0).clamp(0.0, 1.0)
    };
    [channel(0.0), channel(4.0), channel(2.0)]
}

/// Color of uncovered surface where it is marked.
pub const UNCOVERED: [f32; 3] = [1.0, 0.0, 1.0];
