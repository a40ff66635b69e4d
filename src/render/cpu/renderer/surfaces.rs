//! Opaque pictures that hold more than colors of eight bits in the headlight.

use crate::abi::Splat;
use crate::pack::ColorBy;
use crate::render::cpu::frame_shading::FrameShading;
use crate::render::cpu::opaque;
use crate::render::cpu::opaque::ShownRectangle;
use crate::render::cpu::picture::PixelWords;
use crate::render::cpu::renderer::{CpuFrame, CpuRenderer, DrawnCounts};
use crate::render::pack_params::splat_plan;
use crate::render::{Method, Settings};

impl CpuRenderer {
    /// Tells whether an opaque picture holds more than colors of eight bits in the headlight.
    pub(super) fn needs_surfaces(&self, settings: &Settings) -> bool {
        let outputs = self.planes.outputs();
        outputs.values || outputs.normal || !settings.has_headlight()
    }

    /// As [`CpuRenderer::draw_opaque`], in any light, with all outputs: what is seen is found first, and then shaded.
    pub(super) fn draw_surfaces(
        &mut self,
        frame: &CpuFrame<'_>,
        light: &opaque::FrameHeadlight,
        pixels: &mut PixelWords<'_>,
    ) -> DrawnCounts {
        let settings = frame.settings;
        let rect_px = frame.context.rect_px;
        let Some(screen) = opaque::SplatScreen::new(frame.constants, rect_px) else {
            unreachable!("sides of pictures are limited");
        };
        let plan = splat_plan(settings, f32::INFINITY);
        let count = match settings.has_cut() {
            true => self.cuts.splat_count(&plan),
            false => 0,
        };
        let has_one_size = plan.has_one_size(frame.plan.facts.kind);
        // A splat does not say that it is one of a triangle, which is tinted otherwise. Its color is one of eight bits, before
        // light falls on it.
        let samples_triangles = has_one_size
            && settings.method == Method::Pop
            && settings.color_by != ColorBy::Primitive
            && !settings.holds_cut();
        let (written, samples) = self.pack_opaque(
            frame,
            &plan,
            &frame.corner_screen(),
            [count, usize::from(samples_triangles)],
        );
        self.set_triangles(frame, samples_triangles);
        let list = opaque::SurfaceList {
            triangles: &self.triangles,
            meshes: frame.meshes,
            splats: &self.splats[..written],
            look: opaque::SplatShape {
                footprint: settings.footprint(),
                has_one_size,
            },
            samples: &self.splats[written..written + samples],
            shading: &FrameShading::new(frame.constants),
        };
        let rect_pixels = screen.pixels();
        let pitch = pixels.pitch;
        let picture = ShownRectangle {
            colors: pixels.from(rect_px),
            pitch,
            depths: &mut self.depths[..rect_pixels],
            is_begun: false,
        };
        let (target, planes) = ((&screen, light), self.planes.planes());
        opaque::draw_surfaces(list, target, &mut self.places, picture, planes);
        let triangles = match settings.method {
            Method::Pop => self.cuts.triangle_count(),
            _ => self.triangles_given,
        };
        let records = written + samples;
        DrawnCounts {
            splats: written,
            triangles,
            list_bytes: (size_of::<Splat>() * records + 12 * triangles + 8 * rect_pixels) as u64,
        }
    }
}
