//! Draw lists in mapped memory: one set for each frame in flight, grown when a frame needs more, and kept as long as
//! frames ask for the same.

mod filtered;
mod triangles;

use crate::abi::{
    FilteredConstants, FilteredSplat, FuzzySplat, OrientedPolygon, PatchTexture, Splat, SplatId,
    WeightedSplat,
};
use crate::gpu::buffer::{AnyBuffer, UploadBuffer};
use crate::gpu::{Error, Gpu};
use crate::math::camera::View;
use crate::pack::ColorBy;
use crate::pack::filtered::{FirstLarge, device_constants};
use crate::pack::small_triangles;
use crate::pack::small_triangles::CornerScreen;
use crate::pack::splats;
use crate::pack::splats::PackedSplats;
use crate::pack::{fuzzy, ids};
use crate::render::compute_limits::LARGEST_TRIANGLE_PX;
use crate::render::cost::select_passes::PassSelection;
use crate::render::frame_plan::{FramePlan, PackKey, RecordFormat};
use crate::render::model_facts::{DrawnParts, FactedModel};
use crate::render::part_cuts::PartCuts;
use crate::render::stats::FrameCounts;
use crate::render::vulkan::device_tree::fits_bindings;
use crate::render::vulkan::draw_lists::filtered::TakenCuts;
use crate::render::vulkan::expanded_lists::{ExpandedBytes, ExpandedLists};
use crate::render::vulkan::opaque::triangle_runs::PageRange;
use crate::render::vulkan::scene::DeviceScene;
use prefetch_index::prefetch_index;
use std::sync::Arc;

/// Mapped draw lists of one slot.
#[derive(Debug)]
pub(super) struct DrawLists {
    splats: UploadBuffer,
    indices: UploadBuffer,
    pub(super) runs: Vec<PageRange>,
    /// Triangles that are small on screen, where those are drawn by compute.
    small: UploadBuffer,
    pub(super) small_runs: Vec<PageRange>,
    /// Triangles that stay such where others become samples.
    rest: small_triangles::LargeTriangles,
    rest_ids: Vec<u32>,
    /// Oriented polygons, or ids of patches.
    polygons: UploadBuffer,
    /// Places of patches in images, one each where images are shown and the lists hold no ids.
    patch_places: UploadBuffer,
    /// Patches that show images, those of a model together.
    pub(super) patch_runs: Vec<PageRange>,
    /// Buffers of the records that the device makes of numbers.
    whole: Option<ExpandedLists>,
    /// Constants by which the device makes filtered splats of numbers; `None` where the list holds records.
    pub(super) eye: Option<FilteredConstants>,
    /// None before the first frame, and after one that failed.
    pub(super) held: Option<PackedFrame>,
}

/// What the lists of a slot hold.
#[derive(Debug, Clone, Copy)]
pub(super) struct PackedFrame {
    key: PackKey,
    pub(super) packed: PackedSplats,
    /// How many of them are triangles that cover one pixel.
    pub(super) samples: usize,
    /// Where compute draws fuzzy splats, what of them is where; then nothing is in `packed`.
    pub(super) placed: Option<fuzzy::PlacedFuzzy>,
    /// Records of the list of splats, with gaps.
    pub(super) capacity: usize,
    bytes: PackedBytes,
    pub(super) triangles: usize,
    /// Oriented polygons.
    pub(super) polygons: usize,
    pub(super) selection: PassSelection,
    /// What was packed are numbers, of which the device makes what is drawn.
    pub(super) are_ids: bool,
    /// The device has made it.
    pub(super) is_made: bool,
    /// Counts of its cuts.
    of_cut: FrameCounts,
}

/// Bytes of the lists of a slot.
#[derive(Debug, Clone, Copy)]
struct PackedBytes {
    splats: u64,
    /// Of all triangles.
    indices: u64,
    /// Of those in the list of triangles.
    large: u64,
    /// Of those in the list of small ones.
    small: u64,
    polygons: u64,
    /// Places of patches in images.
    places: u64,
}

/// What is packed: a planned frame, whose cut is there.
#[derive(Debug, Clone, Copy)]
pub(super) struct PackInput<'a> {
    pub(super) plan: &'a FramePlan,
    pub(super) parts: DrawnParts<'a>,
    pub(super) scene: &'a DeviceScene,
    /// Of this plan.
    pub(super) key: PackKey,
    /// What splats are written as.
    pub(super) records: RecordFormat,
    pub(super) selection: PassSelection,
}

impl DrawLists {
    /// # Errors
    /// When memory runs out.
    pub(super) fn new(gpu: &Arc<Gpu>, slot: usize) -> Result<Self, Error> {
        let list = |name: &str| {
            UploadBuffer::readable(gpu, &format!("{name} of frame {slot}"), FIRST_BYTES)
        };
        Ok(Self {
            splats: list("splats")?,
            indices: list("triangles")?,
            runs: Vec::new(),
            small: list("small triangles")?,
            small_runs: Vec::new(),
            rest: small_triangles::LargeTriangles::new(),
            rest_ids: Vec::new(),
            polygons: list("polygons")?,
            patch_places: list("places of patches")?,
            patch_runs: Vec::new(),
            whole: None,
            eye: None,
            held: None,
        })
    }

    /// Tells whether they are those of `key`.
    pub(super) fn hold(&self, key: &PackKey) -> bool {
        self.held.as_ref().is_some_and(|held| held.key == *key)
    }

    /// Writes the lists of a cut. Nothing may be reading those that were there. Of a cut that is drawn as filtered splats
    /// triangles may become leaves.
    ///
    /// # Errors
    /// When memory runs out.
    pub(super) fn pack(
        &mut self,
        gpu: &Arc<Gpu>,
        input: &PackInput<'_>,
        cuts: &mut PartCuts,
    ) -> Result<(), Error> {
        (self.held, self.eye) = (None, None);
        let PackInput {
            plan,
            parts,
            scene,
            key,
            selection,
            ..
        } = *input;
        let large = filtered::take_triangles(&input.records, &plan.view, parts, cuts);
        let are_ids = self.are_ids(gpu, input, (cuts, &large))?;
        let polygons = cuts.polygon_count();
        let polygon_bytes = if are_ids {
            records::<u32>(gpu, &mut self.polygons, polygons)?[..polygons]
                .copy_from_slice(cuts.patch_ids());
            4 * polygons as u64
        } else {
            let out = records::<OrientedPolygon>(gpu, &mut self.polygons, polygons)?;
            let is_by_level = plan.settings.color_by == ColorBy::Level;
            cuts.write_polygons(parts, is_by_level, &mut out[..polygons]);
            size_of_val(&out[..polygons]) as u64
        };
        let place_bytes = match plan.primitives.textures_patches && !are_ids {
            true => self.pack_places(gpu, &cuts.patch_textures(parts))?,
            false => 0,
        };
        self.patch_runs.clear();
        if plan.primitives.textures_patches {
            let pages = parts.iter().map(|part| scene.pages_of(part).0);
            put_patch_runs(&mut self.patch_runs, pages, cuts);
        }
        let written = self.pack_splats(gpu, input, (cuts, &large), are_ids)?;
        let primitives = plan.primitives;
        // Of those that are left after samples most are large.
        // Nor does compute sample textures.
        let has_small =
            selection.takes_triangles && written.samples.is_none() && !scene.is_textured();
        let rest = std::mem::take(&mut self.rest_ids);
        let ids: Vec<&[u32]> = match written.samples {
            // Of one model alone.
            Some(_) => vec![&rest],
            None if primitives.has_triangles => {
                cuts.iter().map(|cut| cut.triangles.as_slice()).collect()
            }
            None => Vec::new(),
        };
        let triangle_bytes = if are_ids { 4 } else { 12 };
        let index_bytes = triangle_bytes * ids.iter().map(|ids| ids.len() as u64).sum::<u64>();
        reserve(gpu, &mut self.indices, index_bytes)?;
        if selection.takes_triangles {
            reserve(gpu, &mut self.small, index_bytes)?;
        }
        self.runs.clear();
        self.small_runs.clear();
        let mut so_far = WrittenTriangles::default();
        for (part, ids) in parts.iter().zip(ids) {
            let is_small = has_small.then(|| {
                triangles::are_small_on_screen(part.model, &plan.view, LARGEST_TRIANGLE_PX)
            });
            let lists = (&mut *self, &mut so_far, is_small);
            if are_ids {
                triangles::write(part, scene, ids, lists, (|_, id, _| id, |_, _| {}));
            } else {
                let of = |corners: &[[u32; 3]], id, base| corners[id as usize].map(|c| c + base);
                let ahead = |corners: &[[u32; 3]], id| prefetch_index(corners, id as usize);
                triangles::write(part, scene, ids, lists, (of, ahead));
            }
        }
        self.rest_ids = rest;
        self.held = Some(PackedFrame {
            packed: written.packed,
            samples: written.samples.unwrap_or(0),
            placed: written.placed,
            capacity: written.capacity,
            bytes: PackedBytes {
                splats: (written.capacity * written.record_bytes) as u64,
                indices: index_bytes,
                large: triangle_bytes * so_far.large as u64,
                small: triangle_bytes * so_far.small as u64,
                polygons: polygon_bytes,
                places: place_bytes,
            },
            triangles: match primitives.has_triangles {
                true => cuts.triangle_count(),
                false => 0,
            },
            polygons,
            selection,
            are_ids,
            is_made: false,
            of_cut: cuts.frame_counts(),
            key,
        });
        Ok(())
    }

    /// Writes places of patches in images, and returns their bytes.
    ///
    /// # Errors
    /// When memory runs out, or the device binds no list that is so long.
    fn pack_places(&mut self, gpu: &Arc<Gpu>, places: &[PatchTexture]) -> Result<u64, Error> {
        let bytes = size_of_val(places) as u64;
        fits_bindings(gpu, [bytes])?;
        let out = records::<PatchTexture>(gpu, &mut self.patch_places, places.len())?;
        out[..places.len()].copy_from_slice(places);
        Ok(bytes)
    }

    /// Writes the splats of cuts, those of one part after the other.
    ///
    /// # Errors
    /// When memory runs out.
    fn pack_splats(
        &mut self,
        gpu: &Arc<Gpu>,
        input: &PackInput<'_>,
        (cuts, large): (&PartCuts, &[FirstLarge]),
        are_ids: bool,
    ) -> Result<WrittenSplats, Error> {
        let PackInput {
            plan: frame,
            parts,
            selection,
            ..
        } = *input;
        let view = &frame.view;
        let buffer = &mut self.splats;
        let mut written = WrittenSplats::default();
        match &input.records {
            RecordFormat::Nothing => {}
            RecordFormat::Splats(plan)
            | RecordFormat::Weighted(plan)
            | RecordFormat::Fuzzy(plan, _)
                if are_ids =>
            {
                let out = written.room::<SplatId>(gpu, buffer, cuts.splat_count(plan))?;
                // Of one model alone.
                if let (Some(part), Some(cut)) = (parts.single(), cuts.iter().next()) {
                    let FactedModel { model, facts, .. } = part;
                    written.packed = ids::pack(model, facts.undrawn(model), (cut, view, plan), out);
                }
            }
            RecordFormat::Splats(plan) => {
                let takes_all = selection.takes_triangles && selection.has_splats_by_compute;
                let may_sample = frame.primitives.may_sample && takes_all;
                let may_sample = may_sample && plan.has_one_size(frame.facts.kind);
                // Of one model alone.
                let sampled = (parts.single()).filter(|_| may_sample);
                let sampled = sampled.map(|part| (part.model, corner_screen(frame)));
                let room = sampled.as_ref().map_or(0, |(_, screen)| {
                    small_triangles::room(cuts.triangle_count(), screen)
                });
                let count = cuts.splat_count(plan);
                let out = written.room::<Splat>(gpu, buffer, count + room)?;
                let mut packed = pack_parts(parts, cuts, view, plan, &mut out[..count]);
                if let (Some((model, screen)), Some(cut)) = (&sampled, cuts.iter().next()) {
                    // None is too large for a point: all have one size.
                    let out = &mut out[packed.points..];
                    let rest = &mut self.rest;
                    let found = small_triangles::pack(model, &cut.triangles, screen, rest, out);
                    packed.points += found;
                    self.rest_ids.clear();
                    self.rest_ids.extend(self.rest.iter().flatten());
                    written.samples = Some(found);
                }
                // Quads end where splats without gaps would.
                written.capacity = count.max(packed.points);
                written.packed = packed;
            }
            RecordFormat::Fuzzy(plan, look) if selection.has_blended_by_compute() => {
                let out = written.room::<FuzzySplat>(gpu, buffer, cuts.splat_count(plan))?;
                // Of one model alone.
                let drawn = parts.single().zip(cuts.iter().next());
                written.placed =
                    drawn.map(|(part, cut)| fuzzy::pack(part.model, cut, view, (plan, look), out));
            }
            RecordFormat::Weighted(plan) | RecordFormat::Fuzzy(plan, _) => {
                let out = written.room::<WeightedSplat>(gpu, buffer, cuts.splat_count(plan))?;
                let count = written.capacity;
                written.packed = pack_parts(parts, cuts, view, plan, &mut out[..count]);
            }
            RecordFormat::Filtered(shade) => {
                let taken = TakenCuts {
                    parts,
                    cuts,
                    large,
                    view,
                    shade,
                };
                let most = filtered::most_splats(cuts, large);
                let end = match are_ids {
                    true => taken.write_ids(written.room(gpu, buffer, most)?),
                    false => taken.write(written.room(gpu, buffer, most)?),
                };
                self.eye = are_ids.then(|| device_constants(view, *shade));
                written.capacity = end;
                written.packed.points = end;
            }
        }
        Ok(written)
    }

    /// Tells whether cuts are to be named by numbers, if the plan says so; makes room for what the device makes of them. Longer lists than
    /// can be bound are not.
    ///
    /// # Errors
    /// When memory runs out.
    fn are_ids(
        &mut self,
        gpu: &Arc<Gpu>,
        input: &PackInput<'_>,
        (cuts, large): (&PartCuts, &[FirstLarge]),
    ) -> Result<bool, Error> {
        let (count, record) = match &input.records {
            RecordFormat::Splats(plan) => (cuts.splat_count(plan), size_of::<Splat>()),
            RecordFormat::Weighted(plan) => (cuts.splat_count(plan), size_of::<WeightedSplat>()),
            RecordFormat::Fuzzy(plan, _) if !input.selection.has_blended_by_compute() => {
                (cuts.splat_count(plan), size_of::<WeightedSplat>())
            }
            RecordFormat::Filtered(_) => {
                let count = filtered::most_splats(cuts, large);
                (count, size_of::<FilteredSplat>())
            }
            _ => return Ok(false),
        };
        if !input.plan.uploads_ids {
            return Ok(false);
        }
        let polygons = cuts.polygon_count();
        let bytes = ExpandedBytes {
            splats: (count * record) as u64,
            triangles: 12 * cuts.triangle_count() as u64,
            polygons: (polygons * size_of::<OrientedPolygon>()) as u64,
            places: match input.plan.primitives.textures_patches {
                true => (polygons * size_of::<PatchTexture>()) as u64,
                false => 0,
            },
        };
        let fits = bytes.fit(gpu);
        if fits {
            ExpandedLists::reserve(gpu, &mut self.whole, bytes)?;
        }
        Ok(fits)
    }

    /// What the device makes of the numbers that the lists hold; none where they hold no numbers.
    fn whole(&self) -> Option<&ExpandedLists> {
        let held = self.held.as_ref()?;
        self.whole.as_ref().filter(|_| held.are_ids)
    }

    /// The numbers that the lists hold, if the device is to make something of them: of splats, triangles, small triangles and
    /// patches.
    pub(super) fn named(&self) -> Option<([&UploadBuffer; 4], &ExpandedLists, &PackedFrame)> {
        let held = self.held.as_ref().filter(|held| !held.is_made)?;
        let ids = [&self.splats, &self.indices, &self.small, &self.polygons];
        Some((ids, self.whole()?, held))
    }

    /// A frame that makes it was submitted.
    pub(super) fn are_made(&mut self) {
        if let Some(held) = &mut self.held {
            held.is_made = true;
        }
    }

    /// Records of splats as they are drawn.
    pub(super) fn splats(&self) -> &dyn AnyBuffer {
        self.whole().map_or(&self.splats, |whole| &whole.splats)
    }

    /// Corners of the triangles of `runs`.
    pub(super) fn indices(&self) -> &dyn AnyBuffer {
        self.whole().map_or(&self.indices, |whole| &whole.indices)
    }

    /// Oriented polygons as they are drawn.
    pub(super) fn polygons(&self) -> &dyn AnyBuffer {
        self.whole().map_or(&self.polygons, |whole| &whole.polygons)
    }

    /// Places of patches in images, one each, those of the patches of `patch_runs`.
    pub(super) fn patch_places(&self) -> &dyn AnyBuffer {
        self.whole()
            .map_or(&self.patch_places, |whole| &whole.places)
    }

    /// Corners of the triangles of `small_runs`.
    pub(super) fn small(&self) -> &dyn AnyBuffer {
        self.whole().map_or(&self.small, |whole| &whole.small)
    }

    /// Counts what they hold; nothing before they were packed.
    pub(super) fn counts(&self) -> FrameCounts {
        let Some(held) = &self.held else {
            return FrameCounts::default();
        };
        let (packed, bytes) = (held.packed, &held.bytes);
        let splats = held
            .placed
            .map_or(packed.points + packed.quads - held.samples, |p| p.all());
        FrameCounts {
            splats: (splats + held.polygons) as u64,
            triangles: held.triangles as u64,
            draw_list_bytes: (bytes.splats + bytes.indices) + (bytes.polygons + bytes.places),
            ..held.of_cut
        }
    }

    /// Makes what was packed visible to the device.
    pub(super) fn flush(&mut self) {
        let Some(held) = self.held else { return };
        self.splats.flush(0..held.bytes.splats);
        self.indices.flush(0..held.bytes.large);
        self.polygons.flush(0..held.bytes.polygons);
        self.patch_places.flush(0..held.bytes.places);
        self.small.flush(0..held.bytes.small);
    }
}

/// Splats as they were written.
#[derive(Debug, Default)]
struct WrittenSplats {
    packed: PackedSplats,
    /// Where triangles that cover one pixel became splats, how many did.
    samples: Option<usize>,
    placed: Option<fuzzy::PlacedFuzzy>,
    /// Records, with gaps.
    capacity: usize,
    record_bytes: usize,
}

impl WrittenSplats {
    /// Makes room for so many records of a kind.
    ///
    /// # Errors
    /// When memory runs out.
    fn room<'a, T: bytemuck::Pod>(
        &mut self,
        gpu: &Arc<Gpu>,
        buffer: &'a mut UploadBuffer,
        count: usize,
    ) -> Result<&'a mut [T], Error> {
        (self.capacity, self.record_bytes) = (count, size_of::<T>());
        records::<T>(gpu, buffer, count)
    }
}

/// Triangles of draw lists that were written so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct WrittenTriangles {
    pub(super) large: usize,
    pub(super) small: usize,
}

/// Writes the splats of all parts: points from the start of `out`, quads up to its end. `out` has the room that all need.
fn pack_parts<R: splats::SplatRecord + Copy + Send>(
    parts: DrawnParts<'_>,
    cuts: &PartCuts,
    view: &View,
    plan: &splats::SplatPlan,
    out: &mut [R],
) -> PackedSplats {
    let mut packed = PackedSplats::default();
    for (part, cut) in parts.iter().zip(cuts.iter()) {
        // The quads of a part end where those of the parts before it begin.
        let end = out.len() - packed.quads;
        let room = &mut out[packed.points..end];
        let count = splats::count(cut, plan);
        let found = splats::pack(part.model, cut, view, plan, &mut room[..count]);
        if found.quads > 0 && count < room.len() {
            room.copy_within(count - found.quads..count, room.len() - found.quads);
        }
        packed.points += found.points;
        packed.quads += found.quads;
    }
    packed
}

/// Puts the patches of each part into a list of runs, with the first page of each; parts without patches have none.
fn put_patch_runs(runs: &mut Vec<PageRange>, pages: impl Iterator<Item = usize>, cuts: &PartCuts) {
    let mut first = 0;
    for (page, count) in pages.zip(cuts.patch_counts_of_parts()) {
        let count = count as u32;
        if count > 0 {
            runs.push(PageRange { page, first, count });
        }
        first += count;
    }
}

/// Where the device places corners of triangles.
fn corner_screen(plan: &FramePlan) -> CornerScreen {
    let context = &plan.context;
    CornerScreen::new(
        &plan.constants,
        (context.width, context.height),
        context.guard_px,
        context.rect_px,
        context.dropped_sign(),
    )
}

/// First size of a draw list, bytes; it grows by half when a frame needs more.
const FIRST_BYTES: u64 = 1 << 20;

/// The records that fit a mapped buffer.
fn whole_records<T: bytemuck::Pod>(bytes: &mut [u8]) -> &mut [T] {
    let whole = bytes.len() / size_of::<T>() * size_of::<T>();
    bytemuck::cast_slice_mut(&mut bytes[..whole])
}

/// A mapped buffer as `count` records at least, grown if need be.
pub(super) fn records<'a, T: bytemuck::Pod>(
    gpu: &Arc<Gpu>,
    buffer: &'a mut UploadBuffer,
    count: usize,
) -> Result<&'a mut [T], Error> {
    reserve(gpu, buffer, (count * size_of::<T>()) as u64)?;
    Ok(whole_records(buffer.bytes_mut()))
}

/// Grows a mapped buffer; its slot is free, so nothing reads it.
fn reserve(gpu: &Arc<Gpu>, buffer: &mut UploadBuffer, bytes: u64) -> Result<(), Error> {
    if bytes > buffer.bytes() {
        let name = buffer.name().to_owned();
        *buffer = UploadBuffer::readable(gpu, &name, bytes.max(buffer.bytes() * 3 / 2))?;
    }
    Ok(())
}
