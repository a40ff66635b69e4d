//! Frames of the methods that draw a cut: its draw lists are written into mapped memory, then drawn.

use super::{Counts, End, FrameTimes, Renderer};
use crate::abi::{FilteredSplat, Splat, WeightedSplat};
use crate::cut::Cut;
use crate::draw;
use crate::draw::splats::{self, Packed};
use crate::gpu::buffer::Upload;
use crate::gpu::frame::Ticket;
use crate::gpu::{Error, Gpu};
use crate::math::camera::View;
use crate::method::compute::choice::{self, Asked};
use crate::method::compute::twin::Share;
use crate::method::compute::{self, Small};
use crate::method::lists::{pack_triangles, records, reserve};
use crate::method::plan::{
    self, Drawing, cut_settings, filtered_shade, frame_constants, largest_splat_px, splat_plan,
};
use crate::method::scene::Scene;
use crate::method::splats::Splats;
use crate::method::times::Stage;
use crate::method::{Method, Path, Settings, filtered, fuzzy, hybrid, visibility};
use crate::tree::Model;
use std::sync::Arc;

impl Renderer {
    pub(super) fn draw_pop(
        &mut self,
        model: &Model,
        scene: &Scene,
        view: &View,
        settings: &Settings,
        end: &mut End<'_>,
    ) -> Result<(Ticket, FrameTimes), Error> {
        let drawing = Drawing::of(settings);
        let is_wanted = compute::is_wanted(&self.gpu, settings, &self.targets)?;
        let by_compute = drawing == Drawing::Opaque && is_wanted;
        let max_point = if by_compute {
            compute::LARGEST_SQUARE_PX
        } else {
            self.gpu.info().max_point_size_px
        };
        let is_whole = settings.method == Method::Splats;
        let largest = match Drawing::of(settings) {
            Drawing::Filtered if is_whole || model.triangles.is_empty() || settings.holds_cut() => {
                max_point
            }
            Drawing::Filtered => (settings.threshold_px.max(3.0) + 2.0).min(max_point),
            _ => splat_plan(settings, max_point).largest_point_px(model),
        };
        let context = self.context(view, settings, model, largest);
        let mut times = FrameTimes::default();
        let cut = Stage::Cut.begin();
        let with = (cut_settings(settings, model), settings.occlusion);
        let of_cut = settings.view_of_cut(view);
        let foreseen_ms = match self.foreseen.take() {
            Some((of, chosen, ms, _)) if of == *of_cut && chosen == with => ms,
            other => {
                self.select(model, scene, view, settings);
                other.map_or(0.0, |(_, _, ms, _)| ms)
            }
        };
        cut.end(&mut times);
        times.cut_ms += foreseen_ms;

        let packing = Stage::Pack.begin();
        self.frames.wait_for_next()?;
        // Those of a mesh are as large as the threshold at most, those of pieces of triangles smaller.
        let has_large = is_whole || model.triangles.is_empty() || settings.holds_cut();
        let asked = self.asked(settings, &context);
        let paths = by_compute.then(|| asked.opaque());
        let takes_triangles = paths.is_some_and(|p| p.triangles == Path::Compute)
            && Small::takes_triangles(&self.gpu, scene);
        let is_small = takes_triangles || paths.is_some_and(|p| p.splats == Path::Compute);
        // Filtered splats are known once they are packed.
        let early_share = match drawing {
            _ if by_compute || !is_wanted => Some(Share::Nothing),
            Drawing::Fuzzy if self.costs.is_some() => {
                Some(asked.blended(asked.triangles, has_large))
            }
            _ => None,
        };
        let is_rastered = !is_small && early_share.is_none_or(|share| share == Share::Nothing);
        let max_point = match &self.costs {
            Some(costs) if is_rastered => choice::largest_point_px(costs, settings, max_point),
            _ => max_point,
        };
        let lists = &mut self.lists[self.frames.next_slot()];
        let (packed, capacity, splat_bytes) = pack_splats(
            &self.gpu,
            &mut lists.splats,
            model,
            &mut self.cut,
            view,
            (settings, max_point),
        )?;
        let triangles: &[u32] = if is_whole { &[] } else { &self.cut.triangles };
        reserve(&self.gpu, &mut lists.indices, 12 * triangles.len() as u64)?;
        if takes_triangles {
            reserve(&self.gpu, &mut lists.small, 12 * triangles.len() as u64)?;
        }
        let small =
            takes_triangles.then(|| is_small_on_screen(model, view, compute::LARGEST_TRIANGLE_PX));
        pack_triangles(model, scene, triangles, lists, small);
        let index_bytes = 12 * triangles.len() as u64;
        packing.end(&mut times);
        let upload = Stage::Upload.begin();
        lists.splats.flush(0..splat_bytes);
        lists.indices.flush(0..index_bytes);
        if takes_triangles {
            lists.small.flush(0..index_bytes);
        }
        upload.end(&mut times);

        let submit = Stage::Submit.begin();
        let mut frame = self.frames.begin()?;
        let constants = frame.uniform(&frame_constants(view, settings, &context))?;
        let small_list = compute::List {
            scene,
            corners: &lists.small,
            runs: &lists.small_runs,
            splats: &lists.splats,
            splat_count: packed.points as u32,
        };
        let share = early_share.unwrap_or_else(|| {
            let asked = Asked {
                splats: packed.points,
                triangles: triangles.len(),
                ..asked
            };
            asked.blended(triangles.len() + packed.quads, has_large)
        });
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
                let mut packed_left = packed;
                if let (true, Some(small)) = (is_small, &self.small) {
                    small.record(&mut frame, &self.targets, small_list, &context, constants)?;
                    packed_left.points = 0;
                }
                splats.record_list(
                    &mut frame,
                    &self.targets,
                    (&lists.splats, packed_left, capacity),
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
                fuzzy.record(&mut frame, &self.targets, list, share, &context, constants)?;
            }
            (Drawing::Filtered, _, _, Some(filtered)) => {
                let list = filtered::List {
                    scene,
                    indices: &lists.indices,
                    runs: &lists.runs,
                    splats: &lists.splats,
                    splat_count: packed.points as u32,
                };
                filtered.record(&mut frame, &self.targets, list, share, &context, constants)?;
            }
            (Drawing::Visibility, ..) => {
                let Some(visibility) = &self.visibility else {
                    unreachable!("prepare made the pipelines")
                };
                let list = visibility::List {
                    scene,
                    triangles: Some((&lists.indices, &lists.runs)),
                    splats: visibility::Splats::List(&lists.splats, packed, capacity),
                    largest_px: largest_splat_px(model, settings),
                };
                let how = settings.reconstruction;
                visibility.record(&mut frame, &self.targets, list, how, &context, constants);
            }
            _ => unreachable!("prepare made the pipelines"),
        }
        let ticket = end(frame, &self.targets.color)?;
        submit.end(&mut times);
        times.counts = Counts {
            nodes_visited: self.cut.stats.visited,
            hidden: self.cut.stats.hidden,
            splats: (packed.points + packed.quads) as u64,
            triangles: triangles.len() as u64,
            points: 0,
            draw_list_bytes: splat_bytes + index_bytes,
        };
        Ok((ticket, times))
    }

    /// Chooses the cut of a frame.
    pub(super) fn select(
        &mut self,
        model: &Model,
        scene: &Scene,
        view: &View,
        settings: &Settings,
    ) {
        let undrawn = || scene.undrawn(model);
        let cut = &mut self.cut;
        plan::select(&mut self.selector, model, view, settings, undrawn, cut);
    }
}

/// Writes the splats of a cut into a mapped list: how many of which kind, of how many records, and their bytes.
fn pack_splats(
    gpu: &Arc<Gpu>,
    list: &mut Upload,
    model: &Model,
    cut: &mut Cut,
    view: &View,
    (settings, max_point): (&Settings, f32),
) -> Result<(Packed, usize, u64), Error> {
    let (packed, capacity, record_bytes) = match Drawing::of(settings) {
        Drawing::Opaque | Drawing::Visibility => {
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
            let shade = filtered_shade(settings, model, max_point);
            let large = draw::filtered::take_triangles(model, view, &shade, cut);
            let most = draw::filtered::splat_count(cut, large);
            let out = records(gpu, list, most)?;
            let count = draw::filtered::splats(model, cut, large, view, shade, out);
            let packed = Packed {
                points: count,
                quads: 0,
            };
            (packed, count, size_of::<FilteredSplat>())
        }
        Drawing::Nothing => (Packed::default(), 0, 0),
    };
    Ok((packed, capacity, (capacity * record_bytes) as u64))
}

/// Whether a leaf's bounding sphere is wholly in front of the near plane and at most `most_px` pixels wide.
fn is_small_on_screen<'a>(
    model: &'a Model,
    view: &View,
    most_px: f32,
) -> impl Fn(u32) -> bool + use<'a> {
    let row = view.view_from_model.row(2);
    let (near, is_perspective) = (view.near, view.is_perspective);
    // In view space; the bound of the size is that of the sphere's nearest point.
    let ratio = 2.0 * view.focal_px() * view.model_scale / most_px;
    let scale = view.model_scale;
    move |leaf| {
        let sphere = &model.tree.leaves[leaf as usize];
        let nearest = -row.dot(sphere.center.extend(1.0)) - sphere.radius * scale;
        nearest > near && ratio * sphere.radius <= if is_perspective { nearest } else { 1.0 }
    }
}
