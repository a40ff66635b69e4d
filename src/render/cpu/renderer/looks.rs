//! Looks over the finished picture of a frame, whatever technique drew it.

use super::CpuRenderer;
use crate::projective::frame_photos::FramePhotos;
use crate::projective::surface_rays::SurfaceRays;
use crate::render::backdrop::BackgroundGradient;
use crate::render::cpu::darken::DrawnRectangle;
use crate::render::cpu::photos::{PhotographedPicture, color_rectangle, lay_over};
use crate::render::cpu::picture::{DrawnArea, PixelWords};
use crate::render::frame_plan::FramePlan;
use crate::render::screen_bounds;
use crate::render::stats::{FrameStage, FrameTimes};
use std::sync::Arc;

impl CpuRenderer {
    /// Gives colors as floats, where there are any, those of the photograph that was laid over the last picture: it reaches
    /// beyond what was drawn.
    pub(super) fn lay_over_values(&self, colors: &[[u8; 4]], values: &mut [[f32; 4]]) {
        let compared = self.photos.as_ref().filter(|own| own.compared.is_some());
        let width = self.size[0];
        let (Some(photos), Some(key), false) = (compared, &self.drawn, values.is_empty()) else {
            return;
        };
        let rays = SurfaceRays::of(&key.view);
        for (index, (value, color)) in (0..).zip(values.iter_mut().zip(colors)) {
            let [x, y] = [index % width, index / width].map(|v| v as f32 + 0.5);
            if key.settings.shows_photos() && photos.compared_color(&rays, [x, y], width).is_some()
            {
                *value = color.map(|v| f32::from(v) / 255.0);
            }
        }
    }

    /// Puts these photographs on the surface in frames from the next one on whose settings show any.
    pub fn set_photos(&mut self, photos: Option<&Arc<FramePhotos>>) {
        let is_same = match (&self.photos, photos) {
            (Some(own), Some(other)) => Arc::ptr_eq(own, other),
            (None, None) => true,
            _ => false,
        };
        if !is_same {
            self.photos = photos.cloned();
            // A frame with others is another frame.
            self.drawn = None;
        }
    }

    /// Darkens the picture by its depths, and puts a gradient behind it, where that is asked for.
    pub(super) fn look(
        &mut self,
        plan: &FramePlan,
        pixels: &mut PixelWords<'_>,
        area: &mut DrawnArea,
        times: &mut FrameTimes,
    ) {
        let looking = FrameStage::Look.begin();
        let constants = &plan.constants;
        let rect_px = plan.context.rect_px;
        let [left, _, right, _] = rect_px;
        let rect_pixels = screen_bounds::pixels(rect_px) as usize;
        let pitch = pixels.pitch;
        let mut picture = DrawnRectangle {
            colors: pixels.from(rect_px),
            pitch,
            depths: &self.depths[..rect_pixels],
            width: (right - left) as usize,
        };
        let values = self.planes.planes().values;
        if constants.ambient_occlusion > 0.0 {
            let picture = picture.again();
            (self.ambient_occlusion).darken(constants, picture, values);
        }
        if constants.eye_dome > 0.0 {
            self.eye_dome.darken(constants, picture.again(), values);
        }
        let photos = self
            .photos
            .as_ref()
            .filter(|_| plan.settings.shows_photos());
        if let Some(photos) = photos {
            let picture = PhotographedPicture {
                colors: picture.again().colors,
                pitch,
                depths: &self.depths[..rect_pixels],
                planes: self.planes.planes(),
            };
            color_rectangle(photos, plan, picture);
            if lay_over(photos, &plan.view, self.size, pixels) {
                *area = DrawnArea::unknown(self.size[0], self.size[1]);
            }
        }
        self.gradient = BackgroundGradient::of(&plan.settings);
        if let Some(gradient) = &self.gradient {
            let [width, height] = self.size;
            let size = [width as usize, height as usize];
            gradient.put_behind_words(pixels.words, pixels.pitch, size);
            *area = DrawnArea::unknown(width, height);
        }
        looking.end(times);
    }
}
