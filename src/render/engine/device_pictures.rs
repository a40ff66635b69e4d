//! Pictures of a Vulkan device.

use super::picture_backend::{PictureBackend, PictureRequest};
use crate::gpu::Error;
use crate::image::Image;
use crate::math::camera::View;
use crate::render::stats::FrameTimes;
use crate::render::vulkan::renderer::VulkanRenderer;
use crate::render::vulkan::scene::DeviceScene;

/// A renderer of a device, and what it draws.
#[derive(Debug)]
pub(super) struct DevicePictures {
    pub(super) renderer: Box<VulkanRenderer>,
    /// Draws what is averaged, once anything was.
    pub(super) samples: Option<Box<VulkanRenderer>>,
    pub(super) scene: DeviceScene,
}

impl PictureBackend for DevicePictures {
    fn draw(&mut self, frame: PictureRequest<'_>) -> Result<FrameTimes, Error> {
        // Photographs are on the device.
        (self.renderer).draw_parts(frame.parts, &mut self.scene, frame.view, frame.settings)
    }

    fn read(&mut self, view: &View) -> Result<Image, Error> {
        self.renderer.read(view)
    }

    fn sample(&mut self, frame: PictureRequest<'_>, _: [u32; 2]) -> Result<Image, Error> {
        let Self {
            renderer,
            samples,
            scene,
        } = self;
        let samples = match samples {
            Some(made) => made,
            none => none.insert(Box::new(renderer.of_values()?)),
        };
        if samples.costs() != renderer.costs() {
            samples.set_costs(renderer.costs());
        }
        samples.set_photos(renderer.photos().cloned());
        samples.draw_parts(frame.parts, scene, frame.view, frame.settings)?;
        samples.read(frame.view)
    }

    fn overdraw(&mut self) -> Option<Vec<u32>> {
        self.renderer.overdraw()
    }

    fn keep_lists(&mut self, keep: bool) {
        self.renderer.keep_lists(keep);
    }
}
