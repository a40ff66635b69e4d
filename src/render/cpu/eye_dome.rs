//! Eye-dome lighting: pixels are darkened by how much nearer their neighbors are. The rule is that of
//! `shaders/look/eye_dome.frag`.

use crate::abi::FrameConstants;
use crate::abi::constants::FLAG_ORTHOGRAPHIC;
use crate::math::powers::{exp2, log2};
use crate::pack::parallel;
use crate::render::cpu::darken::{DrawnRectangle, darken_value, darkened_word};
use fearless_simd::{Level, dispatch};

/// Rows and columns that a neighbor is away at most, pixels.
const REACH: usize = 2;

/// Rows that one thread takes at a time.
const ROWS: usize = 16;

/// Rows and columns of the neighbors, counted from two above and two left of the pixel.
const NEIGHBORS: [[usize; 2]; 8] = [
    [0, 2],
    [1, 1],
    [1, 3],
    [2, 0],
    [2, 4],
    [3, 1],
    [3, 3],
    [4, 2],
];

/// Logarithm that stands for nothing: farther than everything, so that it is never in front.
const NOWHERE: f32 = f32::MAX;

/// Logarithms of distances with a rim of nothing around, kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct DepthLogarithms {
    levels: Vec<f32>,
}

impl DepthLogarithms {
    /// Darkens a picture, and its colors as floats where there are any, row by row of the rectangle. Beside the rectangle
    /// nothing is.
    pub(crate) fn darken(
        &mut self,
        frame: &FrameConstants,
        picture: DrawnRectangle<'_>,
        values: &mut [[f32; 4]],
    ) {
        let DrawnRectangle {
            colors,
            pitch,
            depths,
            width,
        } = picture;
        if width == 0 || depths.is_empty() {
            return;
        }
        let height = depths.len() / width;
        let stride = width + 2 * REACH;
        let padded = stride * (height + 2 * REACH);
        if self.levels.len() < padded {
            self.levels.resize(padded, NOWHERE);
        }
        let levels = &mut self.levels[..padded];
        levels[..REACH * stride].fill(NOWHERE);
        levels[(REACH + height) * stride..].fill(NOWHERE);
        let distances = DistanceParams::new(frame);
        let simd_level = Level::new();
        let inside = &mut levels[REACH * stride..(REACH + height) * stride];
        let rows = inside
            .chunks_mut(ROWS * stride)
            .zip(depths.chunks(ROWS * width));
        parallel::share(depths.len(), rows, |(levels, depths)| {
            let rows = levels.chunks_mut(stride).zip(depths.chunks(width));
            dispatch!(simd_level, _simd => for (levels, depths) in rows {
                levels_of(&distances, levels, depths);
            });
        });
        let levels = &self.levels[..padded];
        let [red, green, blue, _] = frame.background;
        let shade = ShadeParams {
            background: [red, green, blue],
            exponent: frame.eye_dome,
        };
        for (row, values) in values.chunks_mut(width).enumerate() {
            let around = &levels[row * stride..(row + 2 * REACH + 1) * stride];
            darken_values(&shade, around, stride, values);
        }
        let end = (height - 1) * pitch + width;
        let bands = colors[..end].chunks_mut(ROWS * pitch).enumerate();
        parallel::share(depths.len(), bands, |(band, colors)| {
            for (row, colors) in colors.chunks_mut(pitch).enumerate() {
                let first = (band * ROWS + row) * stride;
                let around = &levels[first..first + (2 * REACH + 1) * stride];
                let colors = &mut colors[..width];
                dispatch!(simd_level, _simd => darken_row(&shade, around, stride, colors));
            }
        });
    }
}

/// What turns a reversed depth into a distance.
struct DistanceParams {
    p22: f32,
    p32: f32,
    is_orthographic: bool,
}

impl DistanceParams {
    fn new(frame: &FrameConstants) -> Self {
        Self {
            p22: frame.clip_from_view[2][2],
            p32: frame.clip_from_view[3][2],
            is_orthographic: frame.flags & FLAG_ORTHOGRAPHIC != 0,
        }
    }
}

/// What a row is darkened by.
struct ShadeParams {
    background: [f32; 3],
    exponent: f32,
}

/// Writes the logarithms of a row of depths, and nothing at its ends.
#[inline(always)]
fn levels_of(params: &DistanceParams, levels: &mut [f32], depths: &[f32]) {
    let (start, rest) = levels.split_at_mut(REACH);
    let (inside, end) = rest.split_at_mut(depths.len());
    start.fill(NOWHERE);
    end.fill(NOWHERE);
    let (p22, p32) = (params.p22, params.p32);
    for (level, &depth) in inside.iter_mut().zip(depths) {
        let distance = match params.is_orthographic {
            true => (p32 - depth) / p22,
            false => p32 / (depth + p22),
        };
        let found = log2(distance);
        *level = if depth > 0.0 { found } else { NOWHERE };
    }
}

/// Darkens a row of colors; `around` are the logarithms of the rows from two above it to two below, with two more at both
/// ends.
#[inline(always)]
fn darken_row(params: &ShadeParams, around: &[f32], stride: usize, colors: &mut [u32]) {
    let width = colors.len();
    let row = |[rows, column]: [usize; 2]| &around[rows * stride + column..][..width];
    let neighbors = NEIGHBORS.map(row);
    let own = row([REACH, REACH]);
    let background = params.background.map(|value| 255.0 * value);
    for (x, color) in colors.iter_mut().enumerate() {
        let level = own[x];
        let mut nearer = 0.0;
        for neighbor in &neighbors {
            nearer += (level - neighbor[x]).max(0.0);
        }
        let light = exp2(-params.exponent * nearer);
        *color = darkened_word(*color, light, background, level < NOWHERE);
    }
}

/// Darkens a row of colors as floats: see [`darken_row`].
fn darken_values(params: &ShadeParams, around: &[f32], stride: usize, values: &mut [[f32; 4]]) {
    let level_at = |rows: usize, column: usize| around[rows * stride + column];
    for (x, value) in values.iter_mut().enumerate() {
        let level = level_at(REACH, x + REACH);
        let [.., alpha] = *value;
        if level >= NOWHERE || alpha <= 0.0 {
            continue;
        }
        let neighbors = NEIGHBORS.map(|[row, column]| level_at(row, x + column));
        let nearer: f32 = neighbors.iter().map(|near| (level - near).max(0.0)).sum();
        let light = exp2(-params.exponent * nearer);
        darken_value(value, light, params.background);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::render::reference::eye_dome::darken;
    use bytemuck::Zeroable;

    /// Steps and slopes in a rectangle within a larger picture, with holes and half covered pixels.
    #[test]
    fn the_picture_is_that_of_the_reference() {
        let mut frame = FrameConstants::zeroed();
        (frame.clip_from_view[2][2], frame.clip_from_view[3][2]) = (0.01, 1.01);
        frame.background = [0.2, 0.4, 0.9, 1.0];
        frame.eye_dome = 3.0;
        for (width, height, pitch) in [(37usize, 41usize, 40usize), (1, 1, 1), (3, 60, 3)] {
            let (mut words, mut depths, mut image) = (
                vec![7; pitch * height],
                vec![],
                Image {
                    width: width as u32,
                    height: height as u32,
                    ..Image::default()
                },
            );
            for y in 0..height {
                for x in 0..width {
                    let i = (31 * x + 17 * y) as u32;
                    let distance = match (x / 9 + y / 7) % 3 {
                        0 => 2.0 + 0.01 * x as f32,
                        1 => 5.0 - 0.02 * y as f32,
                        _ => 9.0,
                    };
                    let is_drawn = !i.is_multiple_of(13);
                    let alpha = if i.is_multiple_of(5) { 100 } else { 255 };
                    let color = match is_drawn {
                        true => [(i % 256) as u8, (i / 3 % 256) as u8, 250, alpha],
                        false => [51, 102, 230, 0],
                    };
                    words[y * pitch + x] = u32::from_le_bytes(color);
                    depths.push(if is_drawn {
                        1.01 / distance - 0.01
                    } else {
                        0.0
                    });
                    image.color.push(color);
                    image
                        .depth
                        .push(if is_drawn { distance } else { f32::INFINITY });
                }
            }
            let before = image.color.clone();
            darken(&mut image, [0.2, 0.4, 0.9], frame.eye_dome);
            let picture = DrawnRectangle {
                colors: &mut words,
                pitch,
                depths: &depths,
                width,
            };
            let mut values: Vec<[f32; 4]> = before
                .iter()
                .map(|color| color.map(|byte| f32::from(byte) / 255.0))
                .collect();
            DepthLogarithms::default().darken(&frame, picture, &mut values);
            for (value, wanted) in values.iter().zip(&image.color) {
                let off = (0..4).map(|c| (255.0 * value[c] - f32::from(wanted[c])).abs());
                assert!(off.fold(0.0, f32::max) < 0.51, "{value:?}, {wanted:?}");
            }
            let mut dark = 0;
            for (i, wanted) in image.color.iter().enumerate() {
                let found = words[i / width * pitch + i % width].to_le_bytes();
                let off = (0..4).map(|c| found[c].abs_diff(wanted[c])).max();
                assert!(off <= Some(1), "{width}: {i}: {found:?}, {wanted:?}");
                dark += usize::from(found[2] < 200 && found[3] == 255);
            }
            assert!(width < 5 || dark > 50, "{dark} are darkened");
            let beside = words.chunks(pitch).flat_map(|row| &row[width..]);
            assert!(beside.into_iter().all(|&word| word == 7));
        }
    }
}
