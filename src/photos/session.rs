//! A model with its photographs: what is loaded and drawn once, and pictures of the model with photographs on it.

use crate::photos::choose::{
    cluster_normals, most_worth, nearest_directions, supplementary_photos, view_direction,
};
use crate::photos::error::PhotoError;
use crate::photos::gains::{exposure_gains, exposure_part, gain_of_view};
use crate::photos::library::PhotoLibrary;
use crate::photos::look::{
    LookPhoto, LookPixel, LookSettings, LookView, PhotoDirection, SurfacePixel, WeightForm,
    look_at_pixel, mean_at_pixel, photo_weight,
};
use crate::photos::prepared::{PreparedPhoto, color_at, used_vertices};
use crate::photos::projected::ProjectedPhoto;
use crate::photos::pyramid::PhotoPyramid;
use crate::photos::scene::{CalibratedCamera, PhotoScene};
use crate::photos::surface::{SurfaceDrawer, SurfacePicture};
use crate::progress::Progress;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Every so many pixels along each axis one stands for its neighbors when photographs are chosen.
const CHOICE_STEP: usize = 24;

/// Limits of what is chosen and kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SessionOptions {
    /// Longest side of the photographs in memory, pixels.
    pub longest_side: u32,
    /// Bytes of photographs in memory.
    pub budget_bytes: u64,
    /// Photographs that a frame uses at most, 1 to 64.
    pub most_photos: usize,
}

impl Default for SessionOptions {
    fn default() -> Self {
        Self {
            longest_side: 4096,
            budget_bytes: 2 << 30,
            most_photos: 16,
        }
    }
}

/// A model with its photographs.
#[derive(Debug)]
pub struct PhotoSession<'m> {
    scene: &'m PhotoScene,
    drawer: SurfaceDrawer<'m>,
    options: SessionOptions,
    library: PhotoLibrary,
    ready: Vec<Option<PreparedPhoto>>,
    middle: Vec3,
    /// Sentences on all that could not be used.
    pub remarks: Vec<String>,
}

/// Photographs that may be used for a picture.
#[derive(Debug, Clone, Copy)]
pub struct PhotoChoice<'a> {
    /// Indices in the scene.
    pub allowed: &'a [usize],
    /// Greatest number of photographs; `None`: as many as the session uses.
    pub most: Option<usize>,
    /// The mean of all of them at each pixel, as a texture of means has it.
    pub is_mean: bool,
}

impl<'a> PhotoChoice<'a> {
    /// Chooses among these as many as the session uses.
    pub fn of(allowed: &'a [usize]) -> Self {
        Self {
            allowed,
            most: None,
            is_mean: false,
        }
    }
}

/// A picture of the model with photographs on it.
#[derive(Debug, Clone, Default)]
pub struct PhotoPicture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Color and photograph of each pixel; weight 0 where no photograph shows it or nothing is there.
    pub pixels: Vec<LookPixel>,
    /// Indices in the scene of the photographs that were used; [`LookPixel::best`] counts in this list.
    pub chosen: Vec<usize>,
}

impl<'m> PhotoSession<'m> {
    /// Draws the depth map of every photograph that is there. Photographs that cannot be decoded are remarks.
    ///
    /// # Errors
    /// [`PhotoError::Usage`] where no photograph is there or none shows the model, [`PhotoError::Cancelled`], or when the
    /// backend cannot draw.
    pub fn new(
        scene: &'m PhotoScene,
        drawer: SurfaceDrawer<'m>,
        options: SessionOptions,
        progress: &dyn Progress,
    ) -> Result<Self, PhotoError> {
        let model = drawer.model();
        let used = used_vertices(model);
        let middle =
            used.iter().map(|v| v.position.as_dvec3()).sum::<DVec3>() / used.len().max(1) as f64;
        let mut session = Self {
            scene,
            library: PhotoLibrary::new(scene.photos.len(), options.budget_bytes),
            options,
            ready: Vec::new(),
            middle: middle.as_vec3(),
            remarks: Vec::new(),
            drawer,
        };
        progress.stage("photographs", scene.photos.len() as u64);
        for index in 0..scene.photos.len() {
            if progress.is_cancelled() {
                return Err(PhotoError::Cancelled);
            }
            let ready = match session.prepare(index) {
                Ok(ready) => ready,
                Err(error @ (PhotoError::Decode { .. } | PhotoError::Read { .. })) => {
                    session.remarks.push(error.to_string());
                    None
                }
                Err(error) => return Err(error),
            };
            session.ready.push(ready);
            progress.advance(1);
        }
        if session.ready.iter().flatten().next().is_none() {
            return Err(PhotoError::Usage(format!(
                "{}: no photograph is there or can be decoded; name the folder with the photographs",
                scene.path.display()
            )));
        }
        if session
            .ready
            .iter()
            .flatten()
            .all(|ready| !ready.shows_model())
        {
            return Err(PhotoError::Usage(format!(
                "{}: no photograph shows the model; mesh and cameras are in different frames",
                scene.path.display()
            )));
        }
        Ok(session)
    }

    fn prepare(&mut self, index: usize) -> Result<Option<PreparedPhoto>, PhotoError> {
        let photo = &self.scene.photos[index];
        if photo.file.is_none() {
            return Ok(None);
        }
        let longest = self.options.longest_side;
        let pixels = self.library.whole(index, photo, longest)?;
        PreparedPhoto::new(index, photo, &self.drawer, &pixels, longest).map(Some)
    }

    /// The scene.
    pub fn scene(&self) -> &'m PhotoScene {
        self.scene
    }

    /// Renderer of the surface.
    pub fn drawer(&self) -> &SurfaceDrawer<'m> {
        &self.drawer
    }

    /// Indices of the photographs that can be used.
    pub fn usable(&self) -> Vec<usize> {
        (0..self.ready.len())
            .filter(|i| self.ready[*i].is_some())
            .collect()
    }

    /// Gains of the given photographs from what they show in common, in their order.
    pub fn gains(&self, photos: &[usize]) -> Vec<Vec3> {
        let of = |i: &usize| {
            self.ready[*i]
                .as_ref()
                .map_or_else(Vec::new, |ready| ready.colors.clone())
        };
        exposure_gains(&photos.iter().map(of).collect::<Vec<_>>())
    }

    /// Gains that bring photographs to the exposure of a view ([`gain_of_view`]).
    fn gains_of_view(
        &self,
        surface: &SurfacePicture,
        view: &LookView,
        photos: &[usize],
        settings: &LookSettings,
    ) -> Vec<Vec3> {
        let mut gains = self.gains(photos);
        let places = places_of(surface);
        let part = |index: &usize| -> f64 {
            let worth = places
                .iter()
                .map(|pixel| self.worth(*index, pixel, view, settings));
            worth.map(exposure_part).sum()
        };
        let of_view = gain_of_view(gains.iter().copied().zip(photos.iter().map(part)));
        gains.iter_mut().for_each(|gain| *gain /= of_view);
        gains
    }

    /// Weight of a photograph at a place, without its pixels and its mask.
    fn worth(
        &self,
        index: usize,
        pixel: &SurfacePixel,
        view: &LookView,
        settings: &LookSettings,
    ) -> f32 {
        let Some(ready) = &self.ready[index] else {
            return 0.0;
        };
        let nothing = PhotoPyramid::default();
        photo_weight(pixel, view, &ready.without_pixels(&nothing), settings)
    }

    /// Mean color of each vertex over the given photographs that see it, weighted by the cosine of the angle to them; gray
    /// where none does.
    ///
    /// # Errors
    /// When a photograph cannot be decoded again.
    pub fn vertex_colors(&mut self, photos: &[usize]) -> Result<Vec<[u8; 3]>, PhotoError> {
        let model = self.drawer.model();
        let mut sums = vec![(Vec3::ZERO, 0.0_f32); model.vertices.len()];
        for index in photos {
            let Some(ready) = &self.ready[*index] else {
                continue;
            };
            let photo = &self.scene.photos[*index];
            let pixels = self
                .library
                .whole(*index, photo, self.options.longest_side)?;
            let look = LookPhoto {
                photo: &ready.projected,
                pixels: &pixels,
                depth: &ready.depth,
                mask: ready.mask.as_deref(),
            };
            sums.par_iter_mut()
                .zip(&model.vertices)
                .for_each(|((sum, weight), vertex)| {
                    let normal = normal_of(vertex);
                    if let Some(color) = color_at(&look, vertex.position, normal) {
                        let facing = normal
                            .dot(ready.projected.ray_to(vertex.position))
                            .abs()
                            .max(0.05);
                        *sum += color * facing;
                        *weight += facing;
                    }
                });
        }
        Ok(sums
            .iter()
            .map(|(sum, weight)| match *weight > 0.0 {
                true => (*sum / *weight * 255.0 + 0.5).to_array().map(|v| v as u8),
                false => [128; 3],
            })
            .collect())
    }

    /// The view of a camera for the look.
    pub fn view(&self, camera: &CalibratedCamera) -> LookView {
        let model = self.drawer.model();
        let eye = (camera.center - model.origin).as_vec3();
        let forward = camera.axis().as_vec3();
        LookView {
            eye,
            direction: view_direction(eye, forward, [model.min, model.max], self.middle),
            parallel: None,
        }
    }

    /// Chooses photographs for a view: by their worth at places of the picture, or for Princ's forms by the direction of the
    /// view, half of them for what those leave uncovered where there are more than fit. Those of the second half come with
    /// stage 1.
    fn choose(
        &self,
        surface: &SurfacePicture,
        view: &LookView,
        choice: PhotoChoice<'_>,
        settings: &LookSettings,
    ) -> Vec<(usize, u32)> {
        let allowed = choice.allowed;
        let most = choice.most.unwrap_or(self.options.most_photos);
        let most = most.clamp(1, 64);
        if allowed.len() <= most {
            return allowed.iter().map(|i| (*i, 0)).collect();
        }
        let places: Vec<SurfacePixel> = places_of(surface);
        let weight = |index: usize, pixel: &SurfacePixel| self.worth(index, pixel, view, settings);
        if matches!(settings.form, WeightForm::Quality | WeightForm::Baked) {
            let worth: Vec<Vec<f32>> = (allowed.par_iter())
                .map(|index| places.iter().map(|pixel| weight(*index, pixel)).collect())
                .collect();
            return most_worth(&worth, most)
                .iter()
                .map(|i| (allowed[*i], 0))
                .collect();
        }
        let direction = |index: &usize| match &self.ready[*index] {
            Some(ready) if settings.direction == PhotoDirection::Axis => {
                ready.projected.rotation.transpose() * Vec3::Z
            }
            Some(ready) => ready.projected.direction,
            None => Vec3::ZERO,
        };
        let directions: Vec<Vec3> = allowed.iter().map(direction).collect();
        let first = nearest_directions(view.direction, &directions, most.div_ceil(2));
        let uncovered: Vec<Vec3> = (places.iter())
            .filter(|pixel| first.iter().all(|i| weight(allowed[*i], pixel) <= 0.0))
            .map(|pixel| pixel.normal)
            .collect();
        let clusters = cluster_normals(&uncovered);
        let second = supplementary_photos(&clusters, &directions, &first, most / 2, places.len());
        let staged =
            |list: Vec<usize>, stage: u32| list.into_iter().map(move |i| (allowed[i], stage));
        staged(first, 0).chain(staged(second, 1)).collect()
    }

    /// A picture of a surface with the photographs on it that are chosen.
    ///
    /// # Errors
    /// When a photograph cannot be decoded again.
    pub fn picture(
        &mut self,
        camera: &CalibratedCamera,
        surface: &SurfacePicture,
        choice: PhotoChoice<'_>,
        settings: &LookSettings,
    ) -> Result<PhotoPicture, PhotoError> {
        let view = self.view(camera);
        let chosen = self.choose(surface, &view, choice, settings);
        let indices: Vec<usize> = chosen.iter().map(|(index, _)| *index).collect();
        let gains = match settings.gains {
            true => self.gains_of_view(surface, &view, &indices, settings),
            false => vec![Vec3::ONE; indices.len()],
        };
        let mut held: Vec<(ProjectedPhoto, Arc<PhotoPyramid>)> = Vec::new();
        for ((index, stage), gain) in chosen.iter().zip(gains) {
            let pixels = self.library.whole(
                *index,
                &self.scene.photos[*index],
                self.options.longest_side,
            )?;
            if let Some(ready) = &self.ready[*index] {
                let photo = ProjectedPhoto {
                    stage: *stage,
                    gain,
                    ..ready.projected
                };
                held.push((photo, pixels));
            }
        }
        let photos: Vec<LookPhoto<'_>> = (held.iter())
            .filter_map(|(photo, pixels)| {
                let ready = self.ready[photo.index as usize].as_ref()?;
                Some(LookPhoto {
                    photo,
                    pixels: pixels.as_ref(),
                    depth: &ready.depth,
                    mask: ready.mask.as_deref(),
                })
            })
            .collect();
        let pixels = surface.pixels.par_iter().map(|pixel| match pixel {
            Some(pixel) if choice.is_mean => mean_at_pixel(pixel, &view, &photos, settings),
            Some(pixel) => look_at_pixel(pixel, &view, &photos, settings),
            None => LookPixel::default(),
        });
        Ok(PhotoPicture {
            width: surface.image.width,
            height: surface.image.height,
            pixels: pixels.collect(),
            chosen: photos.iter().map(|of| of.photo.index as usize).collect(),
        })
    }
}

/// Places of a picture that stand for all of it.
fn places_of(surface: &SurfacePicture) -> Vec<SurfacePixel> {
    let width = surface.image.width as usize;
    let rows = surface
        .pixels
        .chunks(width.max(1))
        .skip(CHOICE_STEP / 2)
        .step_by(CHOICE_STEP);
    rows.flat_map(|row| row.iter().skip(CHOICE_STEP / 2).step_by(CHOICE_STEP))
        .flatten()
        .copied()
        .collect()
}

fn normal_of(vertex: &crate::abi::Vertex) -> Vec3 {
    crate::math::octahedral::decode(vertex.normal)
}
