//! Frames of the methods that draw a cut: its draw lists are written into mapped memory, then drawn.

use super::{Counts, End, FrameTimes, Renderer};
use crate::gpu::Error;
use crate::gpu::frame::Ticket;
use crate::math::camera::View;
use crate::method::compute::list::Triangles;
use crate::method::compute::twin::Share;
use crate::method::compute::{self, Small};
use crate::method::lists::{Held, Key};
use crate::method::plan::{Choice, Drawing, frame_constants, largest_splat_px, splat_plan};
use crate::method::scene::Scene;
use crate::method::splats::Splats;
use crate::method::times::{Kept, Stage};
use crate::method::{Method, Settings, SplatKind, filtered, fuzzy, hybrid, visibility};
use crate::tree::Model;

impl Renderer {
    pub(super) fn draw_pop(
        &mut self,
        model: &Model,
        scene: &Scene,
        view: &View,
        settings: &Settings,
        end: &mut End<'_>,
    ) -> Result<(Ticket, FrameTimes), Error> {
        let is_opaque = Drawing::of(settings) == Drawing::Opaque;
        let is_wanted = compute::is_wanted(&self.gpu, settings, &self.targets)?;
        let by_compute = is_opaque && is_wanted;
        let max_point = if by_compute {
            compute::largest_point_px(settings)
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
        let gpu = self.gpu.clone();
        let takes_triangles = |points: usize, triangles: usize| {
            let pays = if is_opaque {
                compute::pays(triangles, 1.0, context.rect_px, settings)
            } else {
                // The passes over the picture are there for splats and triangles alike.
                let all = points + triangles;
                triangles > 0 && compute::pays(all, 0.125, context.rect_px, settings)
            };
            is_wanted && pays && Small::takes_triangles(&gpu, scene)
        };
        let key = Key::of(settings, model, scene, view, max_point);
        let slot = self.frames.next_slot();
        let cut = Stage::Cut.begin();
        let is_new = if self.keeps_lists && self.lists[slot].hold(&key, takes_triangles) {
            times.kept = Kept::Lists;
            false
        } else {
            self.select(model, scene, key.cut())
        };
        let foreseen = self.foreseen.take().unwrap_or_default();
        if times.kept != Kept::Lists && !is_new && !foreseen.is_new {
            times.kept = Kept::Cut;
        }
        cut.end(&mut times);
        times.cut_ms += foreseen.ms;

        let packing = Stage::Pack.begin();
        if times.kept != Kept::Lists {
            self.frames.wait_for_next()?;
            let triangles = self.cut.triangles.len();
            let cut = &mut self.cut;
            self.lists[slot].pack(&gpu, (model, scene), cut, key, takes_triangles)?;
            if self.cut.triangles.len() != triangles {
                self.chosen = None;
            }
        }
        packing.end(&mut times);
        let upload = Stage::Upload.begin();
        if times.kept != Kept::Lists {
            self.lists[slot].flush();
        }
        upload.end(&mut times);

        let submit = Stage::Submit.begin();
        let lists = &self.lists[slot];
        let Some(held) = lists.held else {
            unreachable!("packed now or before")
        };
        let Held {
            packed, capacity, ..
        } = held;
        // What is hidden counts too: the way that primitives go, and so the last bits of the picture, must not depend
        // on it.
        let all_splats = capacity + held.stats.hidden as usize;
        let mut frame = self.frames.begin()?;
        let constants = frame.uniform(&frame_constants(view, settings, &context))?;
        let small_list = compute::List {
            scene,
            corners: &lists.small,
            runs: &lists.small_runs,
            splats: &lists.splats,
            splat_count: packed.points as u32,
            are_discs: settings.splat == SplatKind::Disc,
        };
        // Those of a mesh are as large as the threshold at most, those of pieces of triangles smaller.
        let has_large = is_whole || model.triangles.is_empty() || settings.holds_cut();
        let others = held.triangles + packed.quads;
        let share = if held.takes_triangles {
            Share::of_all(has_large)
        } else {
            Share::of(
                settings,
                (packed.points, others),
                has_large,
                context.rect_px,
            )
        };
        let small_triangles = Triangles {
            scene,
            corners: &lists.small,
            runs: &lists.small_runs,
        };
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
                let pays = held.takes_triangles
                    || compute::pays(all_splats, 0.125, context.rect_px, settings);
                if let (true, Some(small)) = (by_compute && pays, &self.small) {
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
                    small: small_triangles,
                    splats: fuzzy::Splats::List(&lists.splats, packed, capacity),
                };
                fuzzy.record(&mut frame, &self.targets, list, share, &context, constants)?;
            }
            (Drawing::Filtered, _, _, Some(filtered)) => {
                let list = filtered::List {
                    scene,
                    indices: &lists.indices,
                    runs: &lists.runs,
                    small: small_triangles,
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
            nodes_visited: held.stats.visited,
            hidden: held.stats.hidden,
            splats: (packed.points + packed.quads) as u64,
            triangles: held.triangles as u64,
            points: 0,
            draw_list_bytes: held.splat_bytes + held.index_bytes,
        };
        Ok((ticket, times))
    }

    /// Chooses the cut of a frame, unless it is there: that of the last frame, where it may be kept, or one that was
    /// foreseen for this frame. Returns whether it was chosen.
    pub(super) fn select(
        &mut self,
        model: &Model,
        scene: &Scene,
        (of_scene, choice): (u64, Choice),
    ) -> bool {
        let may_stay = self.keeps_lists || self.foreseen.is_some();
        if may_stay && self.chosen == Some((of_scene, choice)) {
            return false;
        }
        let undrawn = || scene.undrawn(model);
        choice.select(&mut self.selector, model, undrawn, &mut self.cut);
        self.chosen = Some((of_scene, choice));
        self.visited += self.cut.stats.visited;
        true
    }
}
