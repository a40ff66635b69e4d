//! Frames of the methods that draw the whole model: no cut, no draw lists.

use crate::gpu::Error;
use crate::gpu::frame::{FrameRecorder, FrameRing, FrameTicket, UniformBlock};
use crate::pack::ColorBy;
use crate::render::pack_params::largest_splat_px;
use crate::render::stats::FrameCounts;
use crate::render::stats::FrameStage;
use crate::render::technique::Technique;
use crate::render::vulkan::blended::fuzzy;
use crate::render::vulkan::opaque::hardware::OpaqueSplats;
use crate::render::vulkan::raster_pass::{RasterList, RasterSplats, RasterTriangles};
use crate::render::vulkan::renderer::{
    FrameEnd, FrameEnding, FrameTimes, PlannedFrame, VulkanRenderer,
};
use crate::render::vulkan::triangles;
use crate::render::vulkan::visibility::hardware;

impl VulkanRenderer {
    pub(super) fn draw_triangles(
        &mut self,
        drawn: PlannedFrame<'_>,
        end: &mut FrameEnding<'_>,
    ) -> Result<(FrameTicket, FrameTimes), Error> {
        let PlannedFrame { plan, parts, scene } = drawn;
        let Some((_, pipeline)) = &self.triangles else {
            unreachable!("prepare made the pipeline")
        };
        let counts = FrameCounts {
            triangles: parts
                .iter()
                .map(|part| part.model.triangles.len() as u64)
                .sum(),
            ..FrameCounts::default()
        };
        let (targets, context) = (&self.targets, &plan.context);
        let counts_overdraw = plan.settings.color_by == ColorBy::Overdraw;
        let counter = self.overdraw.as_ref().filter(|_| counts_overdraw);
        let frames = &mut self.frames;
        let last = FrameEnd {
            targets,
            looks: &self.looks,
            plan,
            patches: None,
        };
        submit_whole(frames, &last, counts, end, |frame, c| {
            triangles::record(frame, pipeline, targets, scene, context, c);
            if let Some(counter) = counter {
                let list = RasterList {
                    scene,
                    triangles: RasterTriangles::Scene,
                    splats: RasterSplats::Nothing,
                };
                counter.record(frame, targets, &list, context, c);
            }
            Ok(())
        })
    }

    pub(super) fn draw_points(
        &mut self,
        drawn: PlannedFrame<'_>,
        end: &mut FrameEnding<'_>,
    ) -> Result<(FrameTicket, FrameTimes), Error> {
        let PlannedFrame { plan, scene, .. } = drawn;
        let as_quads = plan.primitives.are_quads;
        let counts = FrameCounts {
            points: scene.shown_pages().map(|p| u64::from(p.vertex_count)).sum(),
            ..FrameCounts::default()
        };
        let (targets, context) = (&self.targets, &plan.context);
        let counts_overdraw = plan.settings.color_by == ColorBy::Overdraw;
        let counter = self.overdraw.as_ref().filter(|_| counts_overdraw);
        let variant = OpaqueSplats::variant_of(&plan.settings, plan.constants.flags);
        let opaque = self.splats.iter().find(|s| s.variant == variant);
        let (fuzzy, visibility) = (&self.fuzzy, &self.visibility);
        let raster = RasterList {
            scene,
            triangles: RasterTriangles::Nothing,
            splats: RasterSplats::Vertices { as_quads },
        };
        let frames = &mut self.frames;
        let last = FrameEnd {
            targets,
            looks: &self.looks,
            plan,
            patches: None,
        };
        submit_whole(frames, &last, counts, end, |frame, c| {
            match (plan.technique, opaque, fuzzy, visibility) {
                (Technique::Opaque, Some(splats), ..) => {
                    splats.record_vertices(frame, targets, scene, as_quads, context, c);
                }
                (Technique::Fuzzy, _, Some(fuzzy), _) => {
                    let small = None;
                    fuzzy.record(
                        frame,
                        targets,
                        fuzzy::FuzzyLists { raster, small },
                        context,
                        c,
                    )?;
                }
                (Technique::Visibility, .., Some(visibility)) => {
                    let list = hardware::VisibilityLists {
                        raster,
                        by_compute: None,
                        largest_px: largest_splat_px(&plan.facts, &plan.settings),
                    };
                    let how = plan.settings.reconstruction;
                    visibility.record(frame, targets, list, how, context, c)?;
                }
                _ => unreachable!("prepare made the pipelines"),
            }
            if let Some(counter) = counter {
                counter.record(frame, targets, &raster, context, c);
            }
            Ok(())
        })
    }
}

/// Records and submits a frame of a method that draws the whole model.
fn submit_whole(
    frames: &mut FrameRing,
    last: &FrameEnd<'_>,
    counts: FrameCounts,
    end: &mut FrameEnding<'_>,
    record: impl FnOnce(&mut FrameRecorder<'_>, UniformBlock) -> Result<(), Error>,
) -> Result<(FrameTicket, FrameTimes), Error> {
    let submit = FrameStage::Submit.begin();
    let mut frame = frames.begin()?;
    let constants = frame.uniform(&last.plan.constants)?;
    record(&mut frame, constants)?;
    let ticket = last.end(frame, constants, end)?;
    let mut times = FrameTimes {
        counts,
        ..FrameTimes::default()
    };
    submit.end(&mut times);
    Ok((ticket, times))
}
