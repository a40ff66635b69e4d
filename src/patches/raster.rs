//! Patches drawn fast by the processor, into colors and depths that may hold other things already.
//!
//! As [`crate::patches::draw`] in single precision. A patch is the pixels whose signed distance from every side of its footprint
//! on the picture is at least minus the margin, and that lie between its ends along its longer axis. The picture is divided
//! into bands of rows, which threads draw one by one: patches are set up [`LANES`] at a time, read where
//! they are kept and once for each band that they touch, and drawn in blocks of sixteen pixels at once.

mod blocks;
mod rims;
mod set_up;
mod view;

pub use rims::RimPicture;

use crate::abi::OrientedPolygon;
use crate::math::camera::View;
use crate::threads::{self, share};
use blocks::{BatchLane, BlockInk, RasterBand, SIDE};
use fearless_simd::{Level, dispatch};
use glam::Vec2;
use prefetch_index::prefetch_index;
use rims::RimBands;
use set_up::{LANES, PatchBatch, RecordRows};
use view::RasterView;

/// Rows of a band.
const BAND_ROWS: usize = 32;

/// Patches whose bands are found at a time.
const PART: usize = 2048;

/// A patch that is no number where nothing is drawn.
const NOTHING: u32 = u32::MAX;

/// The headlight, for patches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchLight {
    /// Along the view direction instead of from the eye.
    pub is_parallel: bool,
    /// Both sides of a surface are lit.
    pub is_two_sided: bool,
    /// Patches have colors of their own.
    pub has_colors: bool,
    /// Multiplies colors: red, green and blue.
    pub albedo: [f32; 3],
}

/// Patches of one model.
#[derive(Debug, Clone, Copy)]
pub struct PatchList<'a> {
    /// Patches of all nodes of the tree.
    pub polygons: &'a [OrientedPolygon],
    /// Numbers of those that are drawn.
    pub ids: &'a [u32],
}

/// A rectangle of the picture, to be drawn in.
#[derive(Debug)]
pub struct PatchTarget<'a> {
    /// Colors from the first pixel of the rectangle on; red in the lowest byte, coverage in the highest.
    pub colors: &'a mut [u32],
    /// Pixels from a row of colors to the next.
    pub pitch: usize,
    /// Reversed depths, 0 where nothing is; row by row without gaps.
    pub depths: &'a mut [f32],
    /// Left, top, and one past right and bottom, pixels.
    pub rect_px: [u32; 4],
    /// Keep numbers of patches beside colors, for [`PatchRaster::cover_rims`].
    pub keeps_numbers: bool,
}

/// Draws patches, and keeps its memory from one picture to the next: 4 bytes for each band that a patch lies in, and 4 a pixel
/// where numbers are asked for.
#[derive(Debug)]
pub struct PatchRaster {
    threads: usize,
    parts: Vec<BinnedPart>,
    numbers: Vec<u32>,
    rims: RimBands,
    rect_px: [u32; 4],
    /// The view of the last picture.
    view: Option<RasterView>,
}

/// What of the nearest patch a pixel shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchPixel {
    /// Number of the patch in the lists, one after the other.
    pub number: u32,
    /// Coordinates of the foot in the plane.
    pub uv: [f32; 2],
}

/// Some patches of a list, by the bands that they touch.
#[derive(Debug, Default)]
struct BinnedPart {
    /// Which list.
    list: usize,
    /// Number of the first patch in the list, and in all lists.
    first: usize,
    number: u32,
    /// Places in the lists of the patches that each band of rows draws.
    bands: Vec<Vec<u32>>,
}

impl Default for PatchRaster {
    /// Uses as many threads as the machine runs at once, at most 16.
    fn default() -> Self {
        Self::with_threads(threads::count())
    }
}

/// First rows of bands, and one past the last; none is lower than a block where there are that many rows.
fn band_edges(rows: usize) -> Vec<usize> {
    let count = (rows / BAND_ROWS + usize::from(rows % BAND_ROWS >= SIDE)).max(1);
    let mut edges: Vec<usize> = (0..count).map(|band| band * BAND_ROWS).collect();
    edges.push(rows);
    edges
}

impl PatchRaster {
    /// Uses up to `threads` threads, the calling one included; 0 counts as 1.
    pub fn with_threads(threads: usize) -> Self {
        Self {
            threads: threads.max(1),
            parts: Vec::new(),
            numbers: Vec::new(),
            rims: RimBands::default(),
            rect_px: [0; 4],
            view: None,
        }
    }

    /// Draws patches where they are nearer than what is there, in the headlight.
    ///
    /// # Panics
    /// When the target is smaller than its rectangle.
    pub fn draw(
        &mut self,
        lists: &[PatchList<'_>],
        view: &View,
        light: &PatchLight,
        target: PatchTarget<'_>,
    ) {
        let mut numbers = match target.keeps_numbers {
            true => self.empty_numbers(target.depths.len()),
            false => Vec::new(),
        };
        let (raster, ink) = (RasterView::new(view), BlockInk::Lit(*light));
        let (rect_px, keeps_numbers) = (target.rect_px, target.keeps_numbers);
        self.draw_by(Level::new(), (lists, &raster), ink, target, &mut numbers);
        if keeps_numbers {
            (self.numbers, self.rect_px) = (numbers, rect_px);
            self.view = Some(raster);
        }
    }

    /// Numbers of nothing.
    fn empty_numbers(&mut self, count: usize) -> Vec<u32> {
        let mut numbers = std::mem::take(&mut self.numbers);
        numbers.clear();
        numbers.resize(count, NOTHING);
        numbers
    }

    /// Draws numbers of patches instead of colors, for [`PatchRaster::pixel`]. Colors are not read and stay.
    ///
    /// # Panics
    /// As [`PatchRaster::draw`].
    pub fn draw_numbers(
        &mut self,
        lists: &[PatchList<'_>],
        view: &View,
        depths: &mut [f32],
        rect_px: [u32; 4],
    ) {
        let raster = RasterView::new(view);
        let mut numbers = self.empty_numbers(depths.len());
        let target = PatchTarget {
            colors: &mut numbers,
            pitch: rect_px[2].saturating_sub(rect_px[0]) as usize,
            depths,
            rect_px,
            keeps_numbers: false,
        };
        let ink = BlockInk::Numbers;
        self.draw_by(Level::new(), (lists, &raster), ink, target, &mut []);
        self.numbers = numbers;
        self.view = Some(raster);
        self.rect_px = rect_px;
    }

    /// The nearest patch in a pixel of the rectangle that numbers were drawn in, whose depth became this; `None` where there is
    /// none. `polygons` are those that were drawn, in their order.
    pub fn pixel(
        &self,
        polygons: &[OrientedPolygon],
        [x, y]: [u32; 2],
        depth: f32,
    ) -> Option<PatchPixel> {
        let [left, top, right, _] = self.rect_px;
        let at = (y - top) as usize * (right - left) as usize + (x - left) as usize;
        let &number = self.numbers.get(at).filter(|number| **number != NOTHING)?;
        let (patch, view) = (polygons.get(number as usize)?, self.view.as_ref()?);
        let place = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let foot = view.foot_of(patch, place, view.distance(depth));
        Some(PatchPixel {
            number,
            uv: foot.to_array(),
        })
    }

    fn draw_by(
        &mut self,
        level: Level,
        (lists, view): (&[PatchList<'_>], &RasterView),
        ink: BlockInk,
        target: PatchTarget<'_>,
        mut numbers: &mut [u32],
    ) {
        let [left, top, right, bottom] = target.rect_px.map(|edge| edge as usize);
        if right <= left || bottom <= top {
            return;
        }
        let (width, rows) = (right - left, bottom - top);
        if width < SIDE || rows < SIDE {
            return self.draw_padded(level, (lists, view), ink, target, numbers);
        }
        let edges = band_edges(rows);
        self.find_bands(lists, view, top, &edges);
        let mut bands = Vec::with_capacity(edges.len());
        let (mut words, mut depths) = (target.colors, &mut target.depths[..width * rows]);
        for edge in edges.windows(2) {
            let height = edge[1] - edge[0];
            let own_words = words.split_at_mut((height * target.pitch).min(words.len()));
            let own_depths = depths.split_at_mut(height * width);
            (words, depths) = (own_words.1, own_depths.1);
            let kept = (height * width).min(numbers.len());
            let own_numbers = numbers.split_at_mut(kept);
            numbers = own_numbers.1;
            bands.push(RasterBand {
                words: own_words.0,
                pitch: target.pitch,
                depths: own_depths.0,
                numbers: own_numbers.0,
                rect_px: [left, top + edge[0], right, top + edge[1]],
            });
        }
        let parts = &self.parts;
        let work = bands.into_iter().enumerate();
        share(
            &mut vec![(); self.threads],
            work,
            |(), (band, mut target)| {
                dispatch!(level, simd => {
                    draw_band(simd, &mut target, (lists, parts, band), view, &ink);
                });
            },
        );
    }

    /// Draws into a rectangle that is narrower or lower than a block, by one that is not.
    fn draw_padded(
        &mut self,
        level: Level,
        (lists, view): (&[PatchList<'_>], &RasterView),
        ink: BlockInk,
        target: PatchTarget<'_>,
        numbers: &mut [u32],
    ) {
        let [left, top, right, bottom] = target.rect_px;
        let sides = [right - left, bottom - top];
        let [width, rows] = sides.map(|side| side.max(SIDE as u32));
        let mut colors = vec![0; (width * rows) as usize];
        let mut depths = vec![f32::INFINITY; (width * rows) as usize];
        let mut wide_numbers = match numbers.is_empty() {
            true => Vec::new(),
            false => vec![NOTHING; (width * rows) as usize],
        };
        let [own, wide, pitch] = [sides[0] as usize, width as usize, target.pitch];
        for row in 0..sides[1] as usize {
            colors[row * wide..][..own].copy_from_slice(&target.colors[row * pitch..][..own]);
            depths[row * wide..][..own].copy_from_slice(&target.depths[row * own..][..own]);
        }
        let padded = PatchTarget {
            colors: &mut colors,
            pitch: wide,
            depths: &mut depths,
            rect_px: [left, top, left + width, top + rows],
            keeps_numbers: false,
        };
        self.draw_by(level, (lists, view), ink, padded, &mut wide_numbers);
        for row in 0..sides[1] as usize {
            target.colors[row * pitch..][..own].copy_from_slice(&colors[row * wide..][..own]);
            target.depths[row * own..][..own].copy_from_slice(&depths[row * wide..][..own]);
            if !numbers.is_empty() {
                numbers[row * own..][..own].copy_from_slice(&wide_numbers[row * wide..][..own]);
            }
        }
    }

    /// Finds the bands that patches touch.
    fn find_bands(
        &mut self,
        lists: &[PatchList<'_>],
        view: &RasterView,
        top: usize,
        edges: &[usize],
    ) {
        let count: usize = lists.iter().map(|list| list.ids.len().div_ceil(PART)).sum();
        self.parts.resize_with(count, BinnedPart::default);
        let mut places = self.parts.iter_mut();
        let mut number = 0;
        for (list, patches) in lists.iter().enumerate() {
            for first in (0..patches.ids.len()).step_by(PART) {
                let Some(part) = places.next() else { break };
                (part.list, part.first) = (list, first);
                part.number = number + first as u32;
            }
            number += patches.ids.len() as u32;
        }
        let bands = edges.len() - 1;
        share(
            &mut vec![(); self.threads],
            self.parts.iter_mut(),
            |(), part| {
                part.bands.resize_with(bands, Vec::new);
                part.bands.iter_mut().for_each(Vec::clear);
                let PatchList { polygons, ids } = lists[part.list];
                let end = (part.first + PART).min(ids.len());
                for (place, &id) in ids[part.first..end].iter().enumerate() {
                    if let Some(&ahead) = ids.get(part.first + place + LANES) {
                        prefetch_index(polygons, ahead as usize);
                    }
                    let rows = view.rows_of(&polygons[id as usize]);
                    let [first, end] =
                        rows.map(|row| (row - top as f32) * (1.0 / BAND_ROWS as f32));
                    // Casts saturate, and take what is no number to 0.
                    let (first, end) = (first.max(0.0) as usize, (end + 1.0).min(bands as f32));
                    for band in first..end as usize {
                        part.bands[band].push(place as u32);
                    }
                }
            },
        );
    }
}

/// Draws the patches of a band.
#[inline(always)]
fn draw_band<S: fearless_simd::Simd>(
    simd: S,
    target: &mut RasterBand<'_>,
    (lists, parts, band): (&[PatchList<'_>], &[BinnedPart], usize),
    view: &RasterView,
    ink: &BlockInk,
) {
    let mut records = RecordRows::ZERO;
    let mut batch = PatchBatch::ZERO;
    let has_colors = matches!(ink, BlockInk::Lit(light) if light.has_colors);
    let rect_px = target.rect_px.map(|edge| edge as f32);
    for part in parts {
        let PatchList { polygons, ids } = lists[part.list];
        let places = &part.bands[band];
        let polygon = |place: u32| &polygons[ids[part.first + place as usize] as usize];
        for (index, own) in places.chunks(LANES).enumerate() {
            let next = places.iter().skip((index + 1) * LANES).take(LANES);
            for &place in next {
                prefetch_record(polygons, ids[part.first + place as usize] as usize);
            }
            for (lane, &place) in own.iter().enumerate() {
                records.put(lane, polygon(place));
                if has_colors {
                    batch.set_color(lane, polygon(place));
                }
            }
            batch.set_up(simd, view, &records, rect_px);
            for (lane, &place) in own.iter().enumerate() {
                let patch = BatchLane {
                    batch: &batch,
                    lane,
                    sides: polygon(place).footprint().len().max(1),
                    number: part.number + place,
                };
                target.draw(simd, view, patch, ink);
            }
        }
    }
}

/// Asks memory for a record: lines of 64 bytes.
#[inline(always)]
fn prefetch_record(polygons: &[OrientedPolygon], index: usize) {
    const WORDS: usize = size_of::<OrientedPolygon>() / 4;
    let words: &[u32] = bytemuck::cast_slice(polygons);
    for line in [0, 16, 32] {
        prefetch_index(words, index * WORDS + line);
    }
    prefetch_index(words, index * WORDS + WORDS - 1);
}

#[cfg(test)]
mod tests;
