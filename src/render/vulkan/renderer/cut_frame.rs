//! Frames of the methods that draw a cut: its draw lists are written into mapped memory, then drawn.

use crate::abi::FrameConstants;
use crate::gpu::Error;
use crate::gpu::frame::Ticket;
use crate::math::camera::View;
use crate::pack::splats::SLACK_PX;
use crate::pack::{ColorBy, Footprint};
use crate::render::compute_limits;
use crate::render::cost::choose;
use crate::render::cost::choose::Asked;
use crate::render::cost::choose::ComputeShare;
use crate::render::cpu::filtered::{Canvas, Light};
use crate::render::cpu::opaque;
use crate::render::cpu::small_triangles::Screen;
use crate::render::frame_constants::frame_constants;
use crate::render::frame_plan::{Choice, Drawing, largest_splat_px, splat_plan};
use crate::render::stats::FrameCounts;
use crate::render::stats::{Kept, Stage};
use crate::render::vulkan::blended::compute as blended_compute;
use crate::render::vulkan::blended::{filtered, fuzzy};
use crate::render::vulkan::draw_lists::{Held, Host, Key, Packing, Ways};
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
use crate::render::{Method, Path, Settings, SplatKind};
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

/// The same to the host.
fn opaque_look(settings: &Settings, model: &Model) -> opaque::Look {
    opaque::Look {
        are_discs: settings.splat == SplatKind::Disc,
        has_one_size: splat_plan(settings, f32::INFINITY).has_one_size(model),
    }
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
        let drawing = Drawing::of(settings);
        let is_wanted = self.wants_compute(settings, model)?;
        let by_compute = drawing == Drawing::Opaque && is_wanted;
        let max_point = if by_compute {
            compute_limits::largest_point_px(settings, self.host_px(settings, model))
        } else {
            self.gpu.info().max_point_size_px
        };
        let is_whole = settings.method == Method::Splats;
        let largest = match Drawing::of(settings) {
            Drawing::Filtered if is_whole || !model.kind().is_surface() || settings.holds_cut() => {
                max_point
            }
            Drawing::Filtered => (settings.threshold_px.max(3.0) + 2.0).min(max_point),
            _ => splat_plan(settings, max_point).largest_point_px(model),
        };
        let context = self.context(view, settings, model, largest);
        let mut times = FrameTimes::default();
        let gpu = self.gpu.clone();
        // Those of a mesh are as large as the threshold at most, those of pieces of triangles smaller.
        let has_large = is_whole || !model.kind().is_surface() || settings.holds_cut();
        let samples = gpu.info().is_cpu() && self.targets.normal().is_none();
        let constants = frame_constants(view, settings, &context);
        let light = (by_compute && self.host_may_draw_opaque(settings))
            .then(|| opaque::Light::new(&constants));
        let key = Key::of(
            settings,
            model,
            scene,
            view,
            (max_point, is_wanted, samples),
            (light, by_id),
        );
        let slot = self.frames.next_slot();
        let cut = Stage::Cut.begin();
        let is_new = if self.keeps_lists && self.lists[slot].hold(&key) {
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
            if let Some(ticket) = self.shown_again.take() {
                self.frames.wait_for(ticket)?;
            }
            let asked = self.asked(settings, model, &context);
            let sized = Asked {
                size_px: choose::size_px(settings, (model, view), &self.cut),
                ..asked
            };
            let mut ways = self.ways(&sized, scene, (is_wanted, has_large));
            if light.is_some() && Light::new(&constants, screen(&constants, &context)).is_some() {
                (ways.takes_triangles, ways.is_small) = (true, true);
            }
            // Where the rasterizer draws, what is cheaper as a quad is one. Of visibility splats it draws quads alone beside compute.
            let max_point = match &self.costs {
                _ if ways.is_small && drawing == Drawing::Visibility => {
                    compute_limits::LARGEST_VISIBLE_PX.min(max_point)
                }
                Some(costs) if ways.is_rastered() => {
                    choose::largest_point_px(costs, settings, max_point)
                }
                _ => max_point,
            };
            let packing = Packing::of(settings, model, (max_point, is_wanted));
            let canvas = self.canvas(settings, context.rect_px);
            let screen = screen(&constants, &context);
            let filtered = |[splats, triangles]: [usize; 2]| {
                let asked = Asked {
                    splats,
                    triangles,
                    ..asked
                };
                // Few as they are, triangles cost the host no more than a software rasterizer.
                let pays = triangles > 0 || asked.blended(0, false) != ComputeShare::Nothing;
                let canvas = canvas.filter(|_| pays)?;
                Some((canvas, Light::new(&constants, screen)))
            };
            let look = opaque_look(settings, model);
            let opaque = light.and_then(|light| {
                let screen = opaque::Screen::new(&constants, context.rect_px)?;
                Some((look, (screen, light)))
            });
            let triangles = self.cut.triangles.len();
            let cut = &mut self.cut;
            let lists = &mut self.lists[slot];
            let host = Host {
                filtered: &filtered,
                opaque,
                triangle_light: Light::new(&constants, screen),
            };
            let how = (ways, &screen, host);
            lists.pack(&gpu, (model, scene), cut, (key, packing), how)?;
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
        let (host_ms, drawn_bytes) = lists.host();
        let share = ways.share.unwrap_or_else(|| {
            let asked = Asked {
                splats: packed.points,
                triangles: held.triangles,
                ..self.asked(settings, model, &context)
            };
            asked.blended(held.triangles + packed.quads, has_large)
        });
        let mut frame = self.frames.begin()?;
        let flags = constants.flags;
        let constants = frame.uniform(&constants)?;
        if let (Some(by_id), Some(tree)) = (&self.by_id, &self.device_tree) {
            let kind = expand_ids::Kind {
                are_oriented: settings.footprint() == Footprint::Oriented,
                have_areas: drawing == Drawing::Fuzzy,
            };
            by_id.record(&mut frame, (tree, scene), (lists, kind), &context)?;
        }
        let areas = if ways.is_small && !held.is_shown {
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
            drawn: (held.is_drawn && drawing == Drawing::Opaque).then_some(&lists.nearest),
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
        self.by_host = held.is_shown.then_some((slot, context.rect_px));
        match (
            Drawing::of(settings),
            &self.triangles,
            opaque,
            &self.filtered,
        ) {
            (Drawing::Opaque, ..) if held.is_shown => {}
            (Drawing::Opaque, Some((_, pipeline)), Some(splats), _) => {
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
            (Drawing::Fuzzy, ..) => {
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
            (Drawing::Filtered, _, _, Some(filtered)) => {
                let list = filtered::List {
                    raster,
                    small: small_of(packed.points),
                    drawn: held.is_drawn.then_some(&lists.drawn),
                };
                filtered.record(&mut frame, &self.targets, list, share, &context, constants)?;
            }
            (Drawing::Visibility, ..) => {
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
        let picture = lists.nearest.image().filter(|_| held.is_shown);
        let ticket = end(frame, picture.unwrap_or(&self.targets.color))?;
        self.lists[slot].are_made();
        submit.end(&mut times);
        if held.is_drawn && times.kept != Kept::Lists {
            times.host_ms = host_ms;
        }
        times.counts = FrameCounts {
            nodes_visited: held.stats.visited,
            hidden: held.stats.hidden,
            between: held.stats.between,
            splats: placed.map_or(
                packed.points + packed.quads - held.samples - held.undrawn,
                |p| p.all(),
            ) as u64,
            triangles: held.triangles as u64,
            points: 0,
            draw_list_bytes: held.splat_bytes + held.index_bytes + drawn_bytes,
        };
        Ok((ticket, times))
    }

    /// Whether the host may draw what compute is to: what a software device does by compute, the host does in less time, but
    /// somebody may insist on a path.
    pub(super) fn host_may_draw(&self, settings: &Settings) -> bool {
        let is_software = self.gpu.info().is_cpu();
        is_software
            && self.is_helped
            && settings.splat.host_draws()
            && match settings.path {
                Path::Auto => true,
                Path::Compute => self.host_may_draw,
                Path::Raster => false,
            }
    }

    /// The same of opaque splats.
    pub(super) fn host_may_draw_opaque(&self, settings: &Settings) -> bool {
        self.host_may_draw(settings) && compute::host_draws(&self.gpu, &self.targets)
    }

    /// The largest opaque splat that the host draws in the place of compute, pixels, where it draws all of them, whatever triangles there
    /// are: as large as a point may be.
    pub(super) fn host_px(&self, settings: &Settings, model: &Model) -> Option<f32> {
        // Else small triangles are compute's, and splats with them.
        let is_sure = settings.method == Method::Splats
            || !model.kind().is_surface()
            || settings.color_by == ColorBy::Shading
                && splat_plan(settings, f32::INFINITY).has_one_size(model);
        let color = self.targets.color();
        let draws = is_sure
            && color.width.max(color.height) <= u32::from(u16::MAX)
            && Drawing::of(settings) == Drawing::Opaque
            && self.host_may_draw_opaque(settings);
        draws.then(|| self.gpu.info().max_point_size_px - SLACK_PX)
    }

    /// Whether compute is to draw, or the host in its place: see [`compute::is_wanted`].
    pub(super) fn wants_compute(&self, settings: &Settings, model: &Model) -> Result<bool, Error> {
        let host_px = self.host_px(settings, model);
        compute::is_wanted(&self.gpu, settings, &self.targets, host_px)
    }

    /// Where the host draws filtered splats, if it may.
    fn canvas(&self, settings: &Settings, rect_px: [u32; 4]) -> Option<Canvas> {
        if Drawing::of(settings) != Drawing::Filtered || !self.host_may_draw(settings) {
            return None;
        }
        let is_gray = self.filtered.as_ref()?.variant.by_compute?;
        Some(Canvas { rect_px, is_gray })
    }

    /// What draws the primitives of a cut, as far as it is known before they are packed. `is_wanted`: compute may draw;
    /// `has_large`: splats may be too large for it.
    fn ways(&self, asked: &Asked<'_>, scene: &Scene, (is_wanted, has_large): (bool, bool)) -> Ways {
        let takes_triangles = is_wanted && Small::takes_triangles(&self.gpu, scene);
        match Drawing::of(asked.settings) {
            _ if !is_wanted => Ways {
                share: Some(ComputeShare::Nothing),
                ..Ways::default()
            },
            Drawing::Opaque => {
                let paths = asked.opaque();
                let takes_triangles = takes_triangles && paths.triangles == Path::Compute;
                Ways {
                    takes_triangles,
                    is_small: takes_triangles || paths.splats == Path::Compute,
                    share: Some(ComputeShare::Nothing),
                }
            }
            Drawing::Visibility => Ways {
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
                    Drawing::Fuzzy => Some(asked.blended(asked.triangles, has_large)),
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
        (of_scene, choice): (u64, Choice),
    ) -> bool {
        let may_stay = self.keeps_lists || self.foreseen.is_some();
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
