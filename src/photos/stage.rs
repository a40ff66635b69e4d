//! Photographs for any view, without a picture of it: those that are there are chosen by places of the surface that the view
//! sees, and given to a frame.
//!
//! Places are samples of the surface, the nearest to the eye in each cell of the picture. So the choice is a function of view
//! and model alone, and no picture has to be read back. Photographs of the last frame count a little more, so that a choice
//! does not flicker.

use crate::math::camera::View;
use crate::math::octahedral;
use crate::photos::choose::{WorthRows, most_worth_of_bounds, view_direction};
use crate::photos::error::PhotoError;
use crate::photos::gains::{exposure_gains, exposure_part, gain_of_view};
use crate::photos::library::{load_photo, load_thumbnail};
use crate::photos::look::{LookSettings, LookView, SurfacePixel, WeightForm, photo_weight};
use crate::photos::prepared::{PreparedPhoto, used_vertices};
use crate::photos::projected::ProjectedPhoto;
use crate::photos::pyramid::PhotoPyramid;
use crate::photos::scene::PhotoScene;
use crate::photos::surface::SurfaceDrawer;
use crate::progress::Progress;
use crate::projective::frame_photos::{ChosenPhoto, FramePhotos, MOST_PHOTOS};
use crate::projective::look::most_weight;
use crate::projective::surface_rays::SurfaceRays;
use crate::tree::Model;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Samples of the surface.
const SAMPLES: usize = 20_000;

/// Cells of the picture along its longer side: of each the nearest sample counts.
const CELLS: u32 = 24;

/// What a photograph of the last frame counts more than others.
const STAYS: f32 = 1.15;

/// A sample of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StagedSample {
    /// Place in model space.
    pub position: Vec3,
    /// Unit normal; zero where there is none.
    pub normal: Vec3,
}

/// What a stage needs to know of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct StageModel {
    /// Samples of its surface, evenly spread.
    pub samples: Vec<StagedSample>,
    /// Mean of its vertices.
    pub middle: Vec3,
    /// Corners of its box.
    pub bounds: [Vec3; 2],
}

impl StageModel {
    /// Samples a model: triangles by their area, points in their order.
    pub fn of(model: &Model) -> Self {
        let used = used_vertices(model);
        let middle =
            used.iter().map(|v| v.position.as_dvec3()).sum::<DVec3>() / used.len().max(1) as f64;
        let sample = |position, normal| StagedSample { position, normal };
        let samples = match model.triangles.is_empty() {
            true => {
                let step = used.len().div_ceil(SAMPLES).max(1);
                let of = |v: &crate::abi::Vertex| sample(v.position, octahedral::decode(v.normal));
                used.iter().step_by(step).map(of).collect()
            }
            false => {
                let corners =
                    |triangle: &[u32; 3]| triangle.map(|i| model.vertices[i as usize].position);
                let cross = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
                let area = |triangle| f64::from(cross(corners(triangle)).length());
                let whole: f64 = model.triangles.iter().map(area).sum();
                let (mut samples, mut before) = (Vec::with_capacity(SAMPLES), 0.0);
                for triangle in &model.triangles {
                    let after = before + area(triangle) / whole.max(f64::MIN_POSITIVE);
                    let [a, b, c] = corners(triangle);
                    let normal = cross([a, b, c]).normalize_or_zero();
                    // Sample k stands at (k + 1/2) / SAMPLES of the area.
                    while samples.len() < SAMPLES
                        && (samples.len() as f64 + 0.5) / (SAMPLES as f64) < after
                    {
                        // Places of low discrepancy (Roberts, 2018), folded into the triangle.
                        let k = samples.len() as f64;
                        let mut u = (0.5 + 0.754_877_666_246_692_8 * k).fract() as f32;
                        let mut v = (0.5 + 0.569_840_290_998_053_3 * k).fract() as f32;
                        if u + v > 1.0 {
                            (u, v) = (1.0 - u, 1.0 - v);
                        }
                        samples.push(sample(a + u * (b - a) + v * (c - a), normal));
                    }
                    before = after;
                }
                samples
            }
        };
        Self {
            samples,
            middle: middle.as_vec3(),
            bounds: [model.min, model.max],
        }
    }

    /// Places that a view sees: the nearest sample in each cell of the picture.
    fn places(&self, view: &View, rays: &SurfaceRays) -> Vec<SurfacePixel> {
        let cell = view.width.max(view.height).div_ceil(CELLS).max(1);
        let [columns, rows] = [view.width, view.height].map(|side| side.div_ceil(cell) as usize);
        let mut nearest: Vec<Option<(f32, u32, [u32; 2])>> = vec![None; columns * rows];
        for (index, sample) in (0..).zip(&self.samples) {
            let (x, y, distance) = view.project(sample.position);
            let is_seen = distance >= view.near
                && x >= 0.0
                && y >= 0.0
                && x < view.width as f32
                && y < view.height as f32;
            if !is_seen {
                continue;
            }
            let [column, row] = [x as u32, y as u32];
            let own = &mut nearest[(row / cell) as usize * columns + (column / cell) as usize];
            if own.is_none_or(|(other, ..)| distance < other) {
                *own = Some((distance, index, [column, row]));
            }
        }
        (nearest.into_iter().flatten())
            .map(|(distance, index, pixel)| {
                rays.pixel(pixel, distance, self.samples[index as usize].normal)
            })
            .collect()
    }
}

/// A photograph of a stage.
#[derive(Debug, Clone)]
pub struct StagedPhoto {
    /// Everything but its pixels.
    pub prepared: Arc<PreparedPhoto>,
    /// Pixels of the photograph, at first of a thumbnail.
    pub pixels: Arc<PhotoPyramid>,
    /// Pixels of a thumbnail.
    pub thumbnail: Arc<PhotoPyramid>,
    /// The pixels are more than a thumbnail's.
    pub is_whole: bool,
}

impl StagedPhoto {
    /// One with the pixels of a thumbnail.
    pub fn of_thumbnail(prepared: PreparedPhoto, thumbnail: Arc<PhotoPyramid>) -> Self {
        Self {
            prepared: Arc::new(prepared),
            pixels: thumbnail.clone(),
            thumbnail,
            is_whole: false,
        }
    }
}

/// Photographs of a scene on a model, as far as they are there.
#[derive(Debug)]
pub struct PhotoStage {
    model: StageModel,
    photos: Vec<Option<StagedPhoto>>,
    /// Gains of all that are there, from what they show in common.
    gains: Vec<Vec3>,
    /// Photographs that a frame uses at most.
    pub most: usize,
}

impl PhotoStage {
    /// A stage without photographs for a scene of so many.
    pub fn new(model: StageModel, photos: usize, most: usize) -> Self {
        Self {
            model,
            photos: vec![None; photos],
            gains: vec![Vec3::ONE; photos],
            most: most.clamp(1, MOST_PHOTOS),
        }
    }

    /// Readies all photographs of a scene that are there, with thumbnails; tells in sentences what could not be used.
    ///
    /// # Errors
    /// [`PhotoError::Usage`] where none is there or none shows the model, [`PhotoError::Cancelled`], or when the backend cannot
    /// draw.
    pub fn load(
        scene: &PhotoScene,
        drawer: &SurfaceDrawer<'_>,
        most: usize,
        longest_side: u32,
        progress: &dyn Progress,
    ) -> Result<(Self, Vec<String>), PhotoError> {
        let mut stage = Self::new(StageModel::of(drawer.model()), scene.photos.len(), most);
        let mut remarks = Vec::new();
        progress.stage("photographs", scene.photos.len() as u64);
        let thumbnails: Vec<_> = (scene.photos.par_iter())
            .map(|photo| photo.file.as_ref().map(|_| load_thumbnail(photo)))
            .collect();
        for (index, thumbnail) in thumbnails.into_iter().enumerate() {
            if progress.is_cancelled() {
                return Err(PhotoError::Cancelled);
            }
            progress.advance(1);
            let pixels = match thumbnail {
                None => continue,
                Some(Err(error)) => {
                    remarks.push(error.to_string());
                    continue;
                }
                Some(Ok(pixels)) => Arc::new(pixels),
            };
            let photo = &scene.photos[index];
            match PreparedPhoto::new(index, photo, drawer, &pixels, longest_side) {
                Ok(prepared) => stage.set(index, StagedPhoto::of_thumbnail(prepared, pixels)),
                Err(error @ (PhotoError::Decode { .. } | PhotoError::Read { .. })) => {
                    remarks.push(error.to_string());
                }
                Err(error) => return Err(error),
            }
        }
        stage.find_gains();
        stage.check(scene)?;
        Ok((stage, remarks))
    }

    /// Refuses a scene of which no photograph can be used.
    ///
    /// # Errors
    /// [`PhotoError::Usage`] with the cause.
    pub fn check(&self, scene: &PhotoScene) -> Result<(), PhotoError> {
        let mut there = self.photos.iter().flatten().peekable();
        let cause = if there.peek().is_none() {
            "no photograph is there or can be decoded; name the folder with the photographs"
        } else if there.all(|photo| !photo.prepared.shows_model()) {
            "no photograph shows the model; mesh and cameras are in different frames"
        } else {
            return Ok(());
        };
        Err(PhotoError::Usage(format!(
            "{}: {cause}",
            scene.path.display()
        )))
    }

    /// Decodes the photographs of this choice whole, those that are not yet, at most `longest_side` pixels long; tells in
    /// sentences which could not be.
    pub fn load_whole(
        &mut self,
        scene: &PhotoScene,
        chosen: &FramePhotos,
        longest_side: u32,
    ) -> Vec<String> {
        let wanted = chosen.photos.iter().map(|own| own.photo.index as usize);
        let wanted: Vec<usize> = wanted.filter(|index| !self.is_whole(*index)).collect();
        let loaded: Vec<_> = (wanted.par_iter())
            .map(|index| load_photo(&scene.photos[*index], longest_side))
            .collect();
        let mut remarks = Vec::new();
        for (index, result) in wanted.into_iter().zip(loaded) {
            match result {
                Ok(pixels) => self.set_pixels(index, Arc::new(pixels)),
                Err(error) => remarks.push(error.to_string()),
            }
        }
        remarks
    }

    /// Adds a photograph, or replaces it; [`find_gains`](Self::find_gains) is to be called once all are there.
    pub fn set(&mut self, index: usize, photo: StagedPhoto) {
        if let Some(own) = self.photos.get_mut(index) {
            *own = Some(photo);
        }
    }

    /// Gives a photograph its own pixels in place of a thumbnail's.
    pub fn set_pixels(&mut self, index: usize, pixels: Arc<PhotoPyramid>) {
        if let Some(Some(own)) = self.photos.get_mut(index) {
            (own.pixels, own.is_whole) = (pixels, true);
        }
    }

    /// Takes a thumbnail for the whole photograph, which cannot be decoded.
    pub fn keep_thumbnail(&mut self, index: usize) {
        if let Some(Some(own)) = self.photos.get_mut(index) {
            own.is_whole = true;
        }
    }

    /// Leaves whole photographs that a frame does not use, until those that are left take at most so many bytes: they are
    /// thumbnails again.
    pub fn drop_unused(&mut self, used: &FramePhotos, budget_bytes: u64) {
        let whole = || self.photos.iter().flatten().filter(|own| own.is_whole);
        let mut bytes: u64 = whole().map(|own| own.pixels.bytes()).sum();
        let is_used = |index: usize| {
            let mut all = used.photos.iter();
            all.any(|own| own.photo.index as usize == index)
        };
        for (index, own) in self.photos.iter_mut().enumerate() {
            let Some(own) = own.as_mut().filter(|own| own.is_whole) else {
                continue;
            };
            if bytes > budget_bytes && !is_used(index) {
                bytes -= own.pixels.bytes();
                (own.pixels, own.is_whole) = (own.thumbnail.clone(), false);
            }
        }
    }

    /// Samples of the surface.
    pub fn samples(&self) -> &[StagedSample] {
        &self.model.samples
    }

    /// The photographs, by their index in the scene.
    pub fn photos(&self) -> &[Option<StagedPhoto>] {
        &self.photos
    }

    /// Tells whether a photograph is there whole.
    pub fn is_whole(&self, index: usize) -> bool {
        matches!(self.photos.get(index), Some(Some(own)) if own.is_whole)
    }

    /// Brings the exposures of all that are there together.
    pub fn find_gains(&mut self) {
        let there: Vec<usize> = (0..self.photos.len())
            .filter(|i| self.photos[*i].is_some())
            .collect();
        let colors: Vec<_> = (there.iter())
            .filter_map(|i| Some(self.photos[*i].as_ref()?.prepared.colors.as_slice()))
            .collect();
        let gains: Vec<(usize, Vec3)> =
            there.iter().copied().zip(exposure_gains(&colors)).collect();
        self.set_gains(&gains);
    }

    /// Sets gains of photographs, by their index in the scene, that [`exposure_gains`] found.
    pub fn set_gains(&mut self, gains: &[(usize, Vec3)]) {
        for (index, gain) in gains {
            if let Some(own) = self.gains.get_mut(*index) {
                *own = *gain;
            }
        }
    }

    /// Photographs for a view: of those that `is_allowed` the ones that together serve best what it sees, in the order of the
    /// scene. `last` are the indices of those of the last frame.
    pub fn frame(
        &self,
        view: &View,
        settings: &LookSettings,
        is_allowed: &(dyn Fn(usize) -> bool + Sync),
        last: &[usize],
    ) -> FramePhotos {
        let rays = SurfaceRays::of(view);
        let eye = match view.is_perspective {
            true => view.eye,
            // Far before the model.
            false => {
                self.model.middle
                    + view.backward * (self.model.bounds[1] - self.model.bounds[0]).length()
            }
        };
        let direction = view_direction(eye, -view.backward, self.model.bounds, self.model.middle);
        let look_view = rays.look_view(direction);
        let allowed: Vec<usize> = (0..self.photos.len())
            .filter(|i| self.photos[*i].is_some() && is_allowed(*i))
            .collect();
        let places = self.model.places(view, &rays);
        let mut chosen: Vec<usize> = (0..allowed.len()).collect();
        let exact = |own: usize| self.worth(allowed[own], &places, &look_view, settings);
        // Bounds pay where most are not looked at.
        let are_bounds = allowed.len() > 2 * self.most;
        let most = |own: usize| self.most_worth(allowed[own], &places, &look_view, settings);
        let row = |own: &usize| if are_bounds { most(*own) } else { exact(*own) };
        let factor = |index: &usize| if last.contains(index) { STAYS } else { 1.0 };
        let mut worth = WorthRows {
            rows: chosen.par_iter().map(row).collect(),
            factors: allowed.iter().map(factor).collect(),
            are_bounds,
        };
        if allowed.len() > self.most {
            chosen = most_worth_of_bounds(&mut worth, self.most, exact);
            chosen.sort_unstable();
        }
        let of_view = match settings.gains {
            true => {
                let part = |own: usize| worth.rows[own].iter().copied().map(exposure_part).sum();
                gain_of_view(
                    chosen
                        .iter()
                        .map(|&own| (self.gains[allowed[own]], part(own))),
                )
            }
            false => Vec3::ONE,
        };
        let photo = |own: &usize| {
            let index = allowed[*own];
            let staged = self.photos[index].as_ref()?;
            Some(ChosenPhoto {
                photo: ProjectedPhoto {
                    gain: if settings.gains {
                        self.gains[index] / of_view
                    } else {
                        Vec3::ONE
                    },
                    ..staged.prepared.projected
                },
                pixels: staged.pixels.clone(),
                depth: staged.prepared.depth.clone(),
                mask: staged.prepared.mask.clone(),
            })
        };
        FramePhotos {
            photos: chosen.iter().filter_map(photo).collect(),
            direction,
            settings: *settings,
            compared: None,
        }
    }

    /// Most that a photograph may be worth at places, by directions alone where the form of the weights has such a bound.
    fn most_worth(
        &self,
        index: usize,
        places: &[SurfacePixel],
        view: &LookView,
        settings: &LookSettings,
    ) -> Vec<f32> {
        match &self.photos[index] {
            Some(staged) if settings.form == WeightForm::Quality => {
                let photo = &staged.prepared.projected;
                let most = |pixel: &SurfacePixel| {
                    most_weight(pixel, view.ray_to(pixel.position), photo, settings)
                };
                places.iter().map(most).collect()
            }
            _ => self.worth(index, places, view, settings),
        }
    }

    fn worth(
        &self,
        index: usize,
        places: &[SurfacePixel],
        view: &LookView,
        settings: &LookSettings,
    ) -> Vec<f32> {
        let nothing = PhotoPyramid::default();
        let Some(staged) = &self.photos[index] else {
            return vec![0.0; places.len()];
        };
        let look = staged.prepared.without_pixels(&nothing);
        places
            .iter()
            .map(|pixel| photo_weight(pixel, view, &look, settings))
            .collect()
    }
}
