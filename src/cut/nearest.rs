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

mod chunk;
mod lists;

pub(super) use chunk::{CHUNK, Chunk};

use super::footprints::{Footprints, Undrawn};
use super::quad::Balls;
use super::tester::Tester;
use crate::math::camera::View;
use glam::{BVec4A, Vec3, Vec4};
use std::ops::{Range, RangeInclusive};
use std::sync::atomic::{AtomicU32, Ordering};

/// Binary places of window positions that every device has, and as many as compute rounds them to.
pub(super) const SUBPIXEL_BITS: RangeInclusive<u32> = 4..=8;
/// What covers more pixels than this is not asked for.
const MOST_PIXELS: u32 = 1024;
/// Nothing is nearer.
const NOTHING: u32 = f32::INFINITY.to_bits();
/// A circle of this radius, pixels, contains the center of one wherever it lies.
const LARGEST_BETWEEN_PX: f32 = std::f32::consts::FRAC_1_SQRT_2;
/// How far off a coordinate of a splat may be, over the sum of the terms that it is made of, on the device and here
/// together. On either side numbers of the matrix are rounded, and their products and sums: at most ten times, or twelve
/// where a device places points in two steps, by 2^-24 each.
const POSITION_ERROR: f32 = 24.0 / 16_777_216.0;

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
        // One more, which stands for pixels that are not known.
        let count = width as usize * height as usize + 1;
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
    /// The splat's, as [`Nearest`] has it, less the error of both sides.
    asked: u32,
    /// The splat's, where it may have been stored over by another thread ([`Hiding::repair`]); else [`NOTHING`].
    distance: u32,
}

impl Mark {
    /// Hidden for good: it has no pixels.
    const HIDDEN: Self = Self {
        first: 0,
        columns: 0,
        rows: 0,
        asked: 0,
        distance: NOTHING,
    };
    /// Never hidden.
    const SEEN: Self = Self {
        first: 0,
        columns: 1,
        rows: 1,
        asked: 0,
        distance: NOTHING,
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
    /// Pixels that a place may be off, times the distance (perspective) or alone.
    place_error: f32,
    /// Error of a distance; and what a depth that is rounded is off, as a distance: the factor of z² (perspective) or
    /// alone.
    distance_error: f32,
    depth_error: f32,
    /// Half the side of what a splat surely covers, and of what it may.
    inner_px: f32,
    outer_px: f32,
    /// Pixels by which a device may place a splat elsewhere by rounding.
    snap_px: f32,
    /// Splats are pixels. Some of them may be two, and surely cover neither.
    are_pixels: bool,
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
    known: BVec4A,
    /// From the near plane; and less the error of both sides.
    distance: Vec4,
    asked: Vec4,
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
        let focal = [
            view.scale[0] * half[0] * unit,
            -view.scale[1] * half[1] * unit,
        ];
        let middle = [
            half[0] * (1.0 + sign * view.offset[0]),
            half[1] * (1.0 - sign * view.offset[1]),
        ];
        // A coordinate in view space is the product of a unit vector and a position, and the place of the model's zero;
        // one in the window those of a vector as long as focal length and middle together, over a distance that is off
        // as well, or (orthographic) those of one as long as the focal length.
        let position_error = POSITION_ERROR * tester.extent;
        let place = |i: usize| {
            if view.is_perspective {
                focal[i].hypot(middle[i]) + 2.0 * half[i]
            } else {
                focal[i].abs()
            }
        };
        Self {
            nearest,
            footprints,
            undrawn,
            axes: [axis(0), axis(1)],
            focal,
            middle,
            size: [nearest.width as f32, nearest.height as f32],
            near,
            far,
            is_perspective: view.is_perspective,
            place_error: position_error * place(0).max(place(1)),
            // Of the one that is nearer and of the other.
            distance_error: 2.0 * position_error,
            depth_error,
            inner_px,
            outer_px,
            // Half a step, and the roundings of positions in single precision.
            snap_px: 0.5_f32.powi(1 + subpixel_bits as i32)
                + 1e-6 * nearest.width.max(nearest.height) as f32,
            are_pixels: side <= 1.0 && !footprints.large_leaves && !footprints.is_cloud,
        }
    }

    /// How far four centers are along the axes of the picture, in the tester's unit.
    #[inline]
    pub(super) fn along(&self, [x, y, z]: [Vec4; 3]) -> [Vec4; 2] {
        self.axes
            .map(|([a, b, c], start)| a * x + b * y + c * z + start)
    }

    /// How far four ways go along the axes of the picture.
    #[inline]
    pub(super) fn way_along(&self, [x, y, z]: [Vec4; 3]) -> [Vec4; 2] {
        self.axes.map(|([a, b, c], _)| a * x + b * y + c * z)
    }

    /// Whether any node is not drawn.
    pub(super) fn has_undrawn_nodes(&self) -> bool {
        !self.undrawn.nodes.is_empty()
    }

    /// Which of the four nodes from `first` on are not drawn.
    #[inline]
    pub(super) fn undrawn_nodes(&self, first: u32) -> u8 {
        Undrawn::four(&self.undrawn.nodes, first)
    }

    /// The same for leaves.
    #[inline]
    pub(super) fn undrawn_leaves(&self, first: u32) -> u8 {
        Undrawn::four(&self.undrawn.leaves, first)
    }

    /// Whether small leaves have sizes of their own, as points do, and whether large ones are splats.
    pub(super) fn of_leaves(&self) -> (bool, bool) {
        (self.footprints.is_cloud, self.footprints.large_leaves)
    }

    /// Of four splats: how far they are along the axes of the picture and the view direction, and their own radii.
    #[inline]
    fn placed(&self, [x, y, z, radius]: [Vec4; 4]) -> Placed {
        // By how much pixels are off, and half of what a splat of the ball's size is drawn as.
        let own = radius * (1.001 * self.focal[0].abs().max(self.focal[1].abs()));
        let ([x, y], off, own, error) = if self.is_perspective {
            let inverse = Vec4::ONE / z;
            (
                [x * inverse, y * inverse],
                inverse * self.place_error,
                own * inverse,
                z * z * self.depth_error + self.distance_error,
            )
        } else {
            (
                [x, y],
                Vec4::splat(self.place_error),
                own,
                Vec4::splat(self.depth_error + self.distance_error),
            )
        };
        let off = off + self.snap_px;
        // What is smaller than a pixel is drawn as one pixel or none, of any other the device may round the size.
        let rounded = if self.is_sampled() {
            Vec4::select(own.cmplt(Vec4::splat(0.5)), own, own + 0.5)
        } else {
            own + 0.5
        };
        let distance = z - self.near;
        Placed {
            x: x * self.focal[0] + self.middle[0],
            y: y * self.focal[1] + self.middle[1],
            outer: rounded.max(Vec4::splat(self.outer_px)) + off,
            inner: Vec4::splat(self.inner_px) - off,
            known: z.cmpgt(Vec4::splat(self.near) + error) & z.cmplt(Vec4::splat(self.far) - error),
            distance,
            asked: if self.footprints.hides {
                (distance - error).max(Vec4::ZERO)
            } else {
                Vec4::ZERO
            },
        }
    }

    /// Whether anything is dropped of splats.
    #[inline]
    pub(super) fn asks_splats(&self) -> bool {
        self.footprints.hides || self.is_sampled()
    }

    /// Whether splats are smaller than a pixel.
    #[inline]
    fn is_sampled(&self) -> bool {
        self.outer_px < 0.5
    }

    /// Whether all that is below a node is drawn where it contains a pixel's center: triangles, and splats smaller than a
    /// pixel. Then what lies in a ball between centers is nothing.
    #[inline]
    pub(super) fn is_exact(&self) -> bool {
        self.is_sampled() && !self.footprints.large_leaves
    }

    /// Which of four balls may contain the center of a pixel. Of triangles between them no device draws anything.
    #[inline]
    pub(super) fn meets_centers(&self, balls: &Balls) -> u8 {
        let focal = self.focal[0].abs().max(self.focal[1].abs());
        // None is between centers that is larger than this: not worth the rest.
        let widest = if self.is_perspective {
            balls.depth * (LARGEST_BETWEEN_PX / focal)
        } else {
            Vec4::splat(LARGEST_BETWEEN_PX / focal)
        };
        if balls.radius.cmpgt(widest).all() {
            return 15;
        }
        let [x, y] = self.along(balls.center);
        let ([x, y], scale, off, stretch, is_known) = if self.is_perspective {
            let inverse = Vec4::ONE / balls.depth;
            let (x, y) = (x * inverse, y * inverse);
            let aside = x.abs().max(y.abs());
            // A ball of radius r at a distance of 1 reaches r sqrt(1 + a²) / (1 - r²) to the side, from a middle that is
            // a r² / (1 - r²) farther off; so near that r matters here, nothing is dropped.
            let is_small = (balls.radius * inverse).cmplt(Vec4::splat(0.01));
            let stretch = 1.001 + 0.01 * aside + 0.5 * aside * aside;
            let off = inverse * self.place_error;
            ([x, y], inverse * focal, off, stretch, is_small)
        } else {
            let every = Vec4::ONE.cmpeq(Vec4::ONE);
            let off = Vec4::splat(self.place_error);
            ([x, y], Vec4::splat(focal), off, Vec4::splat(1.001), every)
        };
        let to_center = |v: Vec4| (v - v.floor() - 0.5).abs();
        let x = to_center(x * self.focal[0] + self.middle[0]);
        let y = to_center(y * self.focal[1] + self.middle[1]);
        // Corners are moved by rounding in both directions.
        let off = (off + self.snap_px) * std::f32::consts::SQRT_2;
        let reach = balls.radius * scale * stretch + off;
        let misses = (x * x + y * y).cmpgt(reach * reach)
            & is_known
            & balls.depth.cmpgt(Vec4::splat(self.near));
        !(misses.bitmask() as u8) & 15
    }

    /// The marks of squares of any size and place. What is not hidden so far leaves its depth in what it surely covers, but
    /// for those in `undrawn`.
    fn ask_squares(&self, placed: &Placed, lanes: u8, undrawn: u8) -> [Mark; 4] {
        let mut marks = [Mark::HIDDEN; 4];
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
        let known = placed.known.bitmask();
        let bits = |v: Vec4| v.to_array().map(f32::to_bits);
        let (distances, asked) = (bits(placed.distance), bits(placed.asked));
        let (left, right) = (round(x - outer, width), round(x + outer, width));
        let (top, bottom) = (round(y - outer, height), round(y + outer, height));
        let inner_x = (round(x - inner, width), round(x + inner, width));
        let inner_y = (round(y - inner, height), round(y + inner, height));
        for lane in 0..4 {
            if lanes >> lane & 1 == 0 {
                continue;
            }
            if known >> lane & 1 == 0 {
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
                    asked: asked[lane],
                    distance: NOTHING,
                }
            };
            if self.is_hidden(mark) {
                continue;
            }
            marks[lane] = mark;
            if undrawn >> lane & 1 == 0 {
                let own_columns = inner_x.0[lane]..inner_x.1[lane];
                let own_rows = inner_y.0[lane]..inner_y.1[lane];
                self.cover(own_columns, own_rows, distances[lane]);
            }
        }
        marks
    }

    #[inline]
    fn is_hidden(&self, mark: Mark) -> bool {
        let is_nearer = |pixel: &AtomicU32| pixel.load(Ordering::Relaxed) < mark.asked;
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
}

#[cfg(test)]
mod tests;
