//! Supersampled references: the box-filtered mean of pictures with shifted sample positions.

use super::{Error, FloatImage, Image};
use crate::math::camera::View;

/// Units of the sums in a level: finer than single precision next to white.
const UNITS: f64 = (1u64 << 24) as f64;

/// Sums pictures of one size; the mean of all is the box-filtered picture when they were drawn through
/// [`jittered`] views. Values are those of [`Image::values`], or bytes where a picture has none.
///
/// The sums are integers in units of 2^-24 of a level of 255, so the order of the pictures does not matter, and bytes are
/// summed exactly.
#[derive(Debug, Clone, Default)]
pub struct PictureAccumulator {
    width: u32,
    height: u32,
    sum: Vec<[u64; 4]>,
    count: u32,
}

impl PictureAccumulator {
    /// An accumulator without pictures; the first one decides the size.
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of pictures so far.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Adds a picture's color and coverage; depth and normals have no useful mean and are ignored.
    ///
    /// # Errors
    /// [`Error::Size`] when the picture has another size than the first; the sums stay as they were.
    pub fn add(&mut self, image: &Image) -> Result<(), Error> {
        if self.count == 0 {
            (self.width, self.height) = (image.width, image.height);
            self.sum = vec![[0; 4]; image.color.len()];
        } else if (self.width, self.height) != (image.width, image.height) {
            return Err(Error::Size {
                first: [self.width, self.height],
                second: [image.width, image.height],
            });
        }
        // 2^32 pictures fit. Values are limited as an eight-bit target limits them; the cast takes NaN to 0.
        let units = |value: f32| (f64::from(value.clamp(0.0, 1.0)) * 255.0 * UNITS).round() as u64;
        for (i, (sum, byte)) in self.sum.iter_mut().zip(&image.color).enumerate() {
            let pixel = match image.values.get(i) {
                Some(values) => values.map(units),
                None => byte.map(|b| u64::from(b) * UNITS as u64),
            };
            for (s, v) in sum.iter_mut().zip(pixel) {
                *s += v;
            }
        }
        self.count += 1;
        Ok(())
    }

    /// Adds all pictures of another accumulator.
    ///
    /// # Errors
    /// [`Error::Size`] when its pictures have another size; the sums stay as they were.
    pub fn join(&mut self, other: &Self) -> Result<(), Error> {
        match (self.count, other.count) {
            (_, 0) => return Ok(()),
            (0, _) => *self = other.clone(),
            _ if (self.width, self.height) != (other.width, other.height) => {
                return Err(Error::Size {
                    first: [self.width, self.height],
                    second: [other.width, other.height],
                });
            }
            _ => {
                for (sum, more) in self.sum.iter_mut().zip(&other.sum) {
                    for (s, v) in sum.iter_mut().zip(more) {
                        *s += v;
                    }
                }
                self.count += other.count;
            }
        }
        Ok(())
    }

    /// The mean color and covered fraction; an empty picture when nothing was added.
    pub fn mean(&self) -> FloatImage {
        let scale = 255.0 * UNITS * f64::from(self.count.max(1));
        FloatImage {
            width: self.width,
            height: self.height,
            color: self
                .sum
                .iter()
                .map(|sum| sum.map(|s| (s as f64 / scale) as f32))
                .collect(),
            ..FloatImage::default()
        }
    }
}

/// Mean over the pixels that either picture covers of the largest difference of a color, 1 is white; 0 where none is.
pub fn mean_difference(one: &FloatImage, other: &FloatImage) -> f64 {
    let (mut sum, mut count) = (0.0, 0u64);
    for (a, b) in one.color.iter().zip(&other.color) {
        if a[3] > 0.0 || b[3] > 0.0 {
            sum += (0..3)
                .map(|i| f64::from((a[i] - b[i]).abs()))
                .fold(0.0, f64::max);
            count += 1;
        }
    }
    sum / count.max(1) as f64
}

/// The view whose pixel centers lie where sample `i` of a regular `k` x `k` grid lies in each pixel of `view`:
/// with a = i mod k and b = i / k, to the right of the center by (a + 1/2)/k - 1/2 pixels, and below it by
/// (b + 1/2)/k - 1/2. `i` counts modulo k², and k = 0 counts as 1 (the view itself).
pub fn jittered(view: &View, i: u32, k: u32) -> View {
    let k = k.max(1);
    let at = |n: u32| (f64::from(n) + 0.5) / f64::from(k) - 0.5;
    shifted(view, at(i % k), at(i / k % k))
}

/// Samples that [`evenly`] places in a pixel.
pub const EVEN_SAMPLES: u32 = 64;

/// The view whose pixel centers lie where sample `i` of [`EVEN_SAMPLES`] lies in each pixel of `view`: to the right of the center
/// by (h + 1/2)/64 - 1/2 pixels, and below it by (r + 1/2)/64 - 1/2 with r the six bits of h in reverse (Hammersley, 1960).
/// One lies in each of 64 columns, of 64 rows, and of 8 x 8 cells: an edge along an axis has 64 levels, where a grid gives it 8.
///
/// They are ordered so that the first 32 are as even, and so is each 16 from a multiple of 16 on: in 32 and 16 columns, rows and
/// cells. `i` counts modulo 64.
///
/// A sum of bits decides to which part h belongs: of all six to which half, of every other one to which quarter. Columns, rows
/// and cells fix all bits but one, or all but two that are neighbors, so that each part has one sample there.
pub fn evenly(view: &View, i: u32) -> View {
    let i = i % EVEN_SAMPLES;
    let [half, quarter] = [i >> 5, i >> 4 & 1];
    // The upper four bits of h; the lower two follow from the part.
    let upper = (i & 15) << 2;
    let sum = |bits: u32| bits.count_ones() & 1;
    let lowest = quarter ^ sum(upper & 0b01_0101);
    let h = upper | (half ^ sum(upper) ^ lowest) << 1 | lowest;
    let reversed = h.reverse_bits() >> 26;
    let at = |n: u32| (f64::from(n) + 0.5) / f64::from(EVEN_SAMPLES) - 0.5;
    shifted(view, at(h), at(reversed))
}

/// The samples of [`evenly`] in an order in which those that are shown first are even as well: each four from a multiple of four
/// on lie in four columns, four rows and 2 x 2 cells. Quarters are those of [`evenly`]. `n` counts modulo 64.
pub fn evenly_by_fours(view: &View, n: u32) -> View {
    let within = (n & 3) << 2 | n >> 2 & 3;
    evenly(view, n & !15 | within)
}

/// As [`jittered`] with the sample anywhere in its cell of the grid instead of its middle: jittered (stratified) sampling
/// (Cook, 1986), which turns the aliasing of a regular grid into noise. The places are pseudo-random and the same in
/// every run.
pub fn stratified(view: &View, i: u32, k: u32) -> View {
    let k = k.max(1);
    let i = i % (k * k);
    let at = |n: u32, axis: u64| {
        // The finalizer of splitmix64 (Steele and others, 2014) on the number of the sample.
        let mut z = (u64::from(i) * 2 + axis + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let random = ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64;
        (f64::from(n) + random) / f64::from(k) - 0.5
    };
    shifted(view, at(i % k, 0), at(i / k, 1))
}

/// The view whose pixel centers lie `right_px` to the right of and `down_px` below those of `view`.
pub fn shifted(view: &View, right_px: f64, down_px: f64) -> View {
    // Samples move right and down when the picture moves left and up: x_ndc by -2 right / W, y_ndc (up) by
    // +2 down / H. A perspective adds offset * z / -z = -offset, so there the signs turn around.
    let sign = if view.is_perspective { -1.0 } else { 1.0 };
    let mut shifted = *view;
    shifted.offset[0] -= (sign * 2.0 * right_px / f64::from(view.width.max(1))) as f32;
    shifted.offset[1] += (sign * 2.0 * down_px / f64::from(view.height.max(1))) as f32;
    shifted
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::math::camera::Camera;
    use glam::{DVec3, Vec3};

    #[test]
    fn even_samples_and_their_parts_lie_in_each_column_row_and_cell() {
        let size = (64, 48);
        let eye = DVec3::new(0.0, 0.0, 4.0);
        let camera = Camera::look_at(size, eye, DVec3::ZERO, DVec3::Y, 0.8, [1.0, 9.0]);
        let view = camera.view(DVec3::ZERO).unwrap();
        let (x, y, _) = view.project(Vec3::ZERO);
        let place_in = |view: View| {
            let (sx, sy, _) = view.project(Vec3::ZERO);
            [x - sx, y - sy].map(|off| ((off + 0.5) * 64.0) as usize)
        };
        let place = |i: u32| place_in(evenly(&view, i));
        let by_fours = |n: u32| place_in(evenly_by_fours(&view, n));
        let parts = [0..64, 0..32, 32..64, 0..16, 16..32, 32..48, 48..64];
        let fours = (0..16).map(|n| 4 * n..4 * n + 4);
        for (part, is_by_fours) in (parts.iter().map(|part| (part.clone(), false)))
            .chain(parts.iter().cloned().chain(fours).map(|part| (part, true)))
        {
            let own = part.clone().map(|i| match is_by_fours {
                true => by_fours(i),
                false => place(i),
            });
            let places: Vec<[usize; 2]> = own.collect();
            // As many boxes as samples, of any shape, from columns over cells to rows.
            let bits = places.len().ilog2() as usize;
            for across in 0..=bits {
                let boxes = places.iter().map(|[x, y]| {
                    let down = bits - across;
                    [x >> (6 - across), y >> (6 - down)]
                });
                let boxes: std::collections::BTreeSet<[usize; 2]> = boxes.collect();
                assert_eq!(boxes.len(), places.len(), "{part:?}, 2^{across} columns");
            }
        }
        assert_eq!((place(64), by_fours(64)), (place(0), by_fours(0)));
    }

    #[test]
    fn jitter_moves_projected_points_by_the_sample_offset() {
        let camera = Camera::look_at(
            (640, 360),
            DVec3::new(0.3, 0.2, 4.0),
            DVec3::ZERO,
            DVec3::Y,
            0.8,
            [1.0, 9.0],
        );
        let perspective = camera.view(DVec3::ZERO).unwrap();
        let mut orthographic = perspective;
        orthographic.is_perspective = false;
        orthographic.offset = [0.1, -0.2];
        for view in [perspective, orthographic] {
            for k in [1, 2, 3, 4] {
                for i in 0..k * k {
                    let shifted = jittered(&view, i, k);
                    for point in [
                        Vec3::ZERO,
                        Vec3::new(0.4, -0.3, 0.9),
                        Vec3::new(-0.8, 0.5, -2.0),
                    ] {
                        let (x, y, z) = view.project(point);
                        let (sx, sy, sz) = shifted.project(point);
                        // A sample to the right of the center sees the point further left.
                        let right = ((i % k) as f32 + 0.5) / k as f32 - 0.5;
                        let down = ((i / k) as f32 + 0.5) / k as f32 - 0.5;
                        assert!((x - sx - right).abs() < 1e-3, "{i} of {k}: {x} {sx}");
                        assert!((y - sy - down).abs() < 1e-3, "{i} of {k}: {y} {sy}");
                        assert_eq!(z, sz);
                        // The device's matrix moves alike.
                        let v = view.view_from_model.transform_point3(point);
                        let clip = shifted.clip_from_view() * v.extend(1.0);
                        assert!(((clip.x / clip.w + 1.0) / 2.0 * 640.0 - sx).abs() < 1e-3);
                        assert!(((clip.y / clip.w + 1.0) / 2.0 * 360.0 - sy).abs() < 1e-3);
                    }
                }
            }
        }
    }

    #[test]
    fn stratified_samples_lie_in_their_cells_and_are_not_regular() {
        let camera = Camera::look_at(
            (500, 500),
            DVec3::new(0.0, 0.0, 4.0),
            DVec3::ZERO,
            DVec3::Y,
            0.8,
            [1.0, 9.0],
        );
        let view = camera.view(DVec3::ZERO).unwrap();
        let k = 8;
        let (x, y, _) = view.project(Vec3::ZERO);
        let mut offsets = Vec::new();
        for i in 0..k * k {
            let (sx, sy, _) = stratified(&view, i, k).project(Vec3::ZERO);
            let (right, down) = (x - sx + 0.5, y - sy + 0.5);
            // A part of a thousandth of a pixel is rounding of the projection.
            let cell = |n: u32| (n as f32 / 8.0 - 1e-3)..=((n + 1) as f32 / 8.0 + 1e-3);
            assert!(cell(i % k).contains(&right) && cell(i / k).contains(&down));
            offsets.push((right * 8.0).fract());
        }
        let mean = offsets.iter().sum::<f32>() / 64.0;
        let spread = offsets.iter().map(|o| (o - mean).powi(2)).sum::<f32>() / 64.0;
        // Uniform over the cell: a variance of 1/12.
        assert!((0.04..0.13).contains(&spread), "{spread}");
    }

    #[test]
    fn the_mean_is_exact_and_sizes_are_checked() {
        let mut sum = PictureAccumulator::new();
        assert_eq!(sum.mean(), FloatImage::default());
        sum.add(&Image::filled(2, 1, [255, 0, 10, 255])).unwrap();
        sum.add(&Image::filled(2, 1, [0, 0, 20, 0])).unwrap();
        assert_eq!(sum.mean().color, vec![[0.5, 0.0, 15.0 / 255.0, 0.5]; 2]);
        assert!(matches!(
            sum.add(&Image::filled(1, 2, [0; 4])),
            Err(Error::Size {
                first: [2, 1],
                second: [1, 2]
            })
        ));
        assert_eq!(sum.count(), 2);
    }

    #[test]
    fn what_lies_between_two_levels_stays_there() {
        // Tenths of levels, and what a target of floats may hold but a picture may not.
        let of = |values: [f32; 4]| Image {
            values: vec![values],
            ..Image::filled(1, 1, [1, 1, 0, 255])
        };
        let level = |l: f64| (l / 255.0) as f32;
        let mut sum = PictureAccumulator::new();
        sum.add(&of([level(80.7), level(0.1), -3.0, f32::NAN]))
            .unwrap();
        sum.add(&of([level(80.9), level(0.3), 7.0, 1.0])).unwrap();
        let [r, g, b, a] = sum.mean().color[0].map(|v| f64::from(v) * 255.0);
        assert!((r - 80.8).abs() < 1e-5 && (g - 0.2).abs() < 1e-5, "{r} {g}");
        assert_eq!([b, a], [127.5; 2]);
        // In the other order to the bit.
        let mut other = PictureAccumulator::new();
        other.add(&of([level(80.9), level(0.3), 7.0, 1.0])).unwrap();
        other
            .add(&of([level(80.7), level(0.1), -3.0, f32::NAN]))
            .unwrap();
        assert_eq!(other.mean(), sum.mean());
    }
}
