//! Looks over the finished picture of a frame, whatever technique drew it.

use super::CpuRenderer;
use crate::render::backdrop::BackgroundGradient;
use crate::render::cpu::darken::DrawnRectangle;
use crate::render::cpu::picture::{DrawnArea, PixelWords};
use crate::render::frame_plan::FramePlan;
use crate::render::screen_bounds;

impl CpuRenderer {
    /// Darkens the picture by its depths, and puts a gradient behind it, where that is asked for.
    pub(super) fn look(
        &mut self,
        plan: &FramePlan,
        pixels: &mut PixelWords<'_>,
        area: &mut DrawnArea,
    ) {
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
        self.gradient = BackgroundGradient::of(&plan.settings);
        if let Some(gradient) = &self.gradient {
            let [width, height] = self.size;
            let size = [width as usize, height as usize];
            gradient.put_behind_words(pixels.words, pixels.pitch, size);
            *area = DrawnArea::unknown(width, height);
        }
    }
}
