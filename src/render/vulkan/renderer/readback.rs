//! Pictures read back from the device.

use crate::gpu::Error;
use crate::gpu::buffer::ReadbackBuffer;
use crate::gpu::image::DeviceImage as Target;
use crate::image::{Image, unorm8};
use crate::math::camera::View;
use crate::render::vulkan::renderer::VulkanRenderer;

impl VulkanRenderer {
    /// Reads the last drawn frame back, with the outputs that the renderer was made for.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn read(&mut self, view: &View) -> Result<Image, Error> {
        let gpu = &self.gpu;
        if self.readback.is_none() {
            let make = |name: &str, target: Option<&Target>| {
                target
                    .map(|t| ReadbackBuffer::new(gpu, name, t.bytes()))
                    .transpose()
            };
            self.readback = Some([
                make("readback of color", Some(&self.targets.color))?,
                make(
                    "readback of depth",
                    self.outputs.depth.then_some(&self.targets.depth),
                )?,
                make(
                    "readback of normal",
                    self.targets.normal.as_ref().filter(|_| self.outputs.normal),
                )?,
            ]);
        }
        let Some([color, depth, normal]) = &mut self.readback else {
            unreachable!("made above")
        };
        let picture = self.looks.picture(&self.targets);
        let mut frame = self.frames.begin()?;
        if let Some(color) = color {
            frame.read_back("readback.color", picture, color);
        }
        if let Some(depth) = depth {
            frame.read_back("readback.depth", &self.targets.depth, depth);
        }
        if let (Some(normal), Some(target)) = (normal.as_ref(), &self.targets.normal) {
            frame.read_back("readback.normal", target, normal);
        }
        let ticket = frame.submit()?;
        self.frames.finish(ticket)?;
        let (width, height) = (self.targets.color.width, self.targets.color.height);
        let mut image = Image {
            width,
            height,
            ..Image::default()
        };
        if let Some(color) = color {
            if self.outputs.values {
                image.values = bytemuck::pod_collect_to_vec(color.bytes());
                let bytes = |c: &[f32; 4]| c.map(|v| unorm8(f64::from(v)));
                image.color = image.values.iter().map(bytes).collect();
            } else {
                image.color = bytemuck::pod_collect_to_vec(color.bytes());
            }
        }
        if let Some(depth) = depth {
            let raw: Vec<f32> = bytemuck::pod_collect_to_vec(depth.bytes());
            image.depth = distances(view, &raw, &image.color);
        }
        if let Some(normal) = normal {
            let raw: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(normal.bytes());
            image.normal = raw.into_iter().map(|[x, y, z, _]| [x, y, z]).collect();
        }
        Ok(image)
    }
}

/// Distances by reversed depths. Nothing drawn, or nothing of any weight: none.
fn distances(view: &View, depths: &[f32], colors: &[[u8; 4]]) -> Vec<f32> {
    let all = depths.iter().zip(colors);
    all.map(|(&depth, color)| match color[3] {
        0 => f32::INFINITY,
        _ => view.distance_of_depth(depth),
    })
    .collect()
}
