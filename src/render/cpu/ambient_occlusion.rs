//! Ambient occlusion in screen space: pixels are darkened by how much of their sky the surface around them hides. The rule is that
//! of `shaders/look/ambient_occlusion.frag`; `src/render/reference/ambient_occlusion.rs` has its source.
//!
//! Reversed depth is affine in what is linear along a plane in the picture, so that a rise is a difference of depths times a
//! factor of the pixel: no distance is computed.

use crate::abi::FrameConstants;
use crate::abi::constants::FLAG_ORTHOGRAPHIC;
use crate::math::powers::{exp2, log2};
use crate::pack::parallel;
use crate::render::cpu::darken::{DrawnRectangle, darken_value, darkened_word};
use fearless_simd::{Level, dispatch};
use std::f32::consts::{FRAC_PI_2, PI};

/// Rows that one thread takes at a time.
const ROWS: usize = 16;

/// Depth that stands for nothing: below everything, so that it never rises.
const NOWHERE: f32 = -1e30;

/// Steepest rise that is told from others.
const STEEPEST: f32 = 1e3;

/// Lines through a pixel: columns and rows of a step to one side, and the parts of the radius at which they are looked at.
const LINES: [([isize; 2], [f32; 3]); 8] = [
    ([1, 0], [0.2, 0.55, 1.0]),
    ([2, 1], [0.25, 0.6, 0.95]),
    ([1, 1], [0.15, 0.45, 0.85]),
    ([1, 2], [0.3, 0.65, 1.0]),
    ([0, 1], [0.2, 0.55, 1.0]),
    ([-1, 2], [0.25, 0.6, 0.95]),
    ([-1, 1], [0.15, 0.45, 0.85]),
    ([-2, 1], [0.3, 0.65, 1.0]),
];

/// Depths with a rim of nothing around, kept from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct AmbientOcclusionLook {
    depths: Vec<f32>,
}

/// What a row of pixels looks at.
struct OcclusionParams {
    /// From a row of depths to the next.
    stride: usize,
    /// Rows and columns of nothing around.
    reach: usize,
    lines: [OcclusionLine; 8],
    /// 1 over the radius, 1 / pixels.
    inverse_radius: f32,
    focal_px: f32,
    p22: f32,
    /// Rise that hides nothing, pixels at distance 1 over the depth's own factor; of an orthographic view pixels.
    slack: f32,
    is_orthographic: bool,
    power: f32,
    background: [f32; 3],
}

/// A line through a pixel.
#[derive(Clone, Copy)]
struct OcclusionLine {
    /// From a pixel to those on one side, places in the padded depths; those of the other side are their negatives.
    offsets: [isize; 3],
    /// How far these are away, pixels.
    away_px: [f32; 3],
}

/// Values of the pixels of a row: factors from a difference of depths to a rise, differences that hide nothing, and angles that are
/// hidden.
#[derive(Default)]
struct RowBuffers {
    factors: Vec<f32>,
    slacks: Vec<f32>,
    hidden: Vec<f32>,
}

impl AmbientOcclusionLook {
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
        let params = OcclusionParams::new(frame, width);
        let (stride, reach) = (params.stride, params.reach);
        let padded = stride * (height + 2 * reach);
        if self.depths.len() < padded {
            self.depths.resize(padded, NOWHERE);
        }
        let around = &mut self.depths[..padded];
        around[..reach * stride].fill(NOWHERE);
        around[(reach + height) * stride..].fill(NOWHERE);
        let inside = around[reach * stride..].chunks_mut(stride);
        for (to, from) in inside.zip(depths.chunks(width)) {
            to[..reach].fill(NOWHERE);
            to[reach + width..].fill(NOWHERE);
            for (to, &depth) in to[reach..].iter_mut().zip(from) {
                *to = if depth > 0.0 { depth } else { NOWHERE };
            }
        }
        let around = &self.depths[..padded];
        let simd_level = Level::new();
        let mut buffers = RowBuffers::default();
        for (row, values) in values.chunks_mut(width).enumerate() {
            dispatch!(simd_level, _simd => params.hide_row(around, (row, width), &mut buffers));
            let own = &around[params.place(row)..][..width];
            for ((value, &hidden), &depth) in values.iter_mut().zip(&buffers.hidden).zip(own) {
                if depth > NOWHERE && value[3] > 0.0 {
                    darken_value(value, params.light(hidden), params.background);
                }
            }
        }
        let end = (height - 1) * pitch + width;
        let bands = colors[..end].chunks_mut(ROWS * pitch).enumerate();
        parallel::share(depths.len(), bands, |(band, colors)| {
            let mut buffers = RowBuffers::default();
            for (row, colors) in colors.chunks_mut(pitch).enumerate() {
                let row = band * ROWS + row;
                let colors = &mut colors[..width];
                dispatch!(simd_level, _simd => {
                    params.hide_row(around, (row, width), &mut buffers);
                    params.darken_row(&around[params.place(row)..], &buffers.hidden, colors);
                });
            }
        });
    }
}

impl OcclusionParams {
    fn new(frame: &FrameConstants, width: usize) -> Self {
        let radius_px = frame.ambient_occlusion_px;
        let reach = radius_px.ceil() as usize + 2;
        let stride = width + 2 * reach;
        let lines = LINES.map(|([dx, dy], parts)| {
            let step_px = ((dx * dx + dy * dy) as f32).sqrt();
            // Steps that come nearest to a length, at least one.
            let steps = parts.map(|part| {
                let steps = part * radius_px * (1.0 / step_px) + 0.5;
                steps.floor().max(1.0)
            });
            OcclusionLine {
                offsets: steps.map(|steps| steps as isize * (dy * stride as isize + dx)),
                away_px: steps.map(|steps| steps * step_px),
            }
        });
        let [red, green, blue, _] = frame.background;
        Self {
            stride,
            reach,
            lines,
            inverse_radius: 1.0 / radius_px,
            focal_px: frame.focal_px,
            p22: frame.clip_from_view[2][2],
            slack: {
                let slack = frame.ambient_occlusion_slack * frame.focal_px;
                match frame.flags & FLAG_ORTHOGRAPHIC != 0 {
                    true => slack,
                    false => slack / frame.clip_from_view[3][2],
                }
            },
            is_orthographic: frame.flags & FLAG_ORTHOGRAPHIC != 0,
            power: frame.ambient_occlusion,
            background: [red, green, blue],
        }
    }

    /// Place of the first pixel of a row of the rectangle in the padded depths.
    fn place(&self, row: usize) -> usize {
        (self.reach + row) * self.stride + self.reach
    }

    /// Writes which angle of eight times pi is hidden from each pixel of a row.
    #[inline(always)]
    fn hide_row(&self, around: &[f32], (row, width): (usize, usize), buffers: &mut RowBuffers) {
        let place = self.place(row);
        let own = &around[place..][..width];
        let RowBuffers {
            factors,
            slacks,
            hidden,
        } = buffers;
        hidden.clear();
        hidden.resize(width, 0.0);
        factors.clear();
        let (focal_px, p22) = (self.focal_px, self.p22);
        factors.extend(own.iter().map(|&depth| match self.is_orthographic {
            true => focal_px / p22,
            false => focal_px / (depth.max(0.0) + p22),
        }));
        // A difference of depths by which the surface rises by the slack.
        slacks.clear();
        slacks.extend(own.iter().zip(&*factors).map(|(&depth, factor)| {
            let slack = match self.is_orthographic {
                true => self.slack,
                false => self.slack * (depth.max(0.0) + p22),
            };
            slack / factor
        }));
        let (factors, slacks) = (&factors[..width], &slacks[..width]);
        let hidden = &mut hidden[..width];
        for line in &self.lines {
            let at = |side: isize, index: usize| {
                let first = place.wrapping_add_signed(side * line.offsets[index]);
                &around[first..][..width]
            };
            let (a, b, c) = (at(1, 0), at(1, 1), at(1, 2));
            let (d, e, f) = (at(-1, 0), at(-1, 1), at(-1, 2));
            let slopes = line.away_px.map(|away| 1.0 / away);
            let fades = line.away_px.map(|away| away * self.inverse_radius);
            for x in 0..width {
                let (depth, factor) = (own[x] + slacks[x], factors[x]);
                let rise = |other: f32, index: usize| {
                    let rise = factor * slopes[index] * (other - depth);
                    rise * (2.0 - rise * fades[index]).clamp(0.0, 1.0)
                };
                let limited = |rise: f32| rise.clamp(-STEEPEST, STEEPEST);
                let one = limited(rise(a[x], 0).max(rise(b[x], 1)).max(rise(c[x], 2)));
                let two = limited(rise(d[x], 0).max(rise(e[x], 1)).max(rise(f[x], 2)));
                let both = one + two;
                let angle = angle(1.0 - one * two, both.max(0.0));
                hidden[x] += if both > 0.0 { angle } else { 0.0 };
            }
        }
    }

    /// Part of its light that a pixel keeps.
    #[inline(always)]
    fn light(&self, hidden: f32) -> f32 {
        let openness = 1.0 - hidden * (1.0 / (8.0 * PI));
        exp2(self.power * log2(openness.clamp(1e-6, 1.0)))
    }

    /// Darkens a row of colors.
    #[inline(always)]
    fn darken_row(&self, own: &[f32], hidden: &[f32], colors: &mut [u32]) {
        let background = self.background.map(|value| 255.0 * value);
        for ((color, &hidden), &depth) in colors.iter_mut().zip(hidden).zip(own) {
            let is_drawn = depth > NOWHERE;
            *color = darkened_word(*color, self.light(hidden), background, is_drawn);
        }
    }
}

/// The angle from the x axis to (x, y) with y not below 0, off by less than 1e-5: an odd polynomial of the eleventh
/// power in the quotient of the smaller and the larger.
#[inline(always)]
fn angle(x: f32, y: f32) -> f32 {
    let size = x.abs();
    let (low, high) = (size.min(y), size.max(y).max(f32::MIN_POSITIVE));
    let t = low / high;
    let s = t * t;
    let series = t
        * (0.999_977_26
            + s * (-0.332_623_47
                + s * (0.193_543_46
                    + s * (-0.116_432_87 + s * (0.052_653_32 + s * -0.011_721_2)))));
    let within = if y > size { FRAC_PI_2 - series } else { series };
    if x < 0.0 { PI - within } else { within }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::math::camera::{Camera, View};
    use crate::render::frame_constants::{FrameContext, frame_constants};
    use crate::render::model_facts::DrawnFacts;
    use crate::render::reference::ambient_occlusion::PixelSurroundings;
    use crate::render::{AmbientOcclusion, Settings};
    use crate::tree::Model;
    use glam::DVec3;

    #[test]
    fn angles_are_those_of_the_library() {
        for i in 0..=1000 {
            let wanted = PI * i as f32 / 1000.0;
            for length in [1e-3, 1.0, 4e5] {
                let found = angle(length * wanted.cos(), (length * wanted.sin()).max(0.0));
                assert!((found - wanted).abs() < 1e-5, "{wanted}: {found}");
            }
        }
    }

    /// Steps, slopes and holes in a rectangle within a larger picture.
    #[test]
    fn the_picture_is_that_of_the_reference() {
        for (width, height, pitch, radius_px, slack) in [
            (67, 41, 80, 9.0, 0.0),
            (1, 1, 1, 1.0, 0.0),
            (3, 60, 3, 30.0, 0.0),
            (67, 41, 80, 9.0, 0.02),
        ] {
            let view = view((width, height));
            let settings = Settings {
                ambient_occlusion: AmbientOcclusion::On,
                ambient_occlusion_reach_px: Some(radius_px),
                background: [0.2, 0.4, 0.9],
                ..Settings::default()
            };
            let facts = DrawnFacts {
                point_radius: 2.0 * slack / view.model_scale,
                ..DrawnFacts::from(&Model::default())
            };
            let context = FrameContext::new(&facts, &view, &settings, 0.0, 0);
            let frame = frame_constants(&view, &settings, &context);
            let (width, height) = (width as usize, height as usize);
            let mut image = Image {
                width: width as u32,
                height: height as u32,
                ..Image::default()
            };
            let (mut words, mut depths) = (vec![7; pitch * height], vec![]);
            for at in 0..width * height {
                let (x, y) = (at % width, at / width);
                let away = view.eye.length();
                // Within the sphere that the camera sees.
                let part = width.min(height) as f32 / 41.0;
                let pixel_size = part * away / view.focal_px();
                let height = match (x / 9 + y / 7) % 3 {
                    0 => 0.2 * x as f32,
                    1 => -0.4 * y as f32,
                    _ => 3.0,
                };
                let distance = away + pixel_size * height;
                let is_drawn = !(31 * x + 17 * y).is_multiple_of(13);
                let color = match is_drawn {
                    true => [
                        200,
                        (at % 256) as u8,
                        250,
                        if at % 5 == 0 { 100 } else { 255 },
                    ],
                    false => [51, 102, 230, 0],
                };
                words[y * pitch + x] = u32::from_le_bytes(color);
                let drawn = if is_drawn { distance } else { f32::INFINITY };
                image.color.push(color);
                image.depth.push(drawn);
                let [p22, p32] = [frame.clip_from_view[2][2], frame.clip_from_view[3][2]];
                depths.push(if is_drawn { p32 / distance - p22 } else { 0.0 });
            }
            let mut values: Vec<[f32; 4]> = (image.color.iter())
                .map(|color| color.map(|byte| f32::from(byte) / 255.0))
                .collect();
            let around = PixelSurroundings::new(&view, radius_px, slack);
            around.darken(&mut image, settings.background, frame.ambient_occlusion);
            let picture = DrawnRectangle {
                colors: &mut words,
                pitch,
                depths: &depths,
                width,
            };
            AmbientOcclusionLook::default().darken(&frame, picture, &mut values);
            let mut dark = 0;
            for (i, wanted) in image.color.iter().enumerate() {
                let found = words[i / width * pitch + i % width].to_le_bytes();
                let off = (0..4).map(|c| found[c].abs_diff(wanted[c])).max();
                assert!(off <= Some(1), "{width}: {i}: {found:?}, {wanted:?}");
                let off = (0..4).map(|c| (255.0 * values[i][c] - f32::from(wanted[c])).abs());
                assert!(off.fold(0.0, f32::max) < 0.7, "{:?}, {wanted:?}", values[i]);
                dark += usize::from(found[0] < 180 && found[3] == 255);
            }
            assert!(width < 5 || dark > 200, "{dark} are darkened");
            let beside = words.chunks(pitch).flat_map(|row| &row[width..]);
            assert!(beside.into_iter().all(|&word| word == 7));
        }
    }

    fn view(size: (u32, u32)) -> View {
        let camera = Camera::orbit(size, DVec3::ZERO, 1.0, 0.0, 0.0, 1.0);
        match camera.view(DVec3::ZERO) {
            Ok(view) => view,
            Err(error) => panic!("{error}"),
        }
    }
}
