//! One size of an image.

use super::WrapMode;
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

/// Rows that one task makes.
const ROWS: usize = 16;

/// One size of an image: rows of texels from the top.
#[derive(Clone, PartialEq, Eq)]
pub struct TextureLevel {
    width: u32,
    height: u32,
    /// Red, green, blue, 255.
    texels: Vec<[u8; 4]>,
}

impl std::fmt::Debug for TextureLevel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "TextureLevel({} x {})", self.width, self.height)
    }
}

impl TextureLevel {
    /// Texels row by row from the top; `None` unless there are width times height of them, and at least one.
    pub fn new(width: u32, height: u32, texels: Vec<[u8; 4]>) -> Option<Self> {
        let count = u64::from(width) * u64::from(height);
        (count > 0 && texels.len() as u64 == count).then_some(Self {
            width,
            height,
            texels,
        })
    }

    /// Width, texels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height, texels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Red, green, blue and 255, row by row from the top.
    pub fn texels(&self) -> &[[u8; 4]] {
        &self.texels
    }

    /// Changes every texel.
    pub fn map(&mut self, change: impl Fn([u8; 4]) -> [u8; 4] + Sync) {
        let texels = self.texels.par_iter_mut().with_min_len(1 << 14);
        texels.for_each(|texel| *texel = change(*texel));
    }

    /// The image at half the size, rounded down: each texel is the mean of what it covers. `None` of a single texel.
    pub fn halved(&self) -> Option<Self> {
        if self.width == 1 && self.height == 1 {
            return None;
        }
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let are_even = self.width == 2 * width && self.height == 2 * height;
        let columns = AxisTaps::of(self.width, width);
        let rows = AxisTaps::of(self.height, height);
        let mut texels = vec![[0; 4]; width as usize * height as usize];
        let stride = self.width as usize;
        texels
            .par_chunks_mut(ROWS * width as usize)
            .enumerate()
            .for_each(|(piece, out)| {
                for (row, out) in out.chunks_mut(width as usize).enumerate() {
                    let y = piece * ROWS + row;
                    if are_even {
                        let [upper, lower] =
                            [2 * y, 2 * y + 1].map(|y| &self.texels[y * stride..][..stride]);
                        let pairs = upper.chunks_exact(2).zip(lower.chunks_exact(2));
                        for (out, (upper, lower)) in out.iter_mut().zip(pairs) {
                            *out = mean_of_four([upper[0], upper[1], lower[0], lower[1]]);
                        }
                    } else {
                        for (x, out) in out.iter_mut().enumerate() {
                            *out = self.weighted(&columns[x], &rows[y]);
                        }
                    }
                }
            });
        Self::new(width, height, texels)
    }

    fn weighted(&self, column: &AxisTaps, row: &AxisTaps) -> [u8; 4] {
        let mut sum = [0.0_f32; 4];
        for (y, &down) in (row.first..).zip(&row.weights) {
            for (x, &right) in (column.first..).zip(&column.weights) {
                let weight = down * right;
                if weight > 0.0 {
                    let texel = self.texels[y * self.width as usize + x];
                    for (sum, value) in sum.iter_mut().zip(texel) {
                        *sum += weight * f32::from(value);
                    }
                }
            }
        }
        sum.map(|value| value.round_ties_even() as u8)
    }

    /// The four texels around a coordinate within 0..=1, and where it is between them. Beyond the border is what `wrap` says.
    #[inline(always)]
    pub(super) fn taps(&self, at: Vec2, wrap: [WrapMode; 2]) -> LevelTaps {
        let (columns, right) = neighbors(at.x, self.width, wrap[0]);
        let (rows, down) = neighbors(at.y, self.height, wrap[1]);
        let width = self.width as usize;
        let [upper, lower] = [
            &self.texels[rows[0] * width..],
            &self.texels[rows[1] * width..],
        ];
        LevelTaps {
            texels: [
                upper[columns[0]],
                upper[columns[1]],
                lower[columns[0]],
                lower[columns[1]],
            ],
            right,
            down,
        }
    }
}

/// Four texels of a level around a place.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LevelTaps {
    /// Upper left, upper right, lower left, lower right.
    pub(crate) texels: [[u8; 4]; 4],
    /// Part of the way from the left to the right ones, 0 to 1.
    pub(crate) right: f32,
    /// Part of the way from the upper to the lower ones, 0 to 1.
    pub(crate) down: f32,
}

impl LevelTaps {
    /// Red, green and blue of all four by their distances, 1 is white.
    #[inline(always)]
    pub(crate) fn color(&self) -> Vec3 {
        let [a, b, c, d] = self.texels;
        let upper = values(a).lerp(values(b), self.right);
        let lower = values(c).lerp(values(d), self.right);
        (upper.lerp(lower, self.down) * (1.0 / 255.0)).truncate()
    }
}

/// A texel as numbers: all four channels, since a vector of four takes what one number takes.
#[inline(always)]
fn values([red, green, blue, last]: [u8; 4]) -> Vec4 {
    Vec4::new(red.into(), green.into(), blue.into(), last.into())
}

/// The two texels whose centers are around a coordinate within 0..=1, and how far it is from the first to the second.
#[inline(always)]
fn neighbors(coordinate: f32, count: u32, wrap: WrapMode) -> ([usize; 2], f32) {
    let place = coordinate * count as f32 - 0.5;
    // The first is -1 at least. A whole number cut off is quicker than `floor`, a call where the processor has no such word.
    let second = (place + 1.0) as usize;
    let part = (place - (second as f32 - 1.0)).max(0.0);
    let last = count as usize - 1;
    let beyond = match wrap {
        WrapMode::Repeat => [last, 0],
        WrapMode::Mirror | WrapMode::Clamp => [0, last],
    };
    let first = if second == 0 {
        beyond[0]
    } else {
        (second - 1).min(last)
    };
    let second = if second > last { beyond[1] } else { second };
    ([first, second], part)
}

/// Mean of four, halves to the even: no mean grows by being taken again and again.
#[inline]
fn mean_of_four(texels: [[u8; 4]; 4]) -> [u8; 4] {
    let [a, b, c, d] = texels;
    [0, 1, 2, 3].map(|i: usize| {
        let sum = u16::from(a[i]) + u16::from(b[i]) + u16::from(c[i]) + u16::from(d[i]);
        let (whole, rest) = (sum >> 2, sum & 3);
        (whole + u16::from(rest == 3 || (rest == 2 && whole & 1 == 1))) as u8
    })
}

/// The up to three texels of a side that one of a side of half the size covers.
struct AxisTaps {
    first: usize,
    weights: [f32; 3],
}

impl AxisTaps {
    fn of(from: u32, to: u32) -> Vec<Self> {
        let (from, to) = (f64::from(from), to);
        let width = from / f64::from(to);
        (0..to)
            .map(|index| {
                let (start, end) = (f64::from(index) * width, f64::from(index + 1) * width);
                let first = start.floor();
                let weights = [0.0, 1.0, 2.0].map(|tap| {
                    let (low, high) = ((first + tap).max(start), (first + tap + 1.0).min(end));
                    let weight = if first + tap < from { high - low } else { 0.0 };
                    // What rounding leaves of a texel is none.
                    if weight > 1e-9 {
                        (weight / width) as f32
                    } else {
                        0.0
                    }
                });
                Self {
                    first: first as usize,
                    weights,
                }
            })
            .collect()
    }
}
