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

mod filter_lists;
pub(crate) mod footprints;
mod nodes;
pub(crate) mod pixel_centers;
pub(super) mod shared;
mod splat_batch;

pub(super) use crate::cut::occlusion::splat_batch::{CHUNK, SplatChunk};

use crate::cut::frustum_and_size::NodeTester;
use crate::cut::occlusion::footprints::{SplatFootprints, ZeroAreaSet};
use crate::cut::occlusion::pixel_centers::{POSITION_ERROR, PixelCenters};
use crate::math::camera::View;
use crate::simd::FloatLanes;
use glam::Vec4;
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
pub(super) struct SoftwareDepthBuffer {
    width: u32,
    height: u32,
    pixels: Vec<AtomicU32>,
}

impl SoftwareDepthBuffer {
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

    /// The same where nothing is asked for that others may hide: it has no pixels, so that a small model does not cost as much
    /// as the whole picture.
    pub(super) fn clear_unasked(&mut self, width: u32, height: u32) -> bool {
        self.pixels.clear();
        (self.width, self.height) = (width, height);
        width < 1 << 16 && height < 1 << 16
    }
}

/// What is asked of [`SoftwareDepthBuffer`] for a node or leaf: whether these pixels all have something nearer than this.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct DepthMark {
    first: u32,
    /// The splat's, as [`SoftwareDepthBuffer`] has it, less the error of both sides.
    asked: u32,
    /// Of one pixel the splat's, where it may have been stored over by another thread ([`OcclusionTest::repair`]), else [`NOTHING`]. Of
    /// others, which cover none surely, how many there are: see [`DepthMark::of`].
    distance: u32,
}

impl DepthMark {
    /// No distance has it: they are not negative.
    const IS_COUNT: u32 = 1 << 31;
    /// Hidden for good: it has no pixels.
    const HIDDEN: Self = Self {
        first: 0,
        asked: 0,
        distance: Self::IS_COUNT,
    };
    /// Never hidden.
    const SEEN: Self = Self {
        first: 0,
        asked: 0,
        distance: NOTHING,
    };

    /// Mark of some columns and rows, at most [`MOST_PIXELS`] pixels.
    fn of(first: u32, [columns, rows]: [u32; 2], asked: u32) -> Self {
        match columns * rows {
            0 => Self::HIDDEN,
            1..=MOST_PIXELS => Self {
                first,
                asked,
                distance: Self::IS_COUNT | columns << 16 | rows,
            },
            _ => Self::SEEN,
        }
    }

    /// Columns and rows.
    fn size(self) -> [u32; 2] {
        match self.distance & Self::IS_COUNT {
            0 => [1, 1],
            _ => [self.distance >> 16 & 0x7fff, self.distance & 0xffff],
        }
    }
}
const _: () = assert!(MOST_PIXELS < 1 << 15);

/// Marks beside the lists of a cut.
#[derive(Debug, Default)]
pub(super) struct DepthMarks {
    pub(super) nodes: Vec<DepthMark>,
    /// One for each splat of each row that is seen so far.
    pub(super) strips: Vec<DepthMark>,
    pub(super) leaves: Vec<DepthMark>,
    pub(super) triangles: Vec<DepthMark>,
}

impl DepthMarks {
    pub(super) fn clear(&mut self) {
        self.nodes.clear();
        self.strips.clear();
        self.leaves.clear();
        self.triangles.clear();
    }
}

/// The questions of one frame.
#[derive(Debug)]
pub(super) struct OcclusionTest<'a> {
    nearest: &'a SoftwareDepthBuffer,
    footprints: SplatFootprints,
    undrawn: &'a ZeroAreaSet,
    pub(super) centers: PixelCenters,
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
    /// Splats are pixels. Some of them may be two, and surely cover neither.
    are_pixels: bool,
    /// Nodes are looked for that lie behind others, and parts of the cut done from front to back.
    drops_nodes: bool,
}

/// Splats in the picture.
#[derive(Clone, Copy)]
struct PlacedFootprint<V: FloatLanes> {
    /// Pixels.
    x: V,
    y: V,
    /// Half of what a splat may cover and surely covers, pixels.
    outer: V,
    inner: V,
    /// What contains no center within this distance of its own, pixels, is nothing.
    reach: V,
    /// Lanes that the clip volume takes nothing away of: else nothing is covered surely. Not what is no number.
    known: V::Mask,
    /// From the near plane; and less the error of both sides.
    distance: V,
    asked: V,
}

impl<'a> OcclusionTest<'a> {
    pub(super) fn new(
        nearest: &'a SoftwareDepthBuffer,
        tester: &NodeTester,
        view: &View,
        (footprints, undrawn): (SplatFootprints, &'a ZeroAreaSet),
        subpixel_bits: u32,
    ) -> Self {
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
        let are_pixels = side <= 1.0 && !footprints.large_leaves && !footprints.is_cloud;
        let (inner_px, outer_px) = if side < 1.0 || are_pixels {
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
        let centers = PixelCenters::new(tester, view, side, subpixel_bits);
        let position_error = POSITION_ERROR * tester.extent;
        Self {
            nearest,
            footprints,
            undrawn,
            centers,
            size: [nearest.width as f32, nearest.height as f32],
            near,
            far,
            is_perspective: view.is_perspective,
            // Of the one that is nearer and of the other.
            distance_error: 2.0 * position_error,
            depth_error,
            inner_px,
            outer_px,
            are_pixels,
            // Where rears are dropped what is left is mostly seen.
            drops_nodes: are_pixels && footprints.hides && tester.keeps_rears,
        }
    }

    /// Tells whether any node is not drawn.
    pub(super) fn has_undrawn_nodes(&self) -> bool {
        !self.undrawn.nodes.is_empty()
    }

    /// Tells whether any leaf is not drawn.
    pub(super) fn has_undrawn_leaves(&self) -> bool {
        !self.undrawn.leaves.is_empty()
    }

    /// Which of the four nodes from `first` on are not drawn.
    #[inline]
    pub(super) fn undrawn_nodes(&self, first: u32) -> u8 {
        ZeroAreaSet::four(&self.undrawn.nodes, first)
    }

    /// The same for leaves.
    #[inline]
    pub(super) fn undrawn_leaves(&self, first: u32) -> u8 {
        ZeroAreaSet::four(&self.undrawn.leaves, first)
    }

    /// Tells whether small leaves have sizes of their own, as points do, and whether large ones are splats.
    pub(super) fn of_leaves(&self) -> (bool, bool) {
        (self.footprints.is_cloud, self.footprints.large_leaves)
    }

    /// Of splats: how far they are along the axes of the picture and the view direction, and their own radii; of samples
    /// those of their balls.
    #[inline(always)]
    fn placed<V: FloatLanes>(&self, [x, y, z, radius]: [V; 4]) -> PlacedFootprint<V> {
        let ([x, y], inverse, off, error) = if self.is_perspective {
            let inverse = x.all(1.0) / z;
            (
                [x * inverse, y * inverse],
                inverse,
                inverse * self.centers.place_error,
                z * z * self.depth_error + self.distance_error,
            )
        } else {
            (
                [x, y],
                x.all(1.0),
                x.all(self.centers.place_error),
                x.all(self.depth_error + self.distance_error),
            )
        };
        let off = off + self.centers.snap_px;
        let least = x.all(self.outer_px);
        let (outer, reach) = if self.is_exact() {
            let reach = self.centers.reach([x, y], radius * inverse, off);
            (least, reach)
        } else {
            // By how much pixels are off, and half of what a splat of the ball's size is drawn as.
            let own = radius * (1.001 * self.centers.focal_px()) * inverse;
            // What is smaller than a pixel is drawn as one pixel or none, of any other the device may round the size.
            let rounded = if self.is_sampled() {
                V::choose(own.lt(x.all(0.5)), own, own + 0.5)
            } else {
                own + 0.5
            };
            (rounded.max(least), x.all(f32::INFINITY))
        };
        let distance = z - self.near;
        PlacedFootprint {
            x: x * self.centers.focal[0] + self.centers.middle[0],
            y: y * self.centers.focal[1] + self.centers.middle[1],
            outer: outer + off,
            inner: x.all(self.inner_px) - off,
            reach,
            known: z.gt(error + self.near) & z.lt(x.all(self.far) - error),
            distance,
            asked: if self.footprints.hides {
                (distance - error).max(x.all(0.0))
            } else {
                x.all(0.0)
            },
        }
    }

    /// Tells whether anything is dropped of splats.
    #[inline(always)]
    pub(super) fn asks_splats(&self) -> bool {
        self.footprints.hides || self.is_sampled()
    }

    /// Tells whether splats are smaller than a pixel.
    #[inline(always)]
    fn is_sampled(&self) -> bool {
        self.outer_px < 0.5 || self.are_pixels
    }

    /// Tells whether all that is below a node is drawn where it contains a pixel's center: triangles, and splats that are one
    /// pixel at most. Then what lies in a ball between centers is nothing.
    #[inline(always)]
    pub(super) fn is_exact(&self) -> bool {
        self.are_pixels
    }

    /// Tells whether nodes are looked for that lie behind others ([`are_behind`](Self::are_behind)).
    #[inline(always)]
    pub(super) fn drops_nodes(&self) -> bool {
        self.drops_nodes
    }

    /// The marks of squares of any size and place. What is not hidden so far leaves its depth in what it surely covers, but
    /// for those in `undrawn`.
    fn ask_squares(
        &self,
        placed: &PlacedFootprint<Vec4>,
        lanes: u8,
        undrawn: u8,
    ) -> [DepthMark; 4] {
        let mut marks = [DepthMark::HIDDEN; 4];
        let PlacedFootprint {
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
                marks[lane] = DepthMark::SEEN;
                continue;
            }
            let columns = right[lane].saturating_sub(left[lane]);
            let rows = bottom[lane].saturating_sub(top[lane]);
            // Beside the picture, it has no pixels and is hidden.
            let first = top[lane] * self.nearest.width + left[lane];
            let mark = DepthMark::of(first, [columns, rows], asked[lane]);
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

    /// Tells whether all pixels of a mark have something nearer.
    #[inline(always)]
    fn is_hidden(&self, mark: DepthMark) -> bool {
        if mark.distance & DepthMark::IS_COUNT != 0 {
            return self.are_all_nearer(mark);
        }
        let pixel = self.nearest.pixels.get(mark.first as usize);
        pixel.map_or(NOTHING, |pixel| pixel.load(Ordering::Relaxed)) < mark.asked
    }

    /// The same of any number of pixels.
    #[inline(never)]
    fn are_all_nearer(&self, mark: DepthMark) -> bool {
        let is_nearer = |pixel: &AtomicU32| pixel.load(Ordering::Relaxed) < mark.asked;
        let [columns, rows] = mark.size().map(|count| count as usize);
        let mut first = mark.first as usize;
        for _ in 0..rows {
            let row = self.nearest.pixels.get(first..first + columns);
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
