//! Frames of the methods that draw the whole model: no cut, no draw lists.

use crate::abi::FrameConstants;
use crate::gpu::Error;
use crate::gpu::frame::{Frame, Frames, Ticket, Uniform};
use crate::math::camera::View;
use crate::pack::ColorBy;
use crate::render::Settings;
use crate::render::cost::choose;
use crate::render::frame_constants::frame_constants;
use crate::render::pack_params::{largest_splat_px, splat_plan};
use crate::render::stats::FrameCounts;
use crate::render::stats::Stage;
use crate::render::technique::Technique;
use crate::render::vulkan::blended::fuzzy;
use crate::render::vulkan::opaque::hardware::Splats;
use crate::render::vulkan::raster_pass::{RasterList, RasterSplats, RasterTriangles};
use crate::render::vulkan::renderer::{End, FrameTimes, Renderer};
use crate::render::vulkan::scene::Scene;
use crate::render::vulkan::targets::Targets;
use crate::render::vulkan::triangles;
use crate::render::vulkan::visibility::hardware;
use crate::tree::Model;

impl Renderer {
    pub(super) fn draw_triangles(
        &mut self,
        model: &Model,
        scene: &Scene,
        view: &View,
        settings: &Settings,
        end: &mut End<'_>,
    ) -> Result<(Ticket, FrameTimes), Error> {
        let context = self.context(view, settings, model, 0.0);
        let Some((_, pipeline)) = &self.triangles else {
            unreachable!("prepare made the pipeline")
        };
        let counts = FrameCounts {
            triangles: model.triangles.len() as u64,
            ..FrameCounts::default()
        };
        let constants = frame_constants(view, settings, &context);
        let targets = &self.targets;
        let counter = self
            .overdraw
            .as_ref()
            .filter(|_| settings.color_by == ColorBy::Overdraw);
        submit_whole(
            &mut self.frames,
            targets,
            &constants,
            counts,
            end,
            |frame, c| {
                triangles::record(frame, pipeline, targets, scene, &context, c);
                if let Some(counter) = counter {
                    let list = RasterList {
                        scene,
                        triangles: RasterTriangles::Scene,
                        splats: RasterSplats::Nothing,
                    };
                    counter.record(frame, targets, &list, &context, c);
                }
                Ok(())
            },
        )
    }

    pub(super) fn draw_points(
        &mut self,
        model: &Model,
        scene: &Scene,
        view: &View,
        settings: &Settings,
        end: &mut End<'_>,
    ) -> Result<(Ticket, FrameTimes), Error> {
        let max_point = self.gpu.info().max_point_size_px;
        let largest = splat_plan(settings, max_point).vertex_px(view);
        let most = match &self.costs {
            Some(costs) => choose::largest_point_px(costs, settings, max_point),
            None => max_point,
        };
        let as_quads = largest > most;
        // Quads need no guard band; those that might be points have the same, so that both give the same picture.
        let guard_px = if largest > max_point { 0.0 } else { largest };
        let context = self.context(view, settings, model, guard_px);
        let counts = FrameCounts {
            points: scene.pages.iter().map(|p| u64::from(p.vertex_count)).sum(),
            ..FrameCounts::default()
        };
        let constants = frame_constants(view, settings, &context);
        let targets = &self.targets;
        let counter = self
            .overdraw
            .as_ref()
            .filter(|_| settings.color_by == ColorBy::Overdraw);
        let variant = Splats::variant_of(settings, constants.flags);
        let opaque = self.splats.iter().find(|s| s.variant == variant);
        let raster = RasterList {
            scene,
            triangles: RasterTriangles::Nothing,
            splats: RasterSplats::Vertices { as_quads },
        };
        submit_whole(
            &mut self.frames,
            targets,
            &constants,
            counts,
            end,
            |frame, c| {
                match (Technique::of(settings), opaque, &self.fuzzy) {
                    (Technique::Opaque, Some(splats), _) => {
                        splats.record_vertices(frame, targets, scene, as_quads, &context, c);
                    }
                    (Technique::Fuzzy, _, Some(fuzzy)) => {
                        let list = fuzzy::List {
                            raster,
                            small: None,
                        };
                        fuzzy.record(frame, targets, list, &context, c)?;
                    }
                    (Technique::Visibility, ..) => {
                        let Some(visibility) = &self.visibility else {
                            unreachable!("prepare made the pipelines")
                        };
                        let list = hardware::List {
                            raster,
                            by_compute: None,
                            largest_px: largest_splat_px(model, settings),
                        };
                        let how = settings.reconstruction;
                        visibility.record(frame, targets, list, how, &context, c)?;
                    }
                    _ => unreachable!("prepare made the pipelines"),
                }
                if let Some(counter) = counter {
                    counter.record(frame, targets, &raster, &context, c);
                }
                Ok(())
            },
        )
    }
}

/// Records and submits a frame of a method that draws the whole model.
fn submit_whole(
    frames: &mut Frames,
    targets: &Targets,
    constants: &FrameConstants,
    counts: FrameCounts,
    end: &mut End<'_>,
    record: impl FnOnce(&mut Frame<'_>, Uniform) -> Result<(), Error>,
) -> Result<(Ticket, FrameTimes), Error> {
    let submit = Stage::Submit.begin();
    let mut frame = frames.begin()?;
    let constants = frame.uniform(constants)?;
    record(&mut frame, constants)?;
    let ticket = end(frame, &targets.color)?;
    let mut times = FrameTimes {
        counts,
        ..FrameTimes::default()
    };
    submit.end(&mut times);
    Ok((ticket, times))
}
