//! Whole frames on the processor: cut, pack and draw, triangles of any size included. No device is needed.

mod blended;
mod looks;
mod polygons;
mod surfaces;
mod visible;

use crate::abi::{FilteredSplat, FrameConstants, OrientedPolygon, Splat};
use crate::cut::CutSelector;
use crate::image::Image;
use crate::math::camera::View;
use crate::pack;
use crate::pack::ColorBy;
use crate::pack::small_triangles;
use crate::pack::small_triangles::LargeTriangles;
use crate::pack::splats::SplatPlan;
use crate::patches::PatchRaster;
use crate::projective::frame_photos::FramePhotos;
use crate::render::backdrop::BackgroundGradient;
use crate::render::cpu::ambient_occlusion::AmbientOcclusionLook;
use crate::render::cpu::eye_dome::DepthLogarithms;
use crate::render::cpu::filtered;
use crate::render::cpu::filtered::normalize::{NormalizeParams, NormalizedPicture, normalize};
use crate::render::cpu::filtered::{GroupedSplats, PictureArea};
use crate::render::cpu::float_planes::{FloatPlanes, word_of};
use crate::render::cpu::opaque;
use crate::render::cpu::opaque::{CutMesh, ShownRectangle, SplatPlaces};
use crate::render::cpu::picture::{DrawnArea, PixelWords};
use crate::render::cpu::triangles::{CutTriangles, FrameLight, MeshVertices, SurfaceMesh};
use crate::render::cut_key::CutKey;
use crate::render::frame_constants::FrameContext;
use crate::render::frame_plan::FramePlan;
use crate::render::model_facts::{DrawnParts, FactedModel};
use crate::render::pack_params::{filtered_shade, splat_plan};
use crate::render::part_cuts::PartCuts;
use crate::render::screen_bounds;
use crate::render::stats::{CutAhead, FrameCounts, FrameStage, FrameTimes, KeptWork};
use crate::render::technique::Technique;
use crate::render::{Method, PictureOutputs, Settings};
use crate::tree::Model;
use bytemuck::Zeroable;
use std::sync::Arc;
use std::time::Instant;

/// Binary places of a pixel to which corners are snapped.
const SUBPIXEL_BITS: u32 = 8;

/// What decides a frame; equal ones are the same picture.
#[derive(Debug, Clone, Copy, PartialEq)]
struct CpuFrameKey {
    drawn: u64,
    view: View,
    settings: Settings,
}

/// Draws frames of one size on the processor, of what [`unsupported_reason`](crate::render::cpu::supported::unsupported_reason)
/// does not refuse.
#[derive(Debug)]
pub struct CpuRenderer {
    size: [u32; 2],
    selector: CutSelector,
    pub(super) cuts: PartCuts,
    patch_raster: PatchRaster,
    /// Oriented polygons of the last frame that had any.
    polygons: Vec<OrientedPolygon>,
    /// What the present cut was chosen for, and for which model; none where drawing changed it.
    chosen: Option<(u64, CutKey)>,
    /// What the last frame was of, where it may be kept.
    drawn: Option<CpuFrameKey>,
    keeps_frames: bool,
    last_times: FrameTimes,
    /// The cut that was chosen for the next frame before it is drawn; none: not yet.
    pub(super) ahead: Option<CutAhead>,
    visited: u64,
    splats: Vec<Splat>,
    rest: LargeTriangles,
    /// Of each part, those that are drawn as triangles where that is not all of the cut's.
    triangle_ids: Vec<Vec<u32>>,
    /// Number of triangles that were set up.
    pub(super) triangles_given: usize,
    triangles: CutTriangles,
    /// The same, where the first of two passes that blend has them.
    pushed: CutTriangles,
    places: SplatPlaces,
    filtered: Vec<FilteredSplat>,
    front: Vec<u32>,
    sums: Vec<u64>,
    /// Reversed depths of the rectangle, row by row.
    depths: Vec<f32>,
    planes: FloatPlanes,
    rect_px: [u32; 4],
    eye_dome: DepthLogarithms,
    ambient_occlusion: AmbientOcclusionLook,
    /// Background of the last frame.
    gradient: Option<BackgroundGradient>,
    photos: Option<Arc<FramePhotos>>,
}

/// What of a frame is drawn, counted.
#[derive(Debug, Clone, Copy, Default)]
struct DrawnCounts {
    splats: usize,
    triangles: usize,
    /// Bytes of records, of corners, and of what was drawn into.
    list_bytes: u64,
}

impl CpuRenderer {
    /// A renderer for pictures of `width` x `height` pixels.
    pub fn new(width: u32, height: u32) -> Self {
        Self {
            size: [width, height],
            selector: CutSelector::default().with_subpixel_bits(SUBPIXEL_BITS),
            cuts: PartCuts::default(),
            patch_raster: PatchRaster::default(),
            polygons: Vec::new(),
            chosen: None,
            drawn: None,
            keeps_frames: false,
            last_times: FrameTimes::default(),
            ahead: None,
            visited: 0,
            splats: Vec::new(),
            rest: LargeTriangles::new(),
            triangle_ids: Vec::new(),
            triangles_given: 0,
            triangles: CutTriangles::default(),
            pushed: CutTriangles::default(),
            places: SplatPlaces::default(),
            filtered: Vec::new(),
            front: Vec::new(),
            sums: Vec::new(),
            depths: Vec::new(),
            planes: FloatPlanes::default(),
            rect_px: [0; 4],
            eye_dome: DepthLogarithms::default(),
            ambient_occlusion: AmbientOcclusionLook::default(),
            gradient: None,
            photos: None,
        }
    }

    /// The same, whose pictures hold these besides color.
    #[must_use]
    pub fn with_outputs(mut self, outputs: PictureOutputs) -> Self {
        self.planes = FloatPlanes::of(outputs);
        self
    }

    /// Width and height of its pictures, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Tells whether a frame that is the same as the last is not drawn again, and one whose cut is the same keeps that. Off at
    /// first, so that who measures frames measures whole ones; [`FrameTimes::kept`] says what was kept.
    pub fn keep_frames(&mut self, keep: bool) {
        self.keeps_frames = keep;
    }

    /// The cuts that were chosen last.
    pub fn cuts(&self) -> &PartCuts {
        &self.cuts
    }

    /// Nodes and leaves that all cuts so far looked at.
    pub fn nodes_visited(&self) -> u64 {
        self.visited
    }

    /// Draws a frame that [`FramePlan::for_processor`] planned. The pixels are those that the last frame was drawn into, and `area` is of them.
    ///
    /// # Panics
    /// When the pixels are fewer than the picture has.
    pub(crate) fn draw(
        &mut self,
        drawn: DrawnParts<'_>,
        plan: &FramePlan,
        mut pixels: PixelWords<'_>,
        area: &mut DrawnArea,
    ) -> FrameTimes {
        let start = Instant::now();
        let (settings, context) = (&plan.settings, &plan.context);
        let key = CpuFrameKey {
            drawn: plan.drawn,
            view: plan.view,
            settings: *settings,
        };
        if self.keeps_frames && self.drawn == Some(key) {
            return FrameTimes {
                frame_ms: elapsed_ms(start),
                counts: self.last_times.counts,
                kept: KeptWork::Lists,
                ..FrameTimes::default()
            };
        }
        self.drawn = None;
        let mut times = FrameTimes::default();
        times.starts.frame = Some(start);
        let cutting = FrameStage::Cut.begin();
        let is_kept = settings.has_lists() && !self.choose_cut(drawn, plan);
        let ahead = self.ahead.take().unwrap_or_default();
        if is_kept && !ahead.is_new {
            times.kept = KeptWork::Cut;
        }
        cutting.end(&mut times);
        times.cut_ms += ahead.ms;
        let packing = FrameStage::Pack.begin();
        self.rect_px = context.rect_px;
        let rect_pixels = screen_bounds::pixels(context.rect_px) as usize;
        self.depths.resize(rect_pixels.max(self.depths.len()), 0.0);
        self.planes.begin(plan);
        let light = opaque::FrameHeadlight::new(&plan.constants);
        area.begin(&mut pixels, self.size, context.rect_px, light.background());
        let meshes: Vec<SurfaceMesh<'_>> = (drawn.iter())
            .map(|part| SurfaceMesh::of(part.model))
            .collect();
        let frame = CpuFrame {
            drawn,
            plan,
            meshes: &meshes,
            view: &plan.view,
            settings,
            context,
            constants: &plan.constants,
        };
        let counts = match plan.technique {
            Technique::Filtered => self.draw_filtered(&frame, &mut pixels),
            Technique::Fuzzy => self.draw_blended(&frame, &light, &mut pixels),
            Technique::Visibility => self.draw_visible(&frame, &light, &mut pixels),
            Technique::Polygons => self.draw_polygons(&frame, &light, &mut pixels),
            _ if self.needs_surfaces(settings) => self.draw_surfaces(&frame, &light, &mut pixels),
            _ => self.draw_opaque(&frame, &light, &mut pixels),
        };
        packing.end(&mut times);
        times.host.drawing_ms = times.pack_ms;
        self.look(plan, &mut pixels, area, &mut times);
        let of_cut = match settings.has_cut() {
            true => self.cuts.frame_counts(),
            false => FrameCounts::default(),
        };
        times.counts = FrameCounts {
            splats: counts.splats as u64,
            triangles: counts.triangles as u64,
            draw_list_bytes: counts.list_bytes,
            ..of_cut
        };
        times.frame_ms = elapsed_ms(start);
        self.drawn = Some(key);
        self.last_times = times.clone();
        times
    }

    /// Chooses the cut, unless it is there; tells whether it was chosen.
    pub(super) fn choose_cut(&mut self, drawn: DrawnParts<'_>, plan: &FramePlan) -> bool {
        let chosen = (plan.drawn, plan.cut);
        let may_stay = self.keeps_frames || self.ahead.is_some();
        if may_stay && self.chosen == Some(chosen) {
            return false;
        }
        self.cuts
            .select(&mut self.selector, drawn, |part| plan.cut_of(part));
        self.visited += self.cuts.stats().visited;
        self.chosen = Some(chosen);
        true
    }

    /// Triangles, then squares or discs and triangles of a few pixels.
    fn draw_opaque(
        &mut self,
        frame: &CpuFrame<'_>,
        light: &opaque::FrameHeadlight,
        pixels: &mut PixelWords<'_>,
    ) -> DrawnCounts {
        let (settings, view) = (frame.settings, frame.view);
        let rect_px = frame.context.rect_px;
        let Some(screen) = opaque::SplatScreen::new(frame.constants, rect_px) else {
            unreachable!("sides of pictures are limited");
        };
        let corners = frame.corner_screen();
        let plan = splat_plan(settings, f32::INFINITY);
        let has_one_size = plan.has_one_size(frame.plan.facts.kind);
        let is_cut = settings.has_cut();
        let count = match is_cut {
            true => self.cuts.splat_count(&plan),
            false => 0,
        };
        // What has one size is drawn from the cut itself.
        let own = if has_one_size { 0 } else { count };
        let samples_triangles = has_one_size
            && settings.method == Method::Pop
            && settings.color_by == ColorBy::Shading
            && !settings.holds_cut();
        let (written, samples) = self.pack_opaque(
            frame,
            &plan,
            &corners,
            [own, usize::from(samples_triangles)],
        );
        self.set_triangles(frame, samples_triangles);
        let base = pixels.pitch;
        let colors = pixels.from(rect_px);
        let rect_pixels = screen.pixels();
        let depths = &mut self.depths[..rect_pixels];
        let has_triangles = self.triangles.count() > 0;
        if has_triangles {
            let picture = ShownRectangle {
                colors: &mut *colors,
                pitch: base,
                depths: &mut *depths,
                is_begun: false,
            };
            opaque::draw_triangles(
                &self.triangles,
                frame.meshes,
                &screen,
                light.background(),
                picture,
            );
        }
        let picture = ShownRectangle {
            colors,
            pitch: base,
            depths,
            is_begun: has_triangles,
        };
        let splats = &self.splats[..written + samples];
        let triangles = match settings.method {
            Method::Pop => self.cuts.triangle_count(),
            _ => self.triangles_given,
        };
        let target = (&screen, light);
        let mut undrawn_count = 0;
        if has_one_size && is_cut {
            let cut_meshes: Vec<CutMesh<'_>> = (frame.drawn.iter().zip(self.cuts.iter()))
                .map(|(FactedModel { model, facts, .. }, cut)| CutMesh {
                    model,
                    undrawn: facts.undrawn(model),
                    cut,
                })
                .collect();
            let undrawn = cut_meshes
                .iter()
                .map(|mesh| mesh.undrawn.count_in(mesh.cut));
            undrawn_count = undrawn.sum();
            let own = opaque::CutSplats {
                meshes: &cut_meshes,
                view,
                plan: &plan,
                are_seen: self.chosen.is_some_and(|(_, choice)| choice.hides()),
            };
            opaque::draw_cut(own, splats, target, &mut self.places, picture);
        } else {
            let look = opaque::SplatShape {
                footprint: settings.footprint(),
                has_one_size,
            };
            opaque::draw(splats, (look, 0), target, &mut self.places, picture);
        }
        DrawnCounts {
            splats: if has_one_size {
                count - undrawn_count
            } else {
                written
            },
            triangles,
            list_bytes: (size_of_val(splats) + 12 * triangles + 8 * rect_pixels) as u64,
        }
    }

    /// Writes splats that have sizes of their own, and the samples of small triangles after them: how many of each.
    fn pack_opaque(
        &mut self,
        frame: &CpuFrame<'_>,
        plan: &SplatPlan,
        corners: &small_triangles::CornerScreen,
        [own, samples_triangles]: [usize; 2],
    ) -> (usize, usize) {
        let view = frame.view;
        let samples_triangles = samples_triangles > 0;
        let room = match samples_triangles {
            true => (self.cuts.iter())
                .map(|cut| small_triangles::room(cut.triangles.len(), corners))
                .sum(),
            false => 0,
        };
        let length = (own + room).max(self.splats.len());
        self.splats.resize(length, Splat::zeroed());
        let mut points = 0;
        if own > 0 {
            for (part, cut) in frame.drawn.iter().zip(self.cuts.iter()) {
                let out = &mut self.splats[points..own];
                // None is a quad: nothing limits the size of points.
                points += pack::splats::pack(part.model, cut, view, plan, out).points;
            }
        }
        self.triangle_ids.clear();
        if !samples_triangles {
            return (points, 0);
        }
        let mut found = 0;
        for (part, cut) in frame.drawn.iter().zip(self.cuts.iter()) {
            let out = &mut self.splats[points + found..];
            let rest = &mut self.rest;
            found += small_triangles::pack(part.model, &cut.triangles, corners, rest, out);
            self.triangle_ids
                .push(rest.iter().flatten().copied().collect());
        }
        (points, found)
    }

    /// Filtered splats and triangles: depths, sums, and their quotients.
    fn draw_filtered(&mut self, frame: &CpuFrame<'_>, pixels: &mut PixelWords<'_>) -> DrawnCounts {
        let (settings, view) = (frame.settings, frame.view);
        let depth_range = frame.context.depth_range;
        let shade = filtered_shade(settings, &frame.plan.facts, depth_range, f32::INFINITY);
        let triangles = self.cuts.triangle_count();
        let drawn = frame.drawn.iter().zip(self.cuts.iter_mut());
        let drawn: Vec<_> = drawn
            .map(|(FactedModel { model, .. }, cut)| {
                let large = pack::filtered::take_triangles(model, view, &shade, cut);
                (model, &*cut, large)
            })
            .collect();
        let most = |&(_, cut, large): &(_, _, _)| pack::filtered::splat_count(cut, large);
        let length: usize = drawn.iter().map(most).sum();
        let length = length.max(self.filtered.len());
        self.filtered.resize(length, FilteredSplat::zeroed());
        let mut room = &mut self.filtered[..];
        let mut written = Vec::with_capacity(drawn.len());
        for part in &drawn {
            let (own, rest) = std::mem::take(&mut room).split_at_mut(most(part));
            room = rest;
            let (model, cut, large) = *part;
            let found = pack::filtered::write(model, cut, large, view, shade, own);
            written.push((&*own, found));
        }
        let splats: Vec<GroupedSplats<'_>> = written
            .iter()
            .map(|(splats, found)| GroupedSplats {
                splats,
                groups: &found.groups,
            })
            .collect();
        let splat_count = written
            .iter()
            .map(|(_, found)| found.count())
            .sum::<usize>();
        let drawn: Vec<(&Model, &[u32])> = match settings.method {
            Method::Pop => drawn
                .iter()
                .map(|&(model, cut, _)| (model, &*cut.triangles))
                .collect(),
            _ => Vec::new(),
        };
        let triangle_count = drawn.iter().map(|(_, ids)| ids.len()).sum::<usize>();
        if settings.method == Method::Pop && triangle_count != triangles {
            self.chosen = None;
        }
        let light = FrameLight::of_frame(frame.constants, frame.corner_screen());
        let is_lit = self.triangles.set_all(&drawn, Some(light));
        debug_assert!(is_lit, "there is a light");
        let canvas = PictureArea {
            rect_px: frame.context.rect_px,
            is_gray: settings.shades_gray(frame.drawn.has_colors()),
        };
        let (count, words) = (canvas.pixels(), canvas.pixels() * canvas.words());
        self.front.resize(count.max(self.front.len()), 0);
        self.sums.resize(words.max(self.sums.len()), 0);
        let list = filtered::DrawnSplats {
            splats: &splats,
            meshes: frame.meshes,
            triangles: &self.triangles,
        };
        let (front, sums) = (&mut self.front[..count], &mut self.sums[..words]);
        filtered::draw(list, canvas, front, sums);
        let params = NormalizeParams::new(frame.constants);
        let depths = &mut self.depths[..count];
        let pitch = pixels.pitch;
        let colors = pixels.from(canvas.rect_px);
        if self.planes.outputs().values {
            let width = canvas.width();
            let values = self.planes.planes().values;
            let picture = NormalizedPicture {
                colors: &mut *values,
                pitch: width,
                depths,
            };
            normalize(canvas, &params, front, sums, picture);
            let rows = colors.chunks_mut(pitch).zip(values.chunks(width.max(1)));
            for (word, &value) in rows.flat_map(|(words, values)| words.iter_mut().zip(values)) {
                *word = word_of(value.into());
            }
        } else {
            let picture = NormalizedPicture {
                colors,
                pitch,
                depths,
            };
            normalize(canvas, &params, front, sums, picture);
        }
        if frame.context.reads_depth {
            filtered::leave_surface(list, canvas, front, sums);
            let bits = depths.iter_mut().zip(front.iter());
            bits.for_each(|(depth, &front)| *depth = f32::from_bits(front));
        }
        DrawnCounts {
            splats: splat_count,
            triangles: triangle_count,
            list_bytes: (size_of::<FilteredSplat>() * splat_count + 12 * triangle_count + 8 * words)
                as u64,
        }
    }

    /// Reversed depth of a pixel of the last frame; 0 where nothing is.
    pub fn depth_at(&self, x: u32, y: u32) -> f32 {
        let [left, top, right, bottom] = self.rect_px;
        if !(left..right).contains(&x) || !(top..bottom).contains(&y) {
            return 0.0;
        }
        let at = (y - top) as usize * (right - left) as usize + (x - left) as usize;
        self.depths.get(at).copied().unwrap_or(0.0)
    }

    /// Reversed depths of a part of the last picture, row by row: left, top, width and height, pixels.
    pub fn depths_of(&self, [left, top, width, height]: [u32; 4]) -> Vec<f32> {
        let rows = top..top + height;
        rows.flat_map(|y| (left..left + width).map(move |x| self.depth_at(x, y)))
            .collect()
    }

    /// The picture of the last frame, which is in these pixels; with distances if they are asked for.
    pub fn read(&self, view: &View, pixels: &PixelWords<'_>, has_depth: bool) -> Image {
        let [width, height] = self.size;
        let rows = pixels
            .words
            .chunks(pixels.pitch.max(1))
            .take(height as usize);
        let color: Vec<[u8; 4]> = rows
            .flat_map(|row| row[..width as usize].iter().map(|word| word.to_le_bytes()))
            .collect();
        let depth = match has_depth {
            true => {
                let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
                let of = |((x, y), color): ((u32, u32), &[u8; 4])| match color[3] {
                    0 => f32::INFINITY,
                    _ => view.distance_of_depth(self.depth_at(x, y)),
                };
                all.zip(&color).map(of).collect()
            }
            false => Vec::new(),
        };
        let mut values = self.planes.whole_values(self.size);
        self.lay_over_values(&color, &mut values);
        if let Some(gradient) = &self.gradient {
            gradient.put_behind_values(&mut values, self.size.map(|side| side as usize));
        }
        Image {
            width,
            height,
            color,
            depth,
            normal: self.planes.whole_normals(self.size),
            values,
        }
    }
}

/// One frame, resolved.
struct CpuFrame<'a> {
    drawn: DrawnParts<'a>,
    plan: &'a FramePlan,
    /// Vertices of each part.
    meshes: MeshVertices<'a>,
    view: &'a View,
    settings: &'a Settings,
    context: &'a FrameContext,
    constants: &'a FrameConstants,
}

impl CpuFrame<'_> {
    /// Where corners of triangles are placed.
    fn corner_screen(&self) -> small_triangles::CornerScreen {
        small_triangles::CornerScreen::new(
            self.constants,
            (self.context.width, self.context.height),
            self.context.guard_px,
            self.context.rect_px,
            self.context.dropped_sign(),
        )
    }
}

pub(super) fn elapsed_ms(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e3
}
