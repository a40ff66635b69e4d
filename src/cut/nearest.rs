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

mod lists;

use super::footprints::{Footprints, Undrawn};
use super::quad::Balls;
use super::tester::Tester;
use crate::math::camera::View;
use glam::{Vec3, Vec4};
use std::ops::{Range, RangeInclusive};
use std::sync::atomic::{AtomicU32, Ordering};

/// Binary places of window positions that every device has, and as many as compute rounds them to.
pub(super) const SUBPIXEL_BITS: RangeInclusive<u32> = 4..=8;
/// What covers more pixels than this is not asked for.
const MOST_PIXELS: u32 = 1024;
/// Nothing is nearer.
const NOTHING: u32 = f32::INFINITY.to_bits();

/// The nearest splat of every pixel: its distance along the view direction from the near plane, as bits (floats that are
/// not negative order like integers).
#[derive(Debug, Default)]
pub(super) struct Nearest {
    width: u32,
    height: u32,
    pixels: Vec<AtomicU32>,
}

impl Nearest {
    /// Empties it for a picture, and tells whether it can: sides must fit 16 bits. Keeps its memory.
    pub(super) fn clear(&mut self, width: u32, height: u32) -> bool {
        if width >= 1 << 16 || height >= 1 << 16 {
            return false;
        }
        (self.width, self.height) = (width, height);
        let count = width as usize * height as usize;
        self.pixels.resize_with(count, AtomicU32::default);
        for pixel in &mut self.pixels {
            *pixel.get_mut() = NOTHING;
        }
        true
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
    /// One for each splat of each row that is seen so far.
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

/// The questions of one frame.
#[derive(Debug)]
pub(super) struct Hiding<'a> {
    nearest: &'a Nearest,
    footprints: Footprints,
    undrawn: &'a Undrawn,
    /// To the right and up in the picture, and what is added.
    axes: [([Vec4; 3], Vec4); 2],
    /// Pixels of a tangent (perspective) or of a unit.
    focal: [f32; 2],
    middle: [f32; 2],
    /// Width and height of the picture.
    size: [f32; 2],
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
    /// Pixels by which a device may place a splat elsewhere by rounding.
    snap_px: f32,
}

/// Four splats in the picture.
#[derive(Clone, Copy)]
struct Placed {
    /// Pixels.
    x: Vec4,
    y: Vec4,
    /// Half of what a splat may cover and surely covers, pixels.
    outer: Vec4,
    inner: Vec4,
    /// Lanes that the clip volume takes nothing away of: else nothing is covered surely. Not what is no number.
    known: u8,
    /// From the near plane; and less the error of both sides.
    distance: [u32; 4],
    asked: [u32; 4],
}

impl<'a> Hiding<'a> {
    pub(super) fn new(
        nearest: &'a Nearest,
        tester: &Tester,
        view: &View,
        (footprints, undrawn): (Footprints, &'a Undrawn),
        subpixel_bits: u32,
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
        let side = if footprints.is_cloud {
            footprints.side_px.max(1.0)
        } else {
            footprints.side_px
        };
        let (inner_px, outer_px) = if side < 1.0 {
            // Drawn is what is left here: no device decides about it.
            (side / 2.0, side / 2.0)
        } else if footprints.are_discs {
            // Vulkan lets a device round the size of a point to whole pixels. A disc contains this square, and of less than
            // sqrt(2) pixels it is a square.
            let inner = side / 2.0 * std::f32::consts::FRAC_1_SQRT_2;
            (inner.min(side.floor() / 2.0).max(0.5), side.ceil() / 2.0)
        } else {
            (side.floor() / 2.0, side.ceil() / 2.0)
        };
        Self {
            nearest,
            footprints,
            undrawn,
            axes: [axis(0), axis(1)],
            focal: [
                view.scale[0] * half[0] * unit,
                -view.scale[1] * half[1] * unit,
            ],
            middle: [
                half[0] * (1.0 + sign * view.offset[0]),
                half[1] * (1.0 - sign * view.offset[1]),
            ],
            size: [nearest.width as f32, nearest.height as f32],
            near,
            far,
            is_perspective: view.is_perspective,
            // Device and host transform positions in single precision, a part in 2^24 of the model's reach and more
            // than one rounding each.
            distance_error: 8.0 * tester.plane_error,
            depth_error,
            inner_px,
            outer_px,
            // Half a step, and the roundings of positions in single precision.
            snap_px: 0.5_f32.powi(1 + subpixel_bits as i32)
                + 1e-6 * nearest.width.max(nearest.height) as f32,
        }
    }

    #[inline]
    fn placed(&self, balls: &Balls) -> Placed {
        let z = balls.depth;
        let along = self.axes.map(|([a, b, c], start)| {
            let [x, y, z] = balls.center;
            a * x + b * y + c * z + start
        });
        // By how much pixels are off, and half of what a splat of the ball's size is drawn as.
        let focal = self.focal[0].abs().max(self.focal[1].abs());
        let ([x, y], off, own, error) = if self.is_perspective {
            let inverse = Vec4::ONE / z;
            let [x, y] = along.map(|v| v * inverse);
            let slope = 1.0 + x.abs().max(y.abs());
            (
                [x, y],
                slope * inverse * (focal * self.distance_error),
                balls.radius * inverse * (1.001 * focal),
                z * z * self.depth_error + self.distance_error,
            )
        } else {
            (
                along,
                Vec4::splat(focal * self.distance_error),
                balls.radius * (1.001 * focal),
                Vec4::splat(self.depth_error + self.distance_error),
            )
        };
        let off = off + self.snap_px;
        let is_known =
            z.cmpgt(Vec4::splat(self.near) + error) & z.cmplt(Vec4::splat(self.far) - error);
        let distance = z - self.near;
        // What is smaller than a pixel is drawn as one pixel or none, of any other the device may round the size.
        let rounded = if self.is_sampled() {
            Vec4::select(own.cmplt(Vec4::splat(0.5)), own, own + 0.5)
        } else {
            own + 0.5
        };
        Placed {
            x: x * self.focal[0] + self.middle[0],
            y: y * self.focal[1] + self.middle[1],
            outer: rounded.max(Vec4::splat(self.outer_px)) + off,
            inner: Vec4::splat(self.inner_px) - off,
            known: is_known.bitmask() as u8,
            distance: distance.to_array().map(f32::to_bits),
            asked: if self.footprints.hides {
                let asked = (distance - error).max(Vec4::ZERO);
                asked.to_array().map(f32::to_bits)
            } else {
                [0; 4]
            },
        }
    }

    /// Whether anything is dropped of splats.
    #[inline]
    pub(super) fn asks_splats(&self) -> bool {
        self.footprints.hides || self.is_sampled()
    }

    /// Whether leaves that are larger than the threshold are triangles.
    #[inline]
    pub(super) fn has_triangles(&self) -> bool {
        !self.footprints.large_leaves && !self.footprints.is_cloud
    }

    /// Whether splats are smaller than a pixel.
    #[inline]
    fn is_sampled(&self) -> bool {
        self.outer_px < 0.5
    }

    /// Those of `lanes` whose triangle, which lies in the ball, may contain the center of a pixel. Between them no device
    /// draws anything of it.
    #[inline]
    fn meets_centers(&self, balls: &Balls, lanes: u8) -> u8 {
        if lanes == 0 {
            return 0;
        }
        let along = self.axes.map(|([a, b, c], start)| {
            let [x, y, z] = balls.center;
            a * x + b * y + c * z + start
        });
        let focal = self.focal[0].abs().max(self.focal[1].abs());
        let ([x, y], scale, stretch, is_known) = if self.is_perspective {
            let inverse = Vec4::ONE / balls.depth;
            let [x, y] = along.map(|v| v * inverse);
            let aside = x.abs().max(y.abs());
            // A ball of radius r at a distance of 1 reaches r sqrt(1 + a²) / (1 - r²) to the side, from a middle that is
            // a r² / (1 - r²) farther off; so near that r matters here, nothing is dropped.
            let is_small = (balls.radius * inverse).cmplt(Vec4::splat(0.01));
            let stretch = 1.001 + 0.01 * aside + 0.5 * aside * aside;
            ([x, y], inverse * focal, stretch, is_small)
        } else {
            let every = Vec4::ONE.cmpeq(Vec4::ONE);
            (along, Vec4::splat(focal), Vec4::splat(1.001), every)
        };
        let to_center = |v: Vec4| (v - v.floor() - 0.5).abs();
        let x = to_center(x * self.focal[0] + self.middle[0]);
        let y = to_center(y * self.focal[1] + self.middle[1]);
        // Corners are moved by rounding in both directions.
        let off = (stretch * scale * self.distance_error + self.snap_px) * std::f32::consts::SQRT_2;
        let reach = balls.radius * scale * stretch + off;
        let misses = (x * x + y * y).cmpgt(reach * reach)
            & is_known
            & balls.depth.cmpgt(Vec4::splat(self.near));
        lanes & !(misses.bitmask() as u8)
    }

    /// The marks of splats around the centers of `lanes`, of the constant size or that of their balls, whichever is
    /// larger. What is not hidden so far leaves its depth, unless `is_undrawn`.
    #[inline]
    fn ask(&self, balls: &Balls, lanes: u8, is_undrawn: impl Fn(u32) -> bool) -> [Mark; 4] {
        let placed = self.placed(balls);
        let mut marks = [Mark::HIDDEN; 4];
        let rest = if self.outer_px > 0.5 {
            lanes
        } else {
            lanes & !self.ask_pixels(&placed, lanes, &is_undrawn, &mut marks)
        };
        if rest != 0 {
            self.ask_squares(&placed, rest, is_undrawn, &mut marks);
        }
        marks
    }

    /// What [`ask`](Self::ask) does for those of `lanes` that cover one pixel of the picture and may cover no other, which
    /// of squares of a pixel are nearly all: in a third of the time. Returns which they are.
    #[inline]
    fn ask_pixels(
        &self,
        placed: &Placed,
        lanes: u8,
        is_undrawn: impl Fn(u32) -> bool,
        marks: &mut [Mark; 4],
    ) -> u8 {
        // A sum with 2^23 is rounded to whole numbers, and has them in its low bits: here 1 more than the pixel's.
        let sums = [placed.x, placed.y].map(|v| v + 0.5 + 8_388_608.0);
        let [x, y] = [(placed.x, sums[0]), (placed.y, sums[1])]
            .map(|(v, sum)| (v + 0.5 - (sum - 8_388_608.0)).abs());
        // The pixel's own center is that far away, the next one 1 less that.
        let farther = x.max(y);
        let [width, height] = self.size.map(Vec4::splat);
        let is_one = farther.cmplt((1.0 - placed.outer).min(placed.inner))
            & placed.x.cmpgt(Vec4::ZERO)
            & placed.y.cmpgt(Vec4::ZERO)
            & placed.x.cmplt(width)
            & placed.y.cmplt(height);
        let ones = lanes & placed.known & is_one.bitmask() as u8;
        // Smaller than a pixel, it contains no center.
        let none = farther.cmpgt(placed.outer).bitmask() as u8;
        let nones = lanes & placed.known & none;
        let [columns, rows] = sums.map(|sum| sum.to_array().map(|v| v.to_bits() & 0x7f_ffff));
        for lane in 0..4 {
            if ones >> lane & 1 == 0 {
                continue;
            }
            let (row, column) = (
                rows[lane].saturating_sub(1),
                columns[lane].saturating_sub(1),
            );
            let first = row * self.nearest.width + column;
            let Some(pixel) = self.nearest.pixels.get(first as usize) else {
                marks[lane] = Mark::SEEN;
                continue;
            };
            let there = pixel.load(Ordering::Relaxed);
            if there < placed.asked[lane] {
                continue;
            }
            marks[lane] = Mark {
                first,
                columns: 1,
                rows: 1,
                distance: placed.asked[lane],
            };
            let distance = placed.distance[lane];
            if distance < there && !is_undrawn(lane as u32) {
                pixel.fetch_min(distance, Ordering::Relaxed);
            }
        }
        ones | nones
    }

    /// The same for squares of any size and place.
    fn ask_squares(
        &self,
        placed: &Placed,
        lanes: u8,
        is_undrawn: impl Fn(u32) -> bool,
        marks: &mut [Mark; 4],
    ) {
        let Placed {
            x, y, outer, inner, ..
        } = *placed;
        // Pixel i has its center at i + 1/2: those of an interval begin and end at its rounded ends. Clamped to the
        // picture, a sum with 2^23 has the rounded number in its low bits.
        let [width, height] = self.size;
        let round = |v: Vec4, most: f32| {
            let sum = v.max(Vec4::ZERO).min(Vec4::splat(most)) + 8_388_608.0;
            sum.to_array().map(|v| v.to_bits() & 0x7f_ffff)
        };
        let (left, right) = (round(x - outer, width), round(x + outer, width));
        let (top, bottom) = (round(y - outer, height), round(y + outer, height));
        let inner_x = (round(x - inner, width), round(x + inner, width));
        let inner_y = (round(y - inner, height), round(y + inner, height));
        for lane in 0..4 {
            if lanes >> lane & 1 == 0 {
                continue;
            }
            if placed.known >> lane & 1 == 0 {
                marks[lane] = Mark::SEEN;
                continue;
            }
            let columns = right[lane].saturating_sub(left[lane]);
            let rows = bottom[lane].saturating_sub(top[lane]);
            // Beside the picture, it has no pixels and is hidden.
            let mark = if columns * rows > MOST_PIXELS {
                Mark::SEEN
            } else {
                Mark {
                    first: top[lane] * self.nearest.width + left[lane],
                    columns: columns as u16,
                    rows: rows as u16,
                    distance: placed.asked[lane],
                }
            };
            if self.is_hidden(mark) {
                continue;
            }
            marks[lane] = mark;
            if !is_undrawn(lane as u32) {
                let own_columns = inner_x.0[lane]..inner_x.1[lane];
                let own_rows = inner_y.0[lane]..inner_y.1[lane];
                self.cover(own_columns, own_rows, placed.distance[lane]);
            }
        }
    }

    #[inline]
    fn is_hidden(&self, mark: Mark) -> bool {
        let is_nearer = |pixel: &AtomicU32| pixel.load(Ordering::Relaxed) < mark.distance;
        let mut first = mark.first as usize;
        if (mark.columns, mark.rows) == (1, 1) {
            return self.nearest.pixels.get(first).is_some_and(is_nearer);
        }
        for _ in 0..mark.rows {
            let row = self
                .nearest
                .pixels
                .get(first..first + mark.columns as usize);
            if !row.is_some_and(|row| row.iter().all(is_nearer)) {
                return false;
            }
            first += self.nearest.width as usize;
        }
        true
    }

    #[inline]
    fn cover(&self, columns: Range<u32>, rows: Range<u32>, distance: u32) {
        let own = columns.end.saturating_sub(columns.start);
        if own.saturating_mul(rows.end.saturating_sub(rows.start)) > MOST_PIXELS {
            return;
        }
        for y in rows {
            let start = (y * self.nearest.width + columns.start) as usize;
            let pixels = self.nearest.pixels.get(start..start + own as usize);
            for pixel in pixels.unwrap_or_default() {
                // Most lose, and an exchange costs more than a look.
                if distance < pixel.load(Ordering::Relaxed) {
                    pixel.fetch_min(distance, Ordering::Relaxed);
                }
            }
        }
    }

    /// Leaves `lanes` without what is hidden so far; what is not has a mark.
    #[inline]
    fn keep(
        &self,
        balls: &Balls,
        lanes: u8,
        is_undrawn: impl Fn(u32) -> bool,
        marks: &mut Vec<Mark>,
    ) -> u8 {
        if lanes == 0 || !self.asks_splats() {
            return lanes;
        }
        // Who is hidden cannot be foreseen: stores that are always made, instead of branches.
        let (mut found, mut count, mut kept) = ([Mark::HIDDEN; 5], 0, 0);
        for (lane, mark) in self.ask(balls, lanes, is_undrawn).into_iter().enumerate() {
            found[count] = mark;
            let is_seen = mark.rows != 0;
            count += usize::from(is_seen);
            kept |= u8::from(is_seen) << lane;
        }
        marks.extend_from_slice(found.get(..count).unwrap_or_default());
        kept
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
        let undrawn = &self.undrawn.nodes;
        let is_undrawn = |lane| Undrawn::has(undrawn, first.wrapping_add(lane));
        self.keep(&points(balls), lanes, is_undrawn, marks)
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
        let Footprints {
            large_leaves,
            is_cloud,
            ..
        } = self.footprints;
        let undrawn = &self.undrawn.leaves;
        let is_undrawn = |lane| Undrawn::has(undrawn, first.wrapping_add(lane));
        let (small, large) = (lanes & splats, lanes & !splats);
        // A small triangle has the constant size, a point of a cloud its own.
        let seen = if is_cloud {
            self.keep(balls, small, is_undrawn, &mut marks.leaves)
        } else {
            self.keep(&points(balls), small, is_undrawn, &mut marks.leaves)
        };
        if large_leaves {
            seen | self.keep(balls, large, is_undrawn, &mut marks.triangles)
        } else {
            seen | self.meets_centers(balls, large)
        }
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

#[cfg(test)]
mod tests;
