//! Frames of the methods that draw a cut: its draw lists are written into mapped memory, then drawn.

use crate::abi::FrameConstants;
use crate::gpu::Error;
use crate::gpu::frame::Ticket;
use crate::math::camera::View;
use crate::pack::{ColorBy, Footprint};
use crate::render::compute_limits;
use crate::render::cost::choose;
use crate::render::cost::choose::Asked;
use crate::render::cost::choose::ComputeShare;
use crate::render::cpu::small_triangles::Screen;
use crate::render::cut_key::CutKey;
use crate::render::frame_constants::frame_constants;
use crate::render::pack_params::{largest_splat_px, splat_plan};
use crate::render::stats::FrameCounts;
use crate::render::stats::{Kept, Stage};
use crate::render::technique::Technique;
use crate::render::vulkan::blended::compute as blended_compute;
use crate::render::vulkan::blended::{filtered, fuzzy};
use crate::render::vulkan::draw_lists::{Held, Key, Packing, Ways};
use crate::render::vulkan::expand_ids;
use crate::render::vulkan::opaque::compute;
use crate::render::vulkan::opaque::compute::Small;
use crate::render::vulkan::opaque::hardware::Splats;
use crate::render::vulkan::opaque::triangle_runs;
use crate::render::vulkan::raster_pass::{RasterList, RasterSplats, RasterTriangles, SplatRecords};
use crate::render::vulkan::renderer::{End, FrameTimes, Renderer, margin_px};
use crate::render::vulkan::scene::Scene;
use crate::render::vulkan::storage_ranges::Triangles;
use crate::render::vulkan::targets::Context;
use crate::render::vulkan::visibility::hardware;
use crate::render::{Method, Path, Settings};
use crate::tree::Model;

/// Where the device places corners of triangles.
fn screen(frame: &FrameConstants, context: &Context) -> Screen {
    Screen::new(
        frame,
        (context.width, context.height),
        context.guard_px,
        context.rect_px,
        crate::render::vulkan::storage_ranges::constants(context).dropped_sign,
    )
}

/// What compute draws opaque splats as in frames of these flags.
pub(super) fn compute_variant(settings: &Settings, model: &Model, flags: u32) -> compute::Variant {
    let plan = splat_plan(settings, f32::INFINITY);
    let one_size_px = plan.has_one_size(model).then_some(plan.threshold_px);
    compute::Variant::new(settings.footprint(), one_size_px, flags)
}

impl Renderer {
    pub(super) fn draw_pop(
        &mut self,
        (model, scene): (&Model, &Scene),
        view: &View,
        (settings, by_id): (&Settings, bool),
        end: &mut End<'_>,
    ) -> Result<(Ticket, FrameTimes), Error> {
        let drawing = Technique::of(settings);
        let is_wanted = self.wants_compute(settings)?;
        let by_compute = drawing == Technique::Opaque && is_wanted;
        let max_point = if by_compute {
            compute_limits::largest_point_px(settings)
        } else {
            self.gpu.info().max_point_size_px
        };
        let is_whole = settings.method == Method::Splats;
        let largest = match Technique::of(settings) {
            Technique::Filtered
                if is_whole || !model.kind().is_surface() || settings.holds_cut() =>
            {
                max_point
            }
            Technique::Filtered => (settings.threshold_px.max(3.0) + 2.0).min(max_point),
            _ => splat_plan(settings, max_point).largest_point_px(model),
        };
        let context = self.context(view, settings, model, largest);
        let mut times = FrameTimes::default();
        let gpu = self.gpu.clone();
        // Those of a mesh are as large as the threshold at most, those of pieces of triangles smaller.
        let has_large = is_whole || !model.kind().is_surface() || settings.holds_cut();
        let samples = gpu.info().is_cpu() && self.targets.normal().is_none();
        let constants = frame_constants(view, settings, &context);
        let key = Key::of(
            settings,
            model,
            scene,
            view,
            (max_point, is_wanted, samples),
            by_id,
        );
        let slot = self.frames.next_slot();
        let cut = Stage::Cut.begin();
        let is_new = if self.keeps_lists && self.lists[slot].hold(&key) {
            times.kept = Kept::Lists;
            false
        } else {
            self.select(model, scene, key.cut())
        };
        let ahead = self.ahead.take().unwrap_or_default();
        if times.kept != Kept::Lists && !is_new && !ahead.is_new {
            times.kept = Kept::Cut;
        }
        cut.end(&mut times);
        times.cut_ms += ahead.ms;

        let packing = Stage::Pack.begin();
        if times.kept != Kept::Lists {
            self.frames.wait_for_next()?;
            let asked = self.asked(settings, &context);
            let sized = Asked {
                size_px: choose::size_px(settings, (model, view), &self.cut),
                ..asked
            };
            let ways = self.ways(&sized, scene, (is_wanted, has_large));
            // Where the rasterizer draws, what is cheaper as a quad is one. Of visibility splats it draws quads alone beside compute.
            let max_point = match &self.costs {
                _ if ways.is_small && drawing == Technique::Visibility => {
                    compute_limits::LARGEST_VISIBLE_PX.min(max_point)
                }
                Some(costs) if ways.is_rastered() => {
                    choose::largest_point_px(costs, settings, max_point)
                }
                _ => max_point,
            };
            let packing = Packing::of(settings, model, (max_point, is_wanted));
            let screen = screen(&constants, &context);
            let triangles = self.cut.triangles.len();
            let cut = &mut self.cut;
            let lists = &mut self.lists[slot];
            lists.pack(&gpu, (model, scene), cut, (key, packing), (ways, &screen))?;
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
            packed,
            placed,
            capacity,
            ..
        } = held;
        let ways = held.ways;
        let share = ways.share.unwrap_or_else(|| {
            let asked = Asked {
                splats: packed.points,
                triangles: held.triangles,
                ..self.asked(settings, &context)
            };
            asked.blended(held.triangles + packed.quads, has_large)
        });
        let mut frame = self.frames.begin()?;
        let flags = constants.flags;
        let constants = frame.uniform(&constants)?;
        if let (Some(by_id), Some(tree)) = (&self.by_id, &self.device_tree) {
            let kind = expand_ids::Kind {
                are_oriented: settings.footprint() == Footprint::Oriented,
                have_areas: drawing == Technique::Fuzzy,
            };
            by_id.record(&mut frame, (tree, scene), (lists, kind), &context)?;
        }
        let areas = if ways.is_small {
            crate::render::screen_bounds::areas(model, view, context.rect_px, margin_px(largest))
        } else {
            Vec::new()
        };
        let small_list = compute::List {
            scene,
            corners: lists.small(),
            runs: &lists.small_runs,
            splats: lists.splats(),
            splat_count: packed.points as u32,
            sample_count: held.samples as u32,
            variant: compute_variant(settings, model, flags),
            areas: &areas,
        };
        // What compute draws of blended splats.
        let small_of = |splats: usize| blended_compute::Small {
            splats: lists.splats(),
            splat_count: splats as u32,
            triangles: Triangles {
                scene,
                corners: lists.small(),
                runs: &lists.small_runs,
            },
        };
        let records = SplatRecords::packed(lists.splats(), packed, capacity);
        let raster = RasterList {
            scene,
            triangles: RasterTriangles::Runs(lists.indices(), &lists.runs),
            splats: RasterSplats::Records(records),
        };
        let variant = Splats::variant_of(settings, flags);
        let opaque = self.splats.iter().find(|s| s.variant == variant);
        match (
            Technique::of(settings),
            &self.triangles,
            opaque,
            &self.filtered,
        ) {
            (Technique::Opaque, Some((_, pipeline)), Some(splats), _) => {
                let small = self.small.as_ref().filter(|_| ways.is_small);
                let records = match small {
                    Some(_) => records.without_points(),
                    None => records,
                };
                let list = RasterList {
                    splats: RasterSplats::Records(records),
                    ..raster
                };
                let has_small = small.is_some() && !small_list.is_empty();
                let has_splats = !records.is_empty();
                // The first pass clears, be there triangles or not.
                let has_triangles = !lists.runs.is_empty() || !(has_small || has_splats);
                if has_triangles {
                    triangle_runs::record_triangles(
                        &mut frame,
                        pipeline,
                        &self.targets,
                        &list,
                        &context,
                        constants,
                    );
                }
                if let Some(small) = small {
                    let context = (&context, !has_triangles);
                    small.record(&mut frame, &self.targets, small_list, context, constants)?;
                }
                splats.record_list(
                    &mut frame,
                    &self.targets,
                    &list,
                    (&context, !has_triangles && !has_small),
                    constants,
                );
            }
            (Technique::Fuzzy, ..) => {
                let Some(fuzzy) = &self.fuzzy else {
                    unreachable!("prepare made the pipelines")
                };
                let list = fuzzy::List {
                    raster: match placed {
                        Some(placed) => RasterList {
                            splats: RasterSplats::Records(SplatRecords::large(
                                lists.splats(),
                                placed,
                                capacity,
                            )),
                            ..raster
                        },
                        None => raster,
                    },
                    small: placed.map(|placed| small_of(placed.small)),
                };
                fuzzy.record(&mut frame, &self.targets, list, &context, constants)?;
            }
            (Technique::Filtered, _, _, Some(filtered)) => {
                let list = filtered::List {
                    raster,
                    small: small_of(packed.points),
                };
                filtered.record(&mut frame, &self.targets, list, share, &context, constants)?;
            }
            (Technique::Visibility, ..) => {
                let Some(visibility) = &self.visibility else {
                    unreachable!("prepare made the pipelines")
                };
                let list = hardware::List {
                    raster,
                    by_compute: ways.is_small.then_some(&areas),
                    largest_px: largest_splat_px(model, settings),
                };
                let how = settings.reconstruction;
                visibility.record(&mut frame, &self.targets, list, how, &context, constants)?;
            }
            _ => unreachable!("prepare made the pipelines"),
        }
        if let (ColorBy::Overdraw, Some(counter)) = (settings.color_by, &self.overdraw) {
            counter.record(&mut frame, &self.targets, &raster, &context, constants);
        }
        let ticket = end(frame, &self.targets.color)?;
        self.lists[slot].are_made();
        submit.end(&mut times);
        times.counts = FrameCounts {
            nodes_visited: held.stats.visited,
            hidden: held.stats.hidden,
            between: held.stats.between,
            splats: placed.map_or(packed.points + packed.quads - held.samples, |p| p.all()) as u64,
            triangles: held.triangles as u64,
            points: 0,
            draw_list_bytes: held.splat_bytes + held.index_bytes,
        };
        Ok((ticket, times))
    }

    /// Whether compute may draw: see [`compute::is_wanted`].
    ///
    /// # Errors
    /// As there.
    pub(super) fn wants_compute(&self, settings: &Settings) -> Result<bool, Error> {
        compute::is_wanted(&self.gpu, settings, &self.targets)
    }

    /// What draws the primitives of a cut, as far as it is known before they are packed. `is_wanted`: compute may draw;
    /// `has_large`: splats may be too large for it.
    fn ways(&self, asked: &Asked<'_>, scene: &Scene, (is_wanted, has_large): (bool, bool)) -> Ways {
        let takes_triangles = is_wanted && Small::takes_triangles(&self.gpu, scene);
        match Technique::of(asked.settings) {
            _ if !is_wanted => Ways {
                share: Some(ComputeShare::Nothing),
                ..Ways::default()
            },
            Technique::Opaque => {
                let paths = asked.opaque();
                let takes_triangles = takes_triangles && paths.triangles == Path::Compute;
                Ways {
                    takes_triangles,
                    is_small: takes_triangles || paths.splats == Path::Compute,
                    share: Some(ComputeShare::Nothing),
                }
            }
            Technique::Visibility => Ways {
                is_small: asked.visible() == Path::Compute,
                share: Some(ComputeShare::Nothing),
                ..Ways::default()
            },
            drawing => {
                let all = match takes_triangles && asked.triangles > 0 {
                    true => asked.all_blended(has_large),
                    false => ComputeShare::Nothing,
                };
                // Filtered splats are known once they are packed.
                let share = match drawing {
                    _ if all != ComputeShare::Nothing => Some(all),
                    Technique::Fuzzy => Some(asked.blended(asked.triangles, has_large)),
                    _ => None,
                };
                Ways {
                    takes_triangles: all != ComputeShare::Nothing,
                    is_small: false,
                    share,
                }
            }
        }
    }

    /// Chooses the cut of a frame, unless it is there: that of the last frame, where it may be kept, or one that was
    /// foreseen for this frame. Returns whether it was chosen.
    pub(super) fn select(
        &mut self,
        model: &Model,
        scene: &Scene,
        (of_scene, choice): (u64, CutKey),
    ) -> bool {
        let may_stay = self.keeps_lists || self.ahead.is_some();
        if may_stay && self.chosen == Some((of_scene, choice)) {
            return false;
        }
        if self.chosen.is_none_or(|(scene, _)| scene != of_scene) {
            self.selector.forget();
        }
        let undrawn = || scene.undrawn(model);
        choice.select(&mut self.selector, model, undrawn, &mut self.cut);
        self.chosen = Some((of_scene, choice));
        self.visited += self.cut.stats.visited;
        true
    }
}
