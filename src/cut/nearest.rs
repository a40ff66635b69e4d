//! What is hidden within the pixels of the picture: a depth buffer of the host, filled and asked while a cut is chosen.
//!
//! On a rough surface many splats fall into one pixel and only the nearest of them is seen, so that most of what a cut
//! finds is drawn in vain. Writing and drawing a splat costs far more than to look up the nearest depth of its pixels.
//!
//! Related: Greene, Kass and Miller, *Hierarchical Z-Buffer Visibility* (SIGGRAPH 1993). Deviations: the depth is that of
//! the very splats that are drawn, found by the cut and not by the device, so no frame waits for its own depth or depends
//! on the one before; there is no pyramid, because what is hidden is small.
//!
//! **The promise.** A splat is dropped only if each pixel that the device may give it is surely covered by a splat that
//! is drawn and surely nearer, by more than both depths may be rounded. So it would have won in no pixel, and tied in
//! none. What is left does not depend on the order in which splats are found: the nearest of a pixel is never dropped, and
//! all are asked again once all are found.

use super::quad::{self, Balls};
use super::tester::Tester;
use super::{Cut, StripRun, strip_center};
use crate::math::camera::View;
use crate::tree::{Model, Node};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Pixels by which a device may place a splat elsewhere: window positions have at least 4 binary places (a 16th is
/// halved by rounding), and sizes are rounded likewise.
const SNAP_PX: f32 = 0.04;
/// What covers more pixels than this is not asked for.
const MOST_PIXELS: u32 = 1024;
/// Nothing is nearer.
const NOTHING: u32 = f32::INFINITY.to_bits();

/// What nodes and leaves are drawn as, where what is hidden is left out.
#[derive(Debug, Clone, Copy)]
pub struct Footprints<'a> {
    /// Side of the squares or diameter of the discs, pixels; at least 1.
    pub side_px: f32,
    /// Discs instead of squares.
    pub are_discs: bool,
    /// Leaves that are larger than the threshold are splats of their own size instead of triangles.
    pub large_leaves: bool,
    /// Leaves are points, of sizes of their own.
    pub is_cloud: bool,
    /// What is not drawn at all.
    pub undrawn: &'a Undrawn,
}

/// Nodes and leaves of a mesh that have no area: they are in cuts, and nothing is drawn for them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Undrawn {
    nodes: Vec<u64>,
    leaves: Vec<u64>,
}

impl Undrawn {
    /// Looks at all of a model, in parallel: a few milliseconds a million triangles.
    pub fn new(model: &Model) -> Self {
        let triangles = &model.triangles;
        if triangles.is_empty() {
            return Self::default();
        }
        let has_area = |leaf: usize| {
            let corners = triangles.get(leaf)?.map(|i| model.vertices.get(i as usize));
            let [Some(a), Some(b), Some(c)] = corners else {
                return None;
            };
            let cross = (b.position - a.position).cross(c.position - a.position);
            Some(cross.length_squared() > 0.0)
        };
        let areas = &model.tree.attributes;
        Self {
            nodes: bits(areas.len(), |node| {
                areas.get(node).is_none_or(|a| a.area == 0.0)
            }),
            leaves: bits(triangles.len(), |leaf| has_area(leaf) != Some(true)),
        }
    }

    #[inline]
    fn has(list: &[u64], id: u32) -> bool {
        let word = list.get(id as usize / 64);
        word.is_some_and(|word| word >> (id % 64) & 1 != 0)
    }
}

/// A bit for each of `count` items; none at all where no bit is set.
fn bits(count: usize, is_set: impl Fn(usize) -> bool + Sync) -> Vec<u64> {
    let word = |index: usize| {
        let from = 64 * index;
        (from..count.min(from + 64)).fold(0, |word, i| word | u64::from(is_set(i)) << (i - from))
    };
    let words: Vec<u64> = (0..count.div_ceil(64))
        .into_par_iter()
        .with_min_len(256)
        .map(word)
        .collect();
    if words.iter().all(|&word| word == 0) {
        return Vec::new();
    }
    words
}

/// The nearest splat of every pixel: its distance along the view direction from the near plane, as bits (floats that are
/// not negative order like integers).
#[derive(Debug, Default)]
pub(super) struct Nearest {
    width: i32,
    height: i32,
    pixels: Vec<AtomicU32>,
}

impl Nearest {
    /// Empties it for a picture. Keeps its memory.
    pub(super) fn clear(&mut self, width: u32, height: u32) {
        let count = width as usize * height as usize;
        // Pixels are counted in 32 bits.
        let fits = width < 1 << 16 && height < 1 << 16;
        (self.width, self.height) = if fits {
            (width as i32, height as i32)
        } else {
            (0, 0)
        };
        self.pixels
            .resize_with(if fits { count } else { 0 }, AtomicU32::default);
        for pixel in &mut self.pixels {
            *pixel.get_mut() = NOTHING;
        }
    }
}

/// What is asked of [`Nearest`] for a node or leaf: whether these pixels all have something nearer than this.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mark {
    first: u32,
    columns: u16,
    rows: u16,
    /// As [`Nearest`] has it, less the error of both sides.
    distance: u32,
}

impl Mark {
    /// Hidden for good: it has no pixels.
    const HIDDEN: Self = Self {
        first: 0,
        columns: 0,
        rows: 0,
        distance: 0,
    };
    /// Never hidden.
    const SEEN: Self = Self {
        first: 0,
        columns: 1,
        rows: 1,
        distance: 0,
    };
}

/// Marks beside the lists of a cut.
#[derive(Debug, Default)]
pub(super) struct Marks {
    pub(super) nodes: Vec<Mark>,
    /// One for each splat of each row.
    pub(super) strips: Vec<Mark>,
    pub(super) leaves: Vec<Mark>,
    pub(super) triangles: Vec<Mark>,
}

impl Marks {
    pub(super) fn clear(&mut self) {
        self.nodes.clear();
        self.strips.clear();
        self.leaves.clear();
        self.triangles.clear();
    }
}

/// What a ball is drawn as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Drawn {
    /// A splat of the constant size, or larger where the ball is.
    Splat,
    /// Something inside of the ball.
    Triangle,
}

/// The questions of one frame.
#[derive(Debug)]
pub(super) struct Hiding<'a> {
    nearest: &'a Nearest,
    footprints: Footprints<'a>,
    /// To the right and up in the picture, and what is added.
    axes: [([Vec4; 3], Vec4); 2],
    /// Pixels of a tangent (perspective) or of a unit.
    focal: [f32; 2],
    middle: [f32; 2],
    near: f32,
    far: f32,
    is_perspective: bool,
    /// Error of a distance; and what a depth that is rounded is off, as a distance: the factor of z² (perspective) or
    /// alone.
    distance_error: f32,
    depth_error: f32,
    /// Half the side of what a splat surely covers, and of what it may.
    inner_px: f32,
    outer_px: f32,
}

impl<'a> Hiding<'a> {
    pub(super) fn new(
        nearest: &'a Nearest,
        tester: &Tester,
        view: &View,
        footprints: Footprints<'a>,
    ) -> Self {
        let scale = if view.model_scale > 0.0 {
            view.model_scale
        } else {
            1.0
        };
        let axis = |row: usize| {
            let axis: Vec3 = view.view_from_model.row(row).truncate() / scale;
            let start = view.view_from_model.transform_point3(tester.reference)[row] / scale;
            (
                [axis.x, axis.y, axis.z].map(Vec4::splat),
                Vec4::splat(start * tester.unit),
            )
        };
        let half = [view.width as f32 / 2.0, view.height as f32 / 2.0];
        let (unit, sign) = if view.is_perspective {
            (1.0, -1.0)
        } else {
            (scale / tester.unit, 1.0)
        };
        let (near, far) = (tester.near, tester.far);
        let range = far - near;
        // Depth is n (f - z) / (z (f - n)), or (f - z) / (f - n): a few roundings of its largest term each.
        let depth_error = if view.is_perspective {
            1e-6 * (1.0 + 2.0 * near / range) * range / (near * far)
        } else {
            1e-6 * (range + 2.0 * far.abs().max(near.abs()))
        };
        let side = footprints.side_px.max(1.0);
        Self {
            nearest,
            footprints,
            axes: [axis(0), axis(1)],
            focal: [
                view.scale[0] * half[0] * unit,
                -view.scale[1] * half[1] * unit,
            ],
            middle: [
                half[0] * (1.0 + sign * view.offset[0]),
                half[1] * (1.0 - sign * view.offset[1]),
            ],
            near,
            far,
            is_perspective: view.is_perspective,
            // Device and host transform positions in single precision, a part in 2^24 of the model's reach and more
            // than one rounding each.
            distance_error: 8.0 * tester.plane_error,
            depth_error,
            // A disc of less than sqrt(2) pixels is a square.
            inner_px: if footprints.are_discs {
                (side / 2.0 * std::f32::consts::FRAC_1_SQRT_2).max(0.5)
            } else {
                side / 2.0
            },
            outer_px: side / 2.0,
        }
    }

    /// Leaves `lanes` without what is hidden so far; what is not leaves its depth (unless `is_undrawn`) and a mark.
    #[inline]
    pub(super) fn keep(
        &self,
        balls: &Balls,
        lanes: u8,
        drawn: Drawn,
        is_undrawn: impl Fn(u32) -> bool,
        marks: &mut Vec<Mark>,
    ) -> u8 {
        if lanes == 0 {
            return 0;
        }
        let z = balls.depth;
        let along = self.axes.map(|([a, b, c], start)| {
            let [x, y, z] = balls.center;
            a * x + b * y + c * z + start
        });
        // By how much pixels are off; half of what a splat of the ball's size is drawn as; half the ball's picture: with
        // the slope s of its center, a point of a ball is at most f r (1 + |s|) / (z - r) from there.
        let focal = self.focal[0].abs().max(self.focal[1].abs());
        let (x, y, off, own, reach) = if self.is_perspective {
            let [x, y] = along.map(|v| v / z);
            let slope = 1.0 + x.abs().max(y.abs());
            (
                x,
                y,
                slope * (focal * self.distance_error) / z,
                balls.radius * (1.001 * focal) / z,
                balls.radius * slope * focal / (z - balls.radius),
            )
        } else {
            (
                along[0],
                along[1],
                Vec4::splat(focal * self.distance_error),
                balls.radius * (1.001 * focal),
                balls.radius * focal,
            )
        };
        let x = x * self.focal[0] + self.middle[0];
        let y = y * self.focal[1] + self.middle[1];
        let off = off + SNAP_PX;
        let (nearest_z, outer) = match drawn {
            Drawn::Splat => (z, own.max(Vec4::splat(self.outer_px))),
            Drawn::Triangle => (z - balls.radius * 1.001, reach * 1.001 + 0.5),
        };
        let outer = outer + off;
        let inner = Vec4::splat(self.inner_px) - off;
        let error = if self.is_perspective {
            nearest_z * nearest_z * self.depth_error + self.distance_error
        } else {
            Vec4::splat(self.depth_error + self.distance_error)
        };
        // What the clip volume may take away covers nothing surely.
        let is_known = (nearest_z.cmpgt(Vec4::splat(self.near) + error)
            & nearest_z.cmplt(Vec4::splat(self.far) - error))
        .bitmask();
        let distance = (nearest_z - self.near).to_array();
        let error = error.to_array();
        // Pixel i has its center at i + 1/2.
        let ceil = |v: Vec4| (v - 0.5).ceil().to_array();
        let floor = |v: Vec4| (v - 0.5).floor().to_array();
        let (left, right) = (ceil(x - outer), floor(x + outer));
        let (top, bottom) = (ceil(y - outer), floor(y + outer));
        let (inner_left, inner_right) = (ceil(x - inner), floor(x + inner));
        let (inner_top, inner_bottom) = (ceil(y - inner), floor(y + inner));
        let mut kept = 0;
        for lane in 0..4 {
            if lanes >> lane & 1 == 0 {
                continue;
            }
            let mut mark = Mark::SEEN;
            if is_known >> lane & 1 != 0 {
                let outer = [left[lane], top[lane], right[lane], bottom[lane]];
                mark = self.mark(outer, distance[lane] - error[lane]);
                if self.is_hidden(mark) {
                    continue;
                }
                if drawn == Drawn::Splat && !is_undrawn(lane as u32) {
                    let inner = [
                        inner_left[lane],
                        inner_top[lane],
                        inner_right[lane],
                        inner_bottom[lane],
                    ];
                    self.cover(inner, distance[lane]);
                }
            }
            marks.push(mark);
            kept |= 1 << lane;
        }
        kept
    }

    /// The pixels of a rectangle (both ends included) that lie in the picture, and what to ask of them. No pixels are
    /// hidden.
    #[inline]
    fn mark(&self, [left, top, right, bottom]: [f32; 4], distance: f32) -> Mark {
        // Casts saturate, and what is not a number is at 0 with a distance that hides nothing.
        let (left, top) = ((left as i32).max(0), (top as i32).max(0));
        let right = (right as i32).min(self.nearest.width - 1);
        let bottom = (bottom as i32).min(self.nearest.height - 1);
        let columns = (right - left + 1).max(0) as u32;
        let rows = (bottom - top + 1).max(0) as u32;
        if columns * rows > MOST_PIXELS {
            return Mark::SEEN;
        }
        if columns * rows == 0 {
            return Mark::HIDDEN;
        }
        Mark {
            first: (top * self.nearest.width + left) as u32,
            columns: columns as u16,
            rows: rows as u16,
            // A NaN becomes 0 here.
            distance: distance.max(0.0).to_bits(),
        }
    }

    #[inline]
    fn is_hidden(&self, mark: Mark) -> bool {
        let mut first = mark.first as usize;
        for _ in 0..mark.rows {
            let row = self.nearest.pixels.get(first..first + mark.columns as usize);
            let Some(row) = row else { return false };
            if row.iter().any(|pixel| pixel.load(Ordering::Relaxed) >= mark.distance) {
                return false;
            }
            first += self.nearest.width as usize;
        }
        true
    }

    #[inline]
    fn cover(&self, [left, top, right, bottom]: [f32; 4], distance: f32) {
        let (left, top) = ((left as i32).max(0), (top as i32).max(0));
        let right = (right as i32).min(self.nearest.width - 1);
        let bottom = (bottom as i32).min(self.nearest.height - 1);
        if (right - left + 1).saturating_mul(bottom - top + 1) > MOST_PIXELS as i32 {
            return;
        }
        let distance = distance.max(0.0).to_bits();
        for y in top..=bottom {
            let start = y as usize * self.nearest.width as usize;
            let row = (start + left as usize)..(start + (right + 1).max(left) as usize);
            for pixel in self.nearest.pixels.get(row).unwrap_or_default() {
                // Most lose, and an exchange costs more than a look.
                if distance < pixel.load(Ordering::Relaxed) {
                    pixel.fetch_min(distance, Ordering::Relaxed);
                }
            }
        }
    }

    /// As [`keep`](Self::keep), for nodes that are splats of the constant size.
    #[inline]
    pub(super) fn keep_nodes(
        &self,
        balls: &Balls,
        first: u32,
        lanes: u8,
        marks: &mut Vec<Mark>,
    ) -> u8 {
        let undrawn = &self.footprints.undrawn.nodes;
        let is_undrawn = |lane| Undrawn::has(undrawn, first.wrapping_add(lane));
        self.keep(&points(balls), lanes, Drawn::Splat, is_undrawn, marks)
    }

    /// The same for leaves; those in `splats` are splats in any case.
    #[inline]
    pub(super) fn keep_leaves(
        &self,
        balls: &Balls,
        first: u32,
        (lanes, splats): (u8, u8),
        marks: &mut Marks,
    ) -> u8 {
        let undrawn = &self.footprints.undrawn.leaves;
        let is_undrawn = |lane| Undrawn::has(undrawn, first.wrapping_add(lane));
        let large = if self.footprints.large_leaves {
            Drawn::Splat
        } else {
            Drawn::Triangle
        };
        let (small, points) = (lanes & splats, points(balls));
        // A small triangle has the constant size, a point of a cloud its own.
        let small_balls = if self.footprints.is_cloud {
            balls
        } else {
            &points
        };
        self.keep(small_balls, small, Drawn::Splat, is_undrawn, &mut marks.leaves)
            | self.keep(balls, lanes & !splats, large, is_undrawn, &mut marks.triangles)
    }

    /// Drops the rows of splats from number `first` on that are hidden. Returns how many splats they are.
    pub(super) fn keep_rows(
        &self,
        model: &Model,
        tester: &Tester,
        strips: &mut Vec<StripRun>,
        first: usize,
        marks: &mut Vec<Mark>,
    ) -> u64 {
        let nodes: &[Node] = &model.tree.nodes;
        let (mut kept, mut hidden) = (first, 0);
        for index in first..strips.len() {
            let Some(&run) = strips.get(index) else { break };
            let Some(node) = nodes.get(run.node as usize) else {
                continue;
            };
            let is_undrawn = Undrawn::has(&self.footprints.undrawn.nodes, run.node);
            let start = strip_center(node, run.count, 0);
            let step = strip_center(node, run.count, 1) - start;
            let end = marks.len() + run.count as usize;
            let mut is_kept = false;
            for at in (0..run.count).step_by(4) {
                let center = |lane: u32| (start + step * (at + lane) as f32).extend(0.0);
                let balls = tester.balls(quad::columns([0, 1, 2, 3].map(center)));
                let lanes = (1u8 << (run.count - at).min(4)) - 1;
                is_kept |= self.keep(&balls, lanes, Drawn::Splat, |_| is_undrawn, marks) != 0;
            }
            if !is_kept {
                hidden += u64::from(run.count);
                continue;
            }
            // One for each splat; those that are hidden stay so.
            marks.resize(end, Mark::HIDDEN);
            if let Some(place) = strips.get_mut(kept) {
                *place = run;
            }
            kept += 1;
        }
        strips.truncate(kept);
        hidden
    }

    /// Drops what is hidden now that all is found. `ends` are places in the lists of nodes and of rows, in ascending
    /// order, and are moved along.
    pub(super) fn finish(&self, cut: &mut Cut, marks: &Marks, ends: &mut [(usize, usize)]) {
        let Cut {
            nodes,
            strips,
            leaves,
            triangles,
            stats,
        } = cut;
        let is_seen = |list: &[Mark], index: usize| {
            list.get(index).is_none_or(|&mark| !self.is_hidden(mark))
        };
        let nodes_before = nodes.len();
        retain(
            nodes,
            |index, _| is_seen(&marks.nodes, index),
            ends.iter_mut().map(|end| &mut end.0),
        );
        let mut first_mark = 0;
        let mut hidden_in_rows = 0;
        retain(
            strips,
            |_, run| {
                let own = first_mark..first_mark + run.count as usize;
                first_mark = own.end;
                let own = marks.strips.get(own).unwrap_or_default();
                let is_kept = own.iter().any(|&mark| !self.is_hidden(mark));
                hidden_in_rows += if is_kept { 0 } else { u64::from(run.count) };
                is_kept
            },
            ends.iter_mut().map(|end| &mut end.1),
        );
        let (leaves_before, triangles_before) = (leaves.len(), triangles.len());
        retain(leaves, |index, _| is_seen(&marks.leaves, index), [].into_iter());
        retain(
            triangles,
            |index, _| is_seen(&marks.triangles, index),
            [].into_iter(),
        );
        stats.hidden_splats += hidden_in_rows;
        stats.hidden_splats += (nodes_before - nodes.len() + leaves_before - leaves.len()) as u64;
        stats.hidden_leaves += (triangles_before - triangles.len()) as u64;
    }
}

/// The centers alone.
#[inline]
fn points(balls: &Balls) -> Balls {
    Balls {
        radius: Vec4::ZERO,
        ..*balls
    }
}

/// Keeps the items for which `is_kept` (of their number and themselves) says so; `ends` move along.
fn retain<'e, T: Copy>(
    list: &mut Vec<T>,
    mut is_kept: impl FnMut(usize, &T) -> bool,
    ends: impl Iterator<Item = &'e mut usize>,
) {
    let mut ends = ends.peekable();
    let (mut kept, len) = (0, list.len());
    for index in 0..=len {
        while let Some(end) = ends.next_if(|end| **end <= index) {
            *end = kept;
        }
        let Some(&item) = list.get(index) else { break };
        if is_kept(index, &item) {
            if let Some(place) = list.get_mut(kept) {
                *place = item;
            }
            kept += 1;
        }
    }
    list.truncate(kept);
}
