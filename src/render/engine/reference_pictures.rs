//! Pictures of the reference.

use super::picture_backend::{PictureBackend, PictureRequest, VALUES};
use crate::gpu::Error;
use crate::image::Image;
use crate::math::camera::View;
use crate::render::PictureOutputs;
use crate::render::frame_plan::FramePlan;
use crate::render::photo_look::{color_picture, given};
use crate::render::reference::renderer::ReferenceRenderer;
use crate::render::stats::FrameTimes;

impl PictureBackend for ReferenceRenderer {
    fn draw(&mut self, frame: PictureRequest<'_>) -> Result<FrameTimes, Error> {
        let PictureRequest {
            parts,
            view,
            settings,
            photos,
        } = frame;
        let plan = FramePlan::for_reference(settings, parts, view, self.outputs)?;
        if !plan.settings.shows_photos() {
            return Ok(self.draw_frame(&plan, parts));
        }
        let photos = given(photos)?;
        let outputs = self.outputs;
        self.outputs = plan.settings.outputs_of_frame(outputs);
        let times = self.draw_frame(&plan, parts);
        self.outputs = outputs;
        let mut image = std::mem::take(&mut self.image);
        color_picture(&mut image, view, photos, &plan.settings);
        self.image = only(image, outputs);
        Ok(times)
    }

    fn read(&mut self, _: &View) -> Result<Image, Error> {
        Ok(self.image.clone())
    }

    fn sample(&mut self, frame: PictureRequest<'_>, _: [u32; 2]) -> Result<Image, Error> {
        let outputs = std::mem::replace(&mut self.outputs, VALUES);
        let drawn = self.draw(frame);
        self.outputs = outputs;
        drawn?;
        Ok(self.image.clone())
    }

    fn overdraw(&mut self) -> Option<Vec<u32>> {
        self.counts.clone()
    }
}

/// A picture without what was only needed to draw it.
fn only(mut image: Image, outputs: PictureOutputs) -> Image {
    if !outputs.depth {
        image.depth = Vec::new();
    }
    if !outputs.normal {
        image.normal = Vec::new();
    }
    image
}
