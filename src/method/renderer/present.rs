//! What a window asks of the renderer beyond pictures: frames that go to the screen without waiting for each
//! other, new sizes, and the depth under the cursor.

use super::{FrameTimes, Renderer, Submitted};
use crate::draw::Lighting;
use crate::gpu::Error;
use crate::gpu::buffer::Readback;
use crate::gpu::surface::Acquired;
use crate::math::camera::View;
use crate::method::Settings;
use crate::method::scene::Scene;
use crate::method::targets::{Context, Targets};
use crate::tree::Model;
use std::time::Instant;

/// How far around a pixel [`Renderer::distance_near`] looks, pixels.
const PROBE_RADIUS_PX: u32 = 6;
/// Most pixels of a probe.
const PROBE_PIXELS: u64 = (2 * PROBE_RADIUS_PX as u64 + 1).pow(2);

impl Renderer {
    /// How many frames can be on their way at once.
    pub fn in_flight(&self) -> usize {
        self.frames.in_flight()
    }

    /// Waits until the next frame can be recorded and tells its slot of the ring, for
    /// [`Surface::acquire`](crate::gpu::surface::Surface::acquire).
    ///
    /// # Errors
    /// When the device is lost.
    pub fn wait_for_next(&mut self) -> Result<usize, Error> {
        self.frames.wait_for_next()?;
        Ok(self.frames.next_slot())
    }

    /// Makes the targets anew for pictures of `width` x `height` pixels; does nothing when they have that size.
    ///
    /// # Errors
    /// When a side is 0 or above the device's limit, or memory runs out.
    pub fn resize(&mut self, width: u32, height: u32) -> Result<(), Error> {
        if (self.targets.color.width, self.targets.color.height) != (width, height) {
            self.targets = Targets::new(&self.gpu, width, height, self.outputs.normal)?;
            self.readback = None;
            self.filtered = None;
            self.visibility = None;
            self.fuzzy = None;
        }
        Ok(())
    }

    /// Submits one frame that is drawn and put onto an acquired image of a window, and does not wait for it.
    ///
    /// # Errors
    /// As [`Renderer::draw`]; the image must be abandoned then.
    pub fn submit_onto(
        &mut self,
        model: &Model,
        scene: &mut Scene,
        view: &View,
        settings: &Settings,
        onto: &Acquired,
    ) -> Result<Submitted, Error> {
        self.submit(model, scene, view, settings, &mut |mut frame, color| {
            frame.present(color, onto);
            frame.submit_onto(onto)
        })
    }

    /// Submits a frame that shows nothing but the background, for a window without a model.
    ///
    /// # Errors
    /// When the device is lost; the image must be abandoned then.
    pub fn submit_background(
        &mut self,
        background: [f32; 3],
        onto: &Acquired,
    ) -> Result<Submitted, Error> {
        let start = Instant::now();
        let context = Context {
            width: self.targets.color.width,
            height: self.targets.color.height,
            guard_px: 0,
            background,
            cull_back: false,
            is_mirrored: false,
            light: Lighting::Headlight,
        };
        let mut frame = self.frames.begin()?;
        self.targets
            .attach(frame.pass("background"), &context)
            .draw(context.viewport(), |_| {});
        frame.present(&self.targets.color, onto);
        let ticket = frame.submit_onto(onto)?;
        Ok(Submitted {
            ticket,
            times: FrameTimes::default(),
            start,
        })
    }

    /// View-space distance along the view direction of what the last frame, drawn with `view`, shows at
    /// pixel (`x`, `y`), or at the nearest covered pixel within 6 pixels; `None` where there is nothing, and
    /// outside of the picture. Waits for the device; not for every frame.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn distance_near(&mut self, view: &View, x: u32, y: u32) -> Result<Option<f32>, Error> {
        let (width, height) = (self.targets.depth.width, self.targets.depth.height);
        if x >= width || y >= height {
            return Ok(None);
        }
        let (left, top) = (
            x.saturating_sub(PROBE_RADIUS_PX),
            y.saturating_sub(PROBE_RADIUS_PX),
        );
        let right = (x + PROBE_RADIUS_PX + 1).min(width);
        let bottom = (y + PROBE_RADIUS_PX + 1).min(height);
        let part = [left, top, right - left, bottom - top];
        let mut probe = match self.probe.take() {
            Some(probe) => probe,
            None => Readback::new(
                &self.gpu,
                "depth under the cursor",
                PROBE_PIXELS * self.targets.depth.format.pixel_bytes(),
            )?,
        };
        let mut frame = self.frames.begin()?;
        frame.read_back_part("probe.depth", &self.targets.depth, part, &probe);
        let ticket = frame.submit()?;
        self.frames.finish(ticket)?;
        let depth: Vec<f32> = bytemuck::pod_collect_to_vec(probe.bytes());
        self.probe = Some(probe);
        let found = nearest_covered(&depth, part[2], part[3], (x - left, y - top));
        Ok(found.map(|depth| view.distance_of_depth(depth)))
    }
}

/// The reversed depth of the covered pixel nearest to `(x, y)`, in a tight picture of `width` x `height`.
fn nearest_covered(depth: &[f32], width: u32, height: u32, (x, y): (u32, u32)) -> Option<f32> {
    let limit = PROBE_RADIUS_PX * PROBE_RADIUS_PX;
    (0..width * height)
        .filter(|&i| depth[i as usize] > 0.0)
        .map(|i| {
            (
                (i % width).abs_diff(x).pow(2) + (i / width).abs_diff(y).pow(2),
                i,
            )
        })
        .filter(|(distance, _)| *distance <= limit)
        .min()
        .map(|(_, i)| depth[i as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_covered_pixel_within_reach_is_taken() {
        let (w, h) = (13, 9);
        let mut depth = vec![0.0; w as usize * h as usize];
        assert_eq!(nearest_covered(&depth, w, h, (6, 4)), None);
        depth[0] = 0.9;
        assert_eq!(
            nearest_covered(&depth, w, h, (6, 4)),
            None,
            "7.2 pixels away"
        );
        assert_eq!(nearest_covered(&depth, w, h, (4, 4)), Some(0.9));
        depth[(4 * w + 8) as usize] = 0.5;
        depth[(6 * w + 6) as usize] = 0.25;
        assert_eq!(nearest_covered(&depth, w, h, (7, 4)), Some(0.5));
        assert_eq!(nearest_covered(&depth, w, h, (6, 6)), Some(0.25));
    }
}
