//! The photo look of many pixels of a row at once, a pixel in each lane of the processor's vectors.
//!
//! Colors are those of [`look_at_pixel`], by the same rules and up to rounding, for the quality form in one stage; everything
//! else goes through that function, pixel by pixel. Photographs are looked at in the order of the most that they may weigh by
//! directions alone. One that cannot be among the few best of any lane is left out: that changes nothing, since the bound
//! holds for every lane.

mod block;
mod lanes;
mod mix;
mod place;
mod texels;

use crate::projective::look::{
    LookPhoto, LookPixel, LookSettings, LookView, WeightForm, look_at_pixel,
};
use crate::projective::surface_rays::SurfaceRays;
use crate::projective::wide_look::block::{BlockPhotos, MOST_WIDE, SurfaceBlock};
use crate::simd::WideLanes;
use fearless_simd::{Level, Simd, dispatch};
use glam::Vec3;

/// Surface in pixels of a row that lie beside each other.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfaceRow<'a> {
    /// Column and row of the first.
    pub(crate) first: [u32; 2],
    /// Distance of each along the view direction; infinite where there is nothing.
    pub(crate) distances: &'a [f32],
    /// Unit normals; zero where there is none.
    pub(crate) normals: &'a [[f32; 3]],
}

/// Photographs and settings that the pixels of a picture are looked at with.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WideLook<'a> {
    rays: &'a SurfaceRays,
    view: LookView,
    photos: &'a [LookPhoto<'a>],
    settings: &'a LookSettings,
    is_wide: bool,
    level: Level,
}

impl<'a> WideLook<'a> {
    /// Looks at the surface that rays meet, in a view that photographs were chosen for by `direction`.
    pub(crate) fn new(
        rays: &'a SurfaceRays,
        direction: Vec3,
        photos: &'a [LookPhoto<'a>],
        settings: &'a LookSettings,
    ) -> Self {
        let has_one_stage = photos.iter().all(|of| of.photo.stage == 0);
        let is_there = |of: &LookPhoto<'_>| !of.pixels.levels.is_empty();
        Self {
            rays,
            view: rays.look_view(direction),
            photos,
            settings,
            is_wide: settings.form == WeightForm::Quality
                && has_one_stage
                && photos.len() <= MOST_WIDE
                && photos.iter().all(is_there),
            level: Level::new(),
        }
    }

    /// Colors of the pixels of a row, as many as distances.
    pub(crate) fn row(&self, row: SurfaceRow<'_>, found: &mut [LookPixel]) {
        if self.is_wide {
            dispatch!(self.level, simd => wide_row(simd, self, row, found));
            return;
        }
        let [first, y] = row.first;
        let pixels = row.distances.iter().zip(row.normals).zip(found);
        for (x, ((distance, normal), found)) in (first..).zip(pixels) {
            *found = LookPixel::default();
            if *distance > 0.0 && distance.is_finite() {
                let pixel = self.rays.pixel([x, y], *distance, Vec3::from(*normal));
                *found = look_at_pixel(&pixel, &self.view, self.photos, self.settings);
            }
        }
    }
}

#[inline(always)]
fn wide_row<S: Simd>(simd: S, look: &WideLook<'_>, row: SurfaceRow<'_>, found: &mut [LookPixel]) {
    let lanes = WideLanes::<S>::LANES;
    let [first, y] = row.first;
    let mut photos = BlockPhotos::default();
    let blocks = row.distances.chunks(lanes).zip(row.normals.chunks(lanes));
    let blocks = blocks.zip(found.chunks_mut(lanes));
    for (x, ((distances, normals), found)) in (first..).step_by(lanes).zip(blocks) {
        found.fill(LookPixel::default());
        if distances.iter().all(|distance| !distance.is_finite()) {
            continue;
        }
        let surface = SurfaceBlock::new(simd, look.rays, [x, y], (distances, normals), &look.view);
        photos.weigh(simd, &surface, look.photos, look.settings);
        photos.mix(simd, look.photos, look.settings, found);
    }
}

#[cfg(test)]
mod tests;
