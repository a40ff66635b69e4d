//! What a window asks of the renderer beyond pictures: frames that go to the screen without waiting for each
//! other, new sizes, and the depth under the cursor.

use crate::cut::StripRun;
use crate::gpu::Error;
use crate::gpu::buffer::Readback;
use crate::gpu::frame::{Frame, Ticket};
use crate::gpu::image::Image as Target;
use crate::gpu::overlay::Overlay;
use crate::gpu::surface::Acquired;
use crate::image::Image;
use crate::math::camera::View;
use crate::pack::Lighting;
use crate::pack::filtered::drawn_counts;
use crate::render::cost::choose;
use crate::render::cost::choose::Asked;
use crate::render::cost::choose::ComputeShare;
use crate::render::frame_plan::{Choice, Drawing, filtered_shade};
use crate::render::stats::FrameCounts;
use crate::render::vulkan::mapped_picture::Drawn;
use crate::render::vulkan::opaque::compute;
use crate::render::vulkan::renderer::{FrameTimes, Renderer, Submitted};
use crate::render::vulkan::scene::Scene;
use crate::render::vulkan::targets::{Context, Targets};
use crate::render::{Method, Path, Settings};
use crate::tree::Model;
use std::time::Instant;

/// How far around a pixel [`Renderer::distance_near`] looks, pixels.
const PROBE_RADIUS_PX: u32 = 6;
/// Most pixels of a probe.
const PROBE_PIXELS: u64 = (2 * PROBE_RADIUS_PX as u64 + 1).pow(2);

/// What a frame would draw.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Foreseen {
    /// How much.
    pub counts: FrameCounts,
    /// Pixels of the box around the model in the picture.
    pub pixels: u64,
    /// Splats are blended.
    pub is_blended: bool,
    /// Small splats by compute.
    pub by_compute: bool,
    /// Compute can draw them, and nobody insists on either way.
    pub is_free: bool,
    /// The largest threshold with which it can, pixels.
    pub largest_by_compute_px: f32,
}

/// Where a frame goes besides the renderer's own targets.
#[derive(Debug)]
pub struct Show<'a> {
    /// The image of a window; none leaves the frame where it is, to be read back.
    pub onto: Option<&'a Acquired>,
    /// What covers the picture.
    pub overlay: Option<&'a mut Overlay>,
    /// Columns at the left that the picture leaves to the overlay, pixels; 0 without one.
    pub inset: u32,
}

impl Show<'_> {
    /// Covers the picture, presents and submits.
    fn end(&mut self, mut frame: Frame<'_>, color: &Target) -> Result<Ticket, Error> {
        let shown = match &mut self.overlay {
            Some(overlay) => overlay.record(&mut frame, color),
            None => color,
        };
        match self.onto {
            Some(onto) => {
                frame.present(shown, onto);
                frame.submit_onto(onto)
            }
            None => frame.submit(),
        }
    }
}

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
            self.targets = Targets::new(
                &self.gpu,
                width,
                height,
                (self.targets.color.format, self.outputs.normal),
            )?;
            self.readback = None;
            self.by_host = None;
            self.small = None;
            (self.filtered, self.spare_filtered) = (None, Vec::new());
            self.visibility = None;
            (self.fuzzy, self.spare_fuzzy) = (None, Vec::new());
            (self.overdraw, self.counted) = (None, None);
        }
        Ok(())
    }

    /// FrameCounts what a frame of these settings would draw, without drawing it: its cut is chosen, and used by the next
    /// frame if that has the same view and settings. The time is booked as that frame's. Nothing without a cut.
    pub fn foresee(
        &mut self,
        model: &Model,
        scene: &Scene,
        view: &View,
        settings: &Settings,
    ) -> Foreseen {
        if !settings.has_cut() {
            return Foreseen::default();
        }
        let start = Instant::now();
        let settings = &self.for_frame(settings, model, view);
        let choice = Choice::of(settings, model, view);
        let is_new = self.select(model, scene, (scene.id(), choice));
        let (splats, large) = if Drawing::of(settings) == Drawing::Filtered {
            let shade = filtered_shade(settings, model, f32::INFINITY);
            let [splats, triangles] = drawn_counts(model, view, &shade, &self.cut);
            (splats as u64, triangles as u64)
        } else {
            let strips = StripRun::splats_of(&self.cut.strips);
            let splats = (self.cut.nodes.len() + self.cut.leaves.len() + strips) as u64;
            (splats, self.cut.triangles.len() as u64)
        };
        let foreseen = self.foreseen.get_or_insert_default();
        foreseen.ms += crate::render::vulkan::renderer::ms(start);
        foreseen.is_new |= is_new;
        let is_whole = settings.method == Method::Splats;
        let splats = if is_whole { splats + large } else { splats };
        let host_px = self.host_px(settings, model);
        let by_compute = self.wants_compute(settings, model).unwrap_or(false);
        let rect = crate::render::screen_bounds::rect_px(model, view, settings.threshold_px + 3.0);
        let triangles = if is_whole { 0 } else { large };
        let asked = Asked {
            settings,
            costs: self.costs,
            splats: (splats + self.cut.stats.hidden) as usize,
            size_px: choose::size_px(settings, (model, view), &self.cut),
            triangles: triangles as usize,
            rect_px: rect,
            size: (self.targets.color.width, self.targets.color.height),
            by_host: host_px.is_some(),
        };
        let has_large = is_whole || !model.kind().is_surface();
        let is_blended = matches!(Drawing::of(settings), Drawing::Fuzzy | Drawing::Filtered);
        let pays = match Drawing::of(settings) {
            Drawing::Opaque => asked.opaque().splats == Path::Compute,
            Drawing::Visibility => asked.visible() == Path::Compute,
            // As the frame will be: with the triangles, where compute takes those.
            _ if triangles > 0
                && compute::Small::takes_triangles(&self.gpu, scene)
                && asked.all_blended(has_large) != ComputeShare::Nothing =>
            {
                true
            }
            _ => asked.blended(triangles as usize, has_large) != ComputeShare::Nothing,
        };
        Foreseen {
            pixels: crate::render::screen_bounds::pixels(rect),
            is_blended,
            is_free: by_compute && settings.path == Path::Auto,
            largest_by_compute_px: crate::render::compute_limits::largest_threshold_px(
                settings, host_px,
            ),
            counts: FrameCounts {
                nodes_visited: self.cut.stats.visited,
                splats,
                triangles,
                ..FrameCounts::default()
            },
            by_compute: by_compute && pays,
        }
    }

    /// Forgets the cut that was chosen for a frame that is not drawn; to be called when the model changes.
    pub fn forget_foreseen(&mut self) {
        self.foreseen = None;
    }

    /// Submits one frame that is drawn, covered by the overlay (if any) and put where `shown` says, and does not
    /// wait for it.
    ///
    /// # Errors
    /// As [`Renderer::draw`]; an acquired image must be abandoned then.
    pub fn submit_shown(
        &mut self,
        model: &Model,
        scene: &mut Scene,
        view: &View,
        settings: &Settings,
        mut shown: Show<'_>,
    ) -> Result<Submitted, Error> {
        self.prepare_overlay(&mut shown)?;
        self.submit(model, scene, view, settings, &mut |frame, color| {
            shown.end(frame, color)
        })
    }

    /// Submits a frame that shows the picture of the last frame again, under a new overlay.
    ///
    /// # Errors
    /// When memory runs out or the device is lost; an acquired image must be abandoned then.
    pub fn submit_again(&mut self, mut shown: Show<'_>) -> Result<Submitted, Error> {
        let start = Instant::now();
        self.prepare_overlay(&mut shown)?;
        let frame = self.frames.begin()?;
        let by_host = self.by_host.map(|(slot, _)| &self.lists[slot].nearest);
        let by_host = by_host.and_then(Drawn::image);
        let ticket = shown.end(frame, by_host.unwrap_or(&self.targets.color))?;
        if by_host.is_some() {
            self.shown_again = Some(ticket);
        }
        Ok(Submitted {
            ticket,
            times: FrameTimes::default(),
            start,
            on_device: false,
            counted: None,
        })
    }

    fn prepare_overlay(&mut self, shown: &mut Show<'_>) -> Result<(), Error> {
        let Some(overlay) = &mut shown.overlay else {
            return Ok(());
        };
        self.frames.wait_for_next()?;
        let (width, height) = (self.targets.color.width, self.targets.color.height);
        let inset = shown.inset;
        overlay.prepare(self.frames.next_slot(), (width + inset, height), inset)
    }

    /// Submits a frame that shows nothing but the background, for a window without a model.
    ///
    /// # Errors
    /// When the device is lost; the image must be abandoned then.
    pub fn submit_background(
        &mut self,
        background: [f32; 3],
        mut shown: Show<'_>,
    ) -> Result<Submitted, Error> {
        let start = Instant::now();
        self.prepare_overlay(&mut shown)?;
        self.by_host = None;
        let context = Context {
            rect_px: [0, 0, self.targets.color.width, self.targets.color.height],
            width: self.targets.color.width,
            height: self.targets.color.height,
            guard_px: 0,
            background,
            cull_back: false,
            is_mirrored: false,
            light: Lighting::Headlight,
            depth_range: [0.0, 1.0],
        };
        let mut frame = self.frames.begin()?;
        self.targets
            .attach(frame.pass("background"), &context)
            .draw(context.viewport(), |_| {});
        let ticket = shown.end(frame, &self.targets.color)?;
        Ok(Submitted {
            ticket,
            times: FrameTimes::default(),
            start,
            on_device: false,
            counted: None,
        })
    }

    /// What the last frame showed, overlay and all. Waits for the device; not for every frame.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn read_shown(&mut self, overlay: Option<&Overlay>) -> Result<Image, Error> {
        let by_host = self.by_host.map(|(slot, _)| &self.lists[slot].nearest);
        let shown = overlay.and_then(Overlay::shown);
        let shown = shown.or_else(|| by_host.and_then(Drawn::image));
        let shown = shown.unwrap_or(&self.targets.color);
        let mut pixels = Readback::new(&self.gpu, "readback of the window", shown.bytes())?;
        let mut frame = self.frames.begin()?;
        frame.read_back("readback.window", shown, &pixels);
        let ticket = frame.submit()?;
        self.frames.finish(ticket)?;
        Ok(Image {
            width: shown.width,
            height: shown.height,
            color: bytemuck::pod_collect_to_vec(pixels.bytes()),
            ..Image::default()
        })
    }

    /// View-space distance along the view direction of what the last frame, drawn with `view`, shows at
    /// pixel (`x`, `y`), or at the nearest covered pixel within 6 pixels; `None` where there is nothing, and
    /// outside of the picture. May wait for the device; not for every frame.
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
        let depth = match self.by_host {
            Some(of) => self.depths_by_host(of, part),
            None => self.read_depths(part)?,
        };
        let found = nearest_covered(&depth, part[2], part[3], (x - left, y - top));
        Ok(found.map(|depth| view.distance_of_depth(depth)))
    }

    /// Reversed depths of a part of the picture, left, top, width and height, from the target.
    fn read_depths(&mut self, part: [u32; 4]) -> Result<Vec<f32>, Error> {
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
        let depth = bytemuck::pod_collect_to_vec(probe.bytes());
        self.probe = Some(probe);
        Ok(depth)
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
