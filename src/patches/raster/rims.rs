//! Rims of patches by how much of each pixel they cover: the rules are those of the reference (`src/render/reference/rims.rs`).
//!
//! The patches around a pixel are set up at once, a lane each; then each is tested at sixteen samples at once.

use super::blocks::BatchLane;
use super::set_up::{LANES, PatchBatch, RecordRows};
use super::view::RasterView;
use super::{BAND_ROWS, NOTHING, PatchList, PatchRaster};
use crate::abi::OrientedPolygon;
use crate::patches::rim_rules::{
    AROUND, RIM_PLACES, RIM_SAMPLES, StraightDepth, outward_direction,
};
use crate::threads::share;
use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd, dispatch, f32x16};
use glam::{Vec2, Vec4};
use std::ops::Range;

const _: () = assert!(RIM_SAMPLES == LANES && AROUND.len() <= LANES);

/// A picture whose patches are drawn.
#[derive(Debug)]
pub struct RimPicture<'a> {
    /// Colors from the first pixel of the rectangle on; red in the lowest byte, coverage in the highest.
    pub colors: &'a mut [u32],
    /// Pixels from a row of colors to the next.
    pub pitch: usize,
    /// Reversed depths, 0 where nothing is; row by row without gaps.
    pub depths: &'a [f32],
    /// Colors and coverage as floats, row by row without gaps; empty where there are none.
    pub values: &'a mut [[f32; 4]],
}

/// Colors of rims, by bands of rows; kept from frame to frame.
#[derive(Debug, Default)]
pub(super) struct RimBands {
    bands: Vec<RimBand>,
}

/// Rims of some rows.
#[derive(Debug, Default)]
struct RimBand {
    /// Place among depths, and color.
    found: Vec<(usize, Vec4)>,
    is_rim: Vec<bool>,
}

/// A picture in which rims are found, and the patches that it shows.
struct RimScan<'a> {
    lists: &'a [PatchList<'a>],
    /// Number of the first patch of each list.
    firsts: Vec<u32>,
    view: &'a RasterView,
    numbers: &'a [u32],
    picture: RimPicture<'a>,
    rect_px: [u32; 4],
}

/// Patches that a pixel and its neighbors show, and what is behind them.
struct RimSurroundings {
    /// Place among depths.
    at: usize,
    count: usize,
    /// Number, lane where it is set up, and color of a pixel that shows it.
    patches: [(u32, usize, Vec4); AROUND.len()],
    /// Depth and color; `None` where what no patch covers does not count.
    behind: Option<(f32, Vec4)>,
    /// Direction in which depths fall.
    outward: Option<Vec2>,
}

impl PatchRaster {
    /// Covers pixels at rims in part, in the picture that patches were last drawn into with their numbers. `lists` are those
    /// that were drawn.
    ///
    /// # Panics
    /// When the picture is smaller than its rectangle.
    pub fn cover_rims(&mut self, lists: &[PatchList<'_>], picture: RimPicture<'_>) {
        let Some(view) = &self.view else { return };
        let mut number = 0;
        let firsts = lists.iter().map(|list| {
            let first = number;
            number += list.ids.len() as u32;
            first
        });
        let input = RimScan {
            firsts: firsts.collect(),
            lists,
            view,
            numbers: &self.numbers,
            picture,
            rect_px: self.rect_px,
        };
        let [width, height] = input.size();
        if width == 0 || height == 0 {
            return;
        }
        let bands = height.div_ceil(BAND_ROWS);
        self.rims.bands.resize_with(bands, RimBand::default);
        let level = Level::new();
        share(
            &mut vec![(); self.threads],
            self.rims.bands.iter_mut().enumerate(),
            |(), (number, band)| {
                let first = number * BAND_ROWS;
                let rows = first..(first + BAND_ROWS).min(height);
                dispatch!(level, simd => band.find(simd, &input, rows.clone()));
            },
        );
        let RimPicture {
            colors,
            pitch,
            values,
            ..
        } = input.picture;
        for &(at, color) in self.rims.bands.iter().flat_map(|band| &band.found) {
            let bytes = color.to_array().map(|part| (part * 255.0).round() as u8);
            colors[at / width * pitch + at % width] = u32::from_le_bytes(bytes);
            if let Some(value) = values.get_mut(at) {
                *value = color.to_array();
            }
        }
    }
}

impl RimScan<'_> {
    /// Columns and rows of the rectangle.
    fn size(&self) -> [usize; 2] {
        let [left, top, right, bottom] = self.rect_px.map(|edge| edge as usize);
        [right.saturating_sub(left), bottom.saturating_sub(top)]
    }

    fn polygon(&self, number: u32) -> &OrientedPolygon {
        let list = self.firsts.partition_point(|first| *first <= number) - 1;
        let PatchList { polygons, ids } = self.lists[list];
        &polygons[ids[(number - self.firsts[list]) as usize] as usize]
    }

    fn color(&self, at: usize) -> Vec4 {
        if let Some(value) = self.picture.values.get(at) {
            return Vec4::from(*value);
        }
        let width = self.size()[0];
        let word = self.picture.colors[at / width * self.picture.pitch + at % width];
        Vec4::from(word.to_le_bytes().map(f32::from)) / 255.0
    }

    /// Surroundings of a pixel, with lanes that are not known yet. `None` where there are no patches.
    fn around(&self, [x, y]: [usize; 2]) -> Option<RimSurroundings> {
        let [width, height] = self.size();
        let mut patches = [(NOTHING, 0, Vec4::ZERO); AROUND.len()];
        let (mut others, mut other_count, mut count) = (Vec4::ZERO, 0.0, 0);
        let own = y * width + x;
        let mut falls = [(Vec2::ZERO, 0.0); AROUND.len()];
        for ([across, down], fall) in AROUND.into_iter().zip(&mut falls) {
            let column = x.wrapping_add_signed(across as isize);
            let line = y.wrapping_add_signed(down as isize);
            if column >= width || line >= height {
                continue;
            }
            let at = line * width + column;
            let depths = self.picture.depths;
            *fall = (
                Vec2::new(across as f32, down as f32),
                depths[own] - depths[at],
            );
            let number = self.numbers[at];
            if number == NOTHING {
                others += self.color(at);
                other_count += 1.0;
            } else if patches[..count].iter().all(|(known, ..)| *known != number) {
                patches[count] = (number, 0, self.color(at));
                count += 1;
            }
        }
        let behind = match (self.numbers[own] == NOTHING, other_count > 0.0) {
            (true, _) => Some((self.picture.depths[own], self.color(own))),
            (false, true) => Some((0.0, others / other_count)),
            (false, false) => None,
        };
        (count > 0).then_some(RimSurroundings {
            at: own,
            count,
            patches,
            behind,
            outward: outward_direction(falls.into_iter()),
        })
    }
}

impl RimBand {
    /// Finds the colors of rims in some rows.
    #[inline(always)]
    fn find<S: Simd>(&mut self, simd: S, input: &RimScan<'_>, rows: Range<usize>) {
        self.found.clear();
        let [width, height] = input.size();
        let row = |y: usize| &input.picture.depths[y * width..(y + 1) * width];
        let mut batch = RimBatch::new();
        for y in rows {
            let own = row(y);
            self.is_rim.clear();
            self.is_rim.resize(width, false);
            if y > 0 && y + 1 < height {
                let sides = [row(y - 1), row(y + 1)];
                flag_rims(own, sides, input.view.straight, &mut self.is_rim);
            }
            if width > 2 {
                let inner = &mut self.is_rim[1..width - 1];
                let sides = [&own[..width - 2], &own[2..]];
                flag_rims(&own[1..width - 1], sides, input.view.straight, inner);
            }
            let flags = self.is_rim.iter().enumerate();
            for (x, _) in flags.filter(|(_, is_rim)| **is_rim) {
                let Some(around) = input.around([x, y]) else {
                    continue;
                };
                if !batch.has_room(&around) {
                    batch.finish(simd, input, &mut self.found);
                }
                batch.add(input, around);
            }
        }
        batch.finish(simd, input, &mut self.found);
    }
}

/// Pixels that lie near each other, and the patches around them, which are set up at once: pixels share most of them.
struct RimBatch {
    records: RecordRows,
    patches: PatchBatch,
    count: usize,
    /// Number and sides of each lane.
    lanes: [(u32, usize); LANES],
    waiting: Vec<RimSurroundings>,
}

impl RimBatch {
    fn new() -> Self {
        Self {
            records: RecordRows::ZERO,
            patches: PatchBatch::ZERO,
            count: 0,
            lanes: [(NOTHING, 1); LANES],
            waiting: Vec::new(),
        }
    }

    fn lane_of(&self, number: u32) -> Option<usize> {
        let mut lanes = self.lanes[..self.count].iter();
        lanes.position(|(known, _)| *known == number)
    }

    /// Tells whether the patches around another pixel have lanes.
    fn has_room(&self, around: &RimSurroundings) -> bool {
        let patches = &around.patches[..around.count];
        let new = patches.iter().filter(|own| self.lane_of(own.0).is_none());
        self.count + new.count() <= LANES
    }

    /// Adds a pixel for whose patches there is room.
    fn add(&mut self, input: &RimScan<'_>, mut around: RimSurroundings) {
        for (number, lane, _) in &mut around.patches[..around.count] {
            *lane = self.lane_of(*number).unwrap_or_else(|| {
                let polygon = input.polygon(*number);
                let lane = self.count;
                self.records.put(lane, polygon);
                self.lanes[lane] = (*number, polygon.footprint().len().max(1));
                self.count += 1;
                lane
            });
        }
        self.waiting.push(around);
    }

    /// Colors the pixels, and empties itself.
    #[inline(always)]
    fn finish<S: Simd>(&mut self, simd: S, input: &RimScan<'_>, found: &mut Vec<(usize, Vec4)>) {
        self.patches
            .set_up(simd, input.view, &self.records, [0.0; 4]);
        let [left, top, ..] = input.rect_px.map(|edge| edge as f32);
        let width = input.size()[0];
        for around in &self.waiting {
            let (x, y) = ((around.at % width) as f32, (around.at / width) as f32);
            if let Some(color) = self.color_of(simd, input.view, (around, [left + x, top + y])) {
                found.push((around.at, color));
            }
        }
        self.waiting.clear();
        self.count = 0;
    }

    /// Color of a pixel, whose left top corner is at a place, by its samples; `None` where none counts.
    #[inline(always)]
    fn color_of<S: Simd>(
        &self,
        simd: S,
        view: &RasterView,
        (around, corner): (&RimSurroundings, [f32; 2]),
    ) -> Option<Vec4> {
        let places = [
            f32x16::from_slice(simd, &RIM_PLACES[0]) + corner[0],
            f32x16::from_slice(simd, &RIM_PLACES[1]) + corner[1],
        ];
        let mut front = f32x16::splat(simd, around.behind.map_or(0.0, |(depth, _)| depth));
        let mut nearest = f32x16::splat(simd, -1.0);
        for (index, &(number, lane, _)) in around.patches[..around.count].iter().enumerate() {
            let (_, sides) = self.lanes[lane];
            let patch = BatchLane {
                batch: &self.patches,
                lane,
                sides,
                number,
            };
            let seen = match around.outward {
                Some(outward) => {
                    Some(patch.seen_with_outer_sides(simd, view, places, outward.to_array()))
                }
                None => patch.seen_at(simd, view, places),
            };
            let Some(seen) = seen else { continue };
            let wins = seen.covered & seen.depth.simd_gt(front);
            front = wins.select(seen.depth, front);
            nearest = wins.select(f32x16::splat(simd, index as f32), nearest);
        }
        let mut lanes = [0.0; LANES];
        nearest.store_slice(&mut lanes);
        let (mut sum, mut count) = (Vec4::ZERO, 0.0);
        for lane in lanes {
            let color = match lane >= 0.0 {
                true => Some(around.patches[lane as usize].2),
                false => around.behind.map(|(_, color)| color),
            };
            if let Some(color) = color {
                sum += color;
                count += 1.0;
            }
        }
        (count > 0.0).then(|| sum / count)
    }
}

/// Flags depths that do not go on straight from one side to the other.
#[inline(always)]
fn flag_rims(
    own: &[f32],
    [before, after]: [&[f32]; 2],
    straight: StraightDepth,
    is_rim: &mut [bool],
) {
    let sides = before.iter().zip(after);
    for ((&own, (&before, &after)), is_rim) in own.iter().zip(sides).zip(is_rim) {
        *is_rim |= straight.is_broken([before, own, after]);
    }
}
