//! Draw lists in mapped memory: one set for each frame in flight, grown when a frame needs more, and kept as long as
//! frames ask for the same.

mod triangles;

use crate::abi::{FilteredSplat, FuzzySplat, Splat, SplatId, WeightedSplat};
use crate::cut::{Cut, Stats};
use crate::gpu::buffer::{AnyBuffer, Upload};
use crate::gpu::{Error, Gpu};
use crate::math::camera::View;
use crate::pack::ColorBy;
use crate::pack::splats;
use crate::pack::splats::Packed;
use crate::pack::{filtered, fuzzy, ids};
use crate::render::cost::choose::ComputeShare;
use crate::render::cpu::small_triangles;
use crate::render::cpu::small_triangles::Screen;
use crate::render::cut_key::CutKey;
use crate::render::pack_params::{filtered_shade, fuzzy_look, splat_plan};
use crate::render::technique::Technique;
use crate::render::vulkan::expand_ids;
use crate::render::vulkan::expand_ids::Whole;
use crate::render::vulkan::opaque::triangle_runs::Run;
use crate::render::vulkan::scene::Scene;
use crate::render::{Method, Path, Settings};
use crate::tree::Model;
use prefetch_index::prefetch_index;
use std::sync::Arc;

/// Mapped draw lists of one slot.
#[derive(Debug)]
pub(super) struct Lists {
    splats: Upload,
    indices: Upload,
    pub(super) runs: Vec<Run>,
    /// Triangles that are small on screen, where those are drawn by compute.
    small: Upload,
    pub(super) small_runs: Vec<Run>,
    /// Triangles that stay such where others become samples.
    rest: small_triangles::Rest,
    rest_ids: Vec<u32>,
    /// What the device makes of numbers.
    whole: Option<Whole>,
    /// None before the first frame, and after one that failed.
    pub(super) held: Option<Held>,
}

/// What the lists of a slot hold.
#[derive(Debug, Clone, Copy)]
pub(super) struct Held {
    key: Key,
    pub(super) packed: Packed,
    /// How many of them are triangles that cover one pixel.
    pub(super) samples: usize,
    /// Where compute draws fuzzy splats, what of them is where; then nothing is in `packed`.
    pub(super) placed: Option<fuzzy::Placed>,
    /// Records of the list of splats, with gaps.
    pub(super) capacity: usize,
    pub(super) splat_bytes: u64,
    /// Of all triangles.
    pub(super) index_bytes: u64,
    pub(super) triangles: usize,
    pub(super) ways: Ways,
    /// What was packed are numbers, of which the device makes what is drawn.
    pub(super) are_ids: bool,
    /// It has.
    pub(super) is_made: bool,
    /// Of the cut.
    pub(super) stats: Stats,
}

/// What draws the primitives of a frame.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ways {
    /// Triangles that are small on screen have a list of their own, for compute.
    pub(super) takes_triangles: bool,
    /// Compute draws opaque splats.
    pub(super) is_small: bool,
    /// What it draws of blended ones, where that is known before they are packed.
    pub(super) share: Option<ComputeShare>,
}

impl Ways {
    /// Whether the rasterizer may draw all splats.
    pub(super) fn is_rastered(&self) -> bool {
        !self.is_small
            && self
                .share
                .is_none_or(|share| share == ComputeShare::Nothing)
    }
}

/// What decides the lists of a frame: equal ones give the same bytes, as long as the renderer's costs are the same. Made of
/// what cut and packing are told, and they are told nothing else but what follows from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Key {
    /// [`Scene::id`], and so the model.
    scene: u64,
    pub(super) choice: CutKey,
    view: View,
    packing: Packing,
    path: Path,
    /// Compute may draw.
    is_wanted: bool,
    /// Triangles of the cut are drawn as such.
    has_triangles: bool,
    /// Those that cover one pixel may become splats.
    may_sample: bool,
    /// Splats and triangles are named by their numbers, if the lists can be bound.
    by_id: bool,
}

/// How the splats of a cut are written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Packing {
    /// Not at all.
    Nothing,
    /// As [`Splat`].
    Splats(splats::Plan),
    /// As [`WeightedSplat`].
    Weighted(splats::Plan),
    /// As [`FuzzySplat`] where compute draws them, else as [`WeightedSplat`].
    Fuzzy(splats::Plan, fuzzy::Look),
    /// As [`FilteredSplat`].
    Filtered(filtered::Shade),
}

impl Packing {
    /// With points of at most `max_point_px` pixels; `is_wanted`: compute may draw.
    pub(super) fn of(
        settings: &Settings,
        model: &Model,
        (max_point_px, is_wanted): (f32, bool),
    ) -> Self {
        match Technique::of(settings) {
            Technique::Opaque | Technique::Visibility => {
                Self::Splats(splat_plan(settings, max_point_px))
            }
            Technique::Fuzzy if is_wanted => Self::Fuzzy(
                splat_plan(settings, max_point_px),
                fuzzy_look(settings, model),
            ),
            Technique::Fuzzy => Self::Weighted(splat_plan(settings, max_point_px)),
            Technique::Filtered => Self::Filtered(filtered_shade(settings, model, max_point_px)),
            Technique::Nothing => Self::Nothing,
        }
    }
}

impl Key {
    /// That of a frame whose points have at most `max_point_px` pixels, drawn by compute if it `is_wanted`, on a device that
    /// `samples` triangles of one pixel, where lists may be `by_id`; of settings that [`resolve_settings`](crate::render::frame_plan::resolve_settings) gave.
    pub(super) fn of(
        settings: &Settings,
        model: &Model,
        scene: &Scene,
        view: &View,
        (max_point_px, is_wanted, samples): (f32, bool, bool),
        by_id: bool,
    ) -> Self {
        Self {
            scene: scene.id(),
            choice: CutKey::of(settings, model, view),
            view: *view,
            packing: Packing::of(settings, model, (max_point_px, is_wanted)),
            path: settings.path,
            is_wanted,
            has_triangles: settings.method != Method::Splats,
            may_sample: samples
                && Technique::of(settings) == Technique::Opaque
                && settings.method == Method::Pop
                && settings.color_by == ColorBy::Shading
                && !settings.holds_cut()
                && !by_id,
            by_id,
        }
    }

    /// What its cut is of, to be compared with others.
    pub(super) fn cut(&self) -> (u64, CutKey) {
        (self.scene, self.choice)
    }
}

impl Lists {
    /// # Errors
    /// When memory runs out.
    pub(super) fn new(gpu: &Arc<Gpu>, slot: usize) -> Result<Self, Error> {
        let list = |name: &str| Upload::new(gpu, &format!("{name} of frame {slot}"), FIRST_BYTES);
        Ok(Self {
            splats: list("splats")?,
            indices: list("triangles")?,
            runs: Vec::new(),
            small: list("small triangles")?,
            small_runs: Vec::new(),
            rest: small_triangles::Rest::new(),
            rest_ids: Vec::new(),
            whole: None,
            held: None,
        })
    }

    /// Whether they are those of `key`.
    pub(super) fn hold(&self, key: &Key) -> bool {
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
        (model, scene): (&Model, &Scene),
        cut: &mut Cut,
        (key, packing): (Key, Packing),
        (ways, screen): (Ways, &Screen),
    ) -> Result<(), Error> {
        self.held = None;
        let view = &key.view;
        let mut samples = None;
        let by_compute = ways
            .share
            .is_some_and(|share| share != ComputeShare::Nothing);
        let mut placed = None;
        // Small triangles are the device's, and the keys with them, unless they become samples.
        let may_sample = key.may_sample && ways.takes_triangles && ways.is_small;
        let are_ids = self.are_ids(gpu, key.by_id, &packing, cut)?;
        let (packed, capacity, record_bytes) = match &packing {
            Packing::Splats(plan) | Packing::Weighted(plan) if are_ids => {
                let count = splats::count(cut, plan);
                let out = records::<SplatId>(gpu, &mut self.splats, count)?;
                let packed = ids::pack(model, scene.undrawn(model), (cut, view, plan), out);
                (packed, count, size_of::<SplatId>())
            }
            Packing::Splats(plan) => {
                let may_sample = may_sample && plan.has_one_size(model);
                let room = match may_sample {
                    true => small_triangles::room(cut.triangles.len(), screen),
                    false => 0,
                };
                let count = splats::count(cut, plan);
                let out = records::<Splat>(gpu, &mut self.splats, count + room)?;
                let mut packed = splats::pack(model, cut, view, plan, &mut out[..count]);
                if may_sample {
                    // None is too large for a point: all have one size.
                    let out = &mut out[packed.points..];
                    let found =
                        small_triangles::pack(model, &cut.triangles, screen, &mut self.rest, out);
                    packed.points += found;
                    self.rest_ids.clear();
                    self.rest_ids.extend(self.rest.iter().flatten());
                    samples = Some(found);
                }
                // Quads end where splats without gaps would.
                let capacity = count.max(packed.points);
                (packed, capacity, size_of::<Splat>())
            }
            Packing::Fuzzy(plan, look) if by_compute => {
                let count = splats::count(cut, plan);
                let out = records::<FuzzySplat>(gpu, &mut self.splats, count)?;
                placed = Some(fuzzy::pack(model, cut, view, (plan, look), out));
                (Packed::default(), count, size_of::<FuzzySplat>())
            }
            Packing::Weighted(plan) | Packing::Fuzzy(plan, _) => {
                let count = splats::count(cut, plan);
                let out = records::<WeightedSplat>(gpu, &mut self.splats, count)?;
                let packed = splats::pack(model, cut, view, plan, out);
                (packed, count, size_of::<WeightedSplat>())
            }
            Packing::Filtered(shade) => {
                let large = filtered::take_triangles(model, view, shade, cut);
                let most = filtered::splat_count(cut, large);
                let out = records(gpu, &mut self.splats, most)?;
                let splats = filtered::write(model, cut, large, view, *shade, out);
                let count = splats.count();
                splats.close_gaps(whole_records(self.splats.bytes_mut()));
                let packed = Packed {
                    points: count,
                    quads: 0,
                };
                (packed, count, size_of::<FilteredSplat>())
            }
            Packing::Nothing => (Packed::default(), 0, 0),
        };
        // Of those that are left after samples most are large.
        let has_small = ways.takes_triangles && samples.is_none();
        let is_small = has_small.then(|| {
            triangles::are_small_on_screen(
                model,
                view,
                crate::render::compute_limits::LARGEST_TRIANGLE_PX,
            )
        });
        let rest = std::mem::take(&mut self.rest_ids);
        let triangles: &[u32] = match samples {
            Some(_) => &rest,
            None if key.has_triangles => &cut.triangles,
            None => &[],
        };
        let triangle_bytes = if are_ids { 4 } else { 12 };
        let index_bytes = triangle_bytes * triangles.len() as u64;
        reserve(gpu, &mut self.indices, index_bytes)?;
        if ways.takes_triangles {
            reserve(gpu, &mut self.small, index_bytes)?;
        }
        let lists = (&mut *self, is_small);
        if are_ids {
            triangles::write(model, scene, triangles, lists, (|_, id| id, |_, _| {}));
        } else {
            let of = |corners: &[[u32; 3]], id| corners[id as usize];
            let ahead = |corners: &[[u32; 3]], id| prefetch_index(corners, id as usize);
            triangles::write(model, scene, triangles, lists, (of, ahead));
        }
        self.rest_ids = rest;
        self.held = Some(Held {
            packed,
            samples: samples.unwrap_or(0),
            placed,
            capacity,
            splat_bytes: (capacity * record_bytes) as u64,
            index_bytes,
            triangles: if key.has_triangles {
                cut.triangles.len()
            } else {
                0
            },
            ways,
            are_ids,
            is_made: false,
            stats: cut.stats,
            key,
        });
        Ok(())
    }

    /// Whether a cut is to be named by numbers, if it `may` be; makes room for what the device makes of them. Longer lists than
    /// can be bound are not.
    ///
    /// # Errors
    /// When memory runs out.
    fn are_ids(
        &mut self,
        gpu: &Arc<Gpu>,
        may: bool,
        packing: &Packing,
        cut: &Cut,
    ) -> Result<bool, Error> {
        let (plan, record) = match packing {
            Packing::Splats(plan) => (plan, size_of::<Splat>()),
            Packing::Weighted(plan) => (plan, size_of::<WeightedSplat>()),
            _ => return Ok(false),
        };
        if !may {
            return Ok(false);
        }
        let bytes = [
            (splats::count(cut, plan) * record) as u64,
            12 * cut.triangles.len() as u64,
        ];
        let fits = expand_ids::fits(gpu, bytes);
        if fits {
            Whole::reserve(gpu, &mut self.whole, bytes)?;
        }
        Ok(fits)
    }

    /// What the device makes of the numbers that the lists hold; none where they hold no numbers.
    fn whole(&self) -> Option<&Whole> {
        let held = self.held.as_ref()?;
        self.whole.as_ref().filter(|_| held.are_ids)
    }

    /// The numbers that the lists hold, if the device is to make something of them: of splats, triangles and small triangles.
    pub(super) fn named(&self) -> Option<([&Upload; 3], &Whole, &Held)> {
        let held = self.held.as_ref().filter(|held| !held.is_made)?;
        let ids = [&self.splats, &self.indices, &self.small];
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

    /// Corners of the triangles of `small_runs`.
    pub(super) fn small(&self) -> &dyn AnyBuffer {
        self.whole().map_or(&self.small, |whole| &whole.small)
    }

    /// Makes what was packed visible to the device.
    pub(super) fn flush(&mut self) {
        let Some(held) = self.held else { return };
        self.splats.flush(0..held.splat_bytes);
        self.indices.flush(0..held.index_bytes);
        if held.ways.takes_triangles {
            self.small.flush(0..held.index_bytes);
        }
    }
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
    buffer: &'a mut Upload,
    count: usize,
) -> Result<&'a mut [T], Error> {
    reserve(gpu, buffer, (count * size_of::<T>()) as u64)?;
    Ok(whole_records(buffer.bytes_mut()))
}

/// Grows a mapped buffer; its slot is free, so nothing reads it.
fn reserve(gpu: &Arc<Gpu>, buffer: &mut Upload, bytes: u64) -> Result<(), Error> {
    if bytes > buffer.bytes() {
        let name = buffer.name().to_owned();
        *buffer = Upload::new(gpu, &name, bytes.max(buffer.bytes() * 3 / 2))?;
    }
    Ok(())
}
