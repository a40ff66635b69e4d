//! Frames of the methods that draw a cut: its draw lists are written into mapped memory, then drawn.

use super::{Counts, End, FrameTimes, Renderer, ms};
use crate::abi::{FilteredSplat, Splat, WeightedSplat};
use crate::cut::Cut;
use crate::draw;
use crate::draw::splats::{self, Packed};
use crate::gpu::buffer::Upload;
use crate::gpu::frame::Ticket;
use crate::gpu::{Error, Gpu};
use crate::math::camera::View;
use crate::method::lists::{pack_triangles, records, reserve};
use crate::method::plan::{Drawing, cut_settings, filtered_shade, frame_constants, splat_plan};
use crate::method::scene::Scene;
use crate::method::splats::Splats;
use crate::method::{Method, Settings, filtered, fuzzy, hybrid};
use crate::tree::Model;
use std::sync::Arc;
use std::time::Instant;

impl Renderer {
    pub(super) fn draw_pop(
        &mut self,
        model: &Model,
        scene: &Scene,
        view: &View,
        settings: &Settings,
        end: &mut End<'_>,
    ) -> Result<(Ticket, FrameTimes), Error> {
        let max_point = self.gpu.info().max_point_size_px;
        let is_whole = settings.method == Method::Splats;
        let largest = match Drawing::of(settings) {
            Drawing::Filtered => settings.threshold_px.clamp(1.0, max_point),
            _ => splat_plan(settings, max_point).largest_point_px(model),
        };
        let context = self.context(view, settings, model, largest);
        let start = Instant::now();
        let cut_settings = cut_settings(settings, model);
        self.selector
            .select(model, view, &cut_settings, &mut self.cut);
        let cut_ms = ms(start);

        let pack_start = Instant::now();
        self.frames.wait_for_next()?;
        let lists = &mut self.lists[self.frames.next_slot()];
        let (packed, capacity, splat_bytes) = pack_splats(
            &self.gpu,
            &mut lists.splats,
            model,
            &self.cut,
            view,
            settings,
        )?;
        let triangles: &[u32] = if is_whole { &[] } else { &self.cut.triangles };
        reserve(&self.gpu, &mut lists.indices, 12 * triangles.len() as u64)?;
        pack_triangles(model, scene, triangles, lists);
        let index_bytes = 12 * triangles.len() as u64;
        lists.indices.flush(0..index_bytes);
        let pack_ms = ms(pack_start);

        let submit_start = Instant::now();
        let mut frame = self.frames.begin()?;
        let constants = frame.uniform(&frame_constants(view, settings, &context))?;
        let variant = Splats::variant_of(settings);
        let opaque = self.splats.iter().find(|s| s.variant == variant);
        match (
            Drawing::of(settings),
            &self.triangles,
            opaque,
            &self.filtered,
        ) {
            (Drawing::Opaque, Some((_, pipeline)), Some(splats), _) => {
                hybrid::record_triangles(
                    &mut frame,
                    pipeline,
                    &self.targets,
                    scene,
                    (&lists.indices, &lists.runs),
                    &context,
                    constants,
                );
                splats.record_list(
                    &mut frame,
                    &self.targets,
                    (&lists.splats, packed, capacity),
                    &context,
                    constants,
                );
            }
            (Drawing::Fuzzy, ..) => {
                let Some(fuzzy) = &self.fuzzy else {
                    unreachable!("prepare made the pipelines")
                };
                let list = fuzzy::List {
                    scene,
                    indices: &lists.indices,
                    runs: &lists.runs,
                    splats: fuzzy::Splats::List(&lists.splats, packed, capacity),
                };
                fuzzy.record(&mut frame, &self.targets, list, &context, constants);
            }
            (Drawing::Filtered, _, _, Some(filtered)) => {
                let list = filtered::List {
                    scene,
                    indices: &lists.indices,
                    runs: &lists.runs,
                    splats: &lists.splats,
                    splat_count: packed.points as u32,
                };
                filtered.record(&mut frame, &self.targets, list, &context, constants);
            }
            _ => unreachable!("prepare made the pipelines"),
        }
        let ticket = end(frame, &self.targets.color)?;
        let times = FrameTimes {
            cut_ms,
            pack_ms,
            submit_ms: ms(submit_start),
            counts: Counts {
                nodes_visited: self.cut.stats.visited,
                splats: (packed.points + packed.quads) as u64,
                triangles: triangles.len() as u64,
                points: 0,
                draw_list_bytes: splat_bytes + index_bytes,
            },
            ..FrameTimes::default()
        };
        Ok((ticket, times))
    }
}

/// Writes the splats of a cut into a mapped list: how many of which kind, of how many records, and their bytes.
fn pack_splats(
    gpu: &Arc<Gpu>,
    list: &mut Upload,
    model: &Model,
    cut: &Cut,
    view: &View,
    settings: &Settings,
) -> Result<(Packed, usize, u64), Error> {
    let max_point = gpu.info().max_point_size_px;
    let (packed, capacity, record_bytes) = match Drawing::of(settings) {
        Drawing::Opaque => {
            let plan = splat_plan(settings, max_point);
            let count = splats::count(cut, &plan);
            let out = records::<Splat>(gpu, list, count)?;
            let packed = splats::pack(model, cut, view, &plan, out);
            (packed, count, size_of::<Splat>())
        }
        Drawing::Fuzzy => {
            let plan = splat_plan(settings, max_point);
            let count = splats::count(cut, &plan);
            let out = records::<WeightedSplat>(gpu, list, count)?;
            let packed = splats::pack(model, cut, view, &plan, out);
            (packed, count, size_of::<WeightedSplat>())
        }
        Drawing::Filtered => {
            let most = draw::filtered::splat_count(cut);
            let out = records(gpu, list, most)?;
            let shade = filtered_shade(settings, model);
            let count = draw::filtered::splats(model, cut, view, shade, out);
            let packed = Packed {
                points: count,
                quads: 0,
            };
            (packed, count, size_of::<FilteredSplat>())
        }
        Drawing::Nothing => (Packed::default(), 0, 0),
    };
    let bytes = (capacity * record_bytes) as u64;
    list.flush(0..bytes);
    Ok((packed, capacity, bytes))
}
