//! From centers to a whole picture, for the reference and the processor's renderer. The steps and their order are those of the shaders; distances are compared in
//! single precision as there, and colors of the pyramid are whole numbers on both sides.

use crate::image::unorm8;
use crate::render::Reconstruction;
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Class of a pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PixelClass {
    /// Nothing is there.
    #[default]
    Background,
    /// A footprint covers it, and no center is seen in it.
    Hole,
    /// The center of a splat, or a triangle.
    Foreground,
}

/// A pixel after the first two passes, and of the pyramid.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct VisibilityPixel {
    /// Class of it.
    pub class: PixelClass,
    /// Shaded color: of the nearest center or triangle, in a hole of the footprint that made it.
    pub color: [u8; 3],
    /// Distance along the view direction, without the depth offset, and that offset; view-space units.
    pub front: [f32; 2],
}

/// Way in which holes are filled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoleFilling {
    /// By which method.
    pub reconstruction: Reconstruction,
    /// No splat is larger than this, pixels: bounds the reach of [`Reconstruction::PullPush`]; infinite for any.
    pub largest_px: f32,
}

/// Half sides of the windows in which density is counted, pixels.
const WINDOWS: [usize; 5] = [1, 2, 4, 8, 16];
/// A window with so many centers tells a density.
const ENOUGH: usize = 4;
/// No radius from a density is larger, pixels.
const LARGEST_RADIUS: f32 = 24.0;

/// Tells whether two fronts may belong to one surface.
fn is_one_surface(a: [f32; 2], b: [f32; 2]) -> bool {
    (a[0] - b[0]).abs() <= 2.0 * a[1].min(b[1])
}

/// A picture of pixels: the finest, or one of the pyramid.
#[derive(Debug, Clone)]
pub(crate) struct PyramidLevel {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) pixels: Vec<VisibilityPixel>,
}

impl PyramidLevel {
    /// The color of every hole that foreground of its surface is within reach of; `None` for the other pixels. `size_px` is
    /// the side of splats without a radius of their own.
    pub(crate) fn filled(self, filling: HoleFilling, size_px: f32) -> Vec<Option<[u8; 3]>> {
        match filling.reconstruction {
            Reconstruction::Gaussian => self.gathered(|_, _| Some(size_px)),
            Reconstruction::Density => self.gathered(|x, y| self.radius_at(x, y)),
            Reconstruction::PullPush => self.pull_push(filling.largest_px),
        }
    }

    /// Fills each hole from a radius around it.
    fn gathered(
        &self,
        radius_px: impl Fn(usize, usize) -> Option<f32> + Sync,
    ) -> Vec<Option<[u8; 3]>> {
        let fill = |i: usize| {
            let (x, y) = (i % self.width, i / self.width);
            match self.pixels[i].class {
                PixelClass::Hole => self.gather(x, y, radius_px(x, y)?),
                _ => None,
            }
        };
        (0..self.pixels.len()).into_par_iter().map(fill).collect()
    }

    fn at(&self, x: usize, y: usize) -> &VisibilityPixel {
        &self.pixels[y * self.width + x]
    }

    /// Columns and rows at most `reach` away from a pixel, within the picture.
    fn window(
        &self,
        x: usize,
        y: usize,
        reach: usize,
    ) -> (RangeInclusive<usize>, RangeInclusive<usize>) {
        let range = |c: usize, size: usize| c.saturating_sub(reach)..=(c + reach).min(size - 1);
        (range(x, self.width), range(y, self.height))
    }

    /// Calls `visit` with the squared distance and the pixel, for all foreground of the surface of pixel (x, y) in a
    /// window around it; returns the number of pixels of the window.
    fn for_each_in_window(
        &self,
        x: usize,
        y: usize,
        reach: usize,
        mut visit: impl FnMut(usize, &VisibilityPixel),
    ) -> usize {
        let front = self.at(x, y).front;
        let (columns, rows) = self.window(x, y, reach);
        let area = columns.clone().count() * rows.clone().count();
        for row in rows {
            for column in columns.clone() {
                let other = self.at(column, row);
                if other.class == PixelClass::Foreground && is_one_surface(front, other.front) {
                    visit(column.abs_diff(x).pow(2) + row.abs_diff(y).pow(2), other);
                }
            }
        }
        area
    }

    /// Mean of the foreground within `radius` pixels, weighted by a Gaussian whose deviation is half of that.
    fn gather(&self, x: usize, y: usize, radius: f32) -> Option<[u8; 3]> {
        let squared = f64::from(radius) * f64::from(radius);
        let mut sum = [0.0; 4];
        self.for_each_in_window(x, y, radius.floor() as usize, |distance, other| {
            let distance = distance as f64;
            if distance <= squared {
                let weight = (-2.0 * distance / squared).exp();
                let [r, g, b] = other.color.map(|c| f64::from(c) / 255.0 * weight);
                for (sum, term) in sum.iter_mut().zip([r, g, b, weight]) {
                    *sum += term;
                }
            }
        });
        let [r, g, b, weight] = sum;
        (weight > 0.0).then(|| [r, g, b].map(|c| unorm8(c / weight)))
    }

    /// 1.5 times the spacing of the foreground around a pixel (1 over the root of its density), at least the distance
    /// of the nearest; `None` where there is none.
    fn radius_at(&self, x: usize, y: usize) -> Option<f32> {
        let (mut count, mut area, mut nearest) = (0, 0, usize::MAX);
        for reach in WINDOWS {
            count = 0;
            area = self.for_each_in_window(x, y, reach, |distance, _| {
                count += 1;
                nearest = nearest.min(distance);
            });
            if count >= ENOUGH {
                break;
            }
        }
        if count == 0 {
            return None;
        }
        let spacing = (area as f32 / count as f32).sqrt();
        Some((1.5 * spacing).max((nearest as f32).sqrt() + 1e-3)).map(|r| r.min(LARGEST_RADIUS))
    }

    /// Fills the holes over a pyramid of half sizes, up to where a pixel has twice the side of the largest splat, at
    /// most to one pixel: the four pixels around a hole then include the center of its footprint.
    fn pull_push(self, largest_px: f32) -> Vec<Option<[u8; 3]>> {
        let mut levels = vec![self];
        let mut side = 1.0;
        while let Some(top) = levels.last()
            && (levels.len() == 1 || (top.pixels.len() > 1 && side < 2.0 * largest_px))
            && !top.pixels.is_empty()
        {
            let next = top.pulled();
            levels.push(next);
            side *= 2.0;
        }
        while levels.len() > 2 {
            let Some(coarse) = levels.pop() else { break };
            let Some(level) = levels.last_mut() else {
                break;
            };
            let filled = level.filled_from(&coarse);
            for (pixel, color) in level.pixels.iter_mut().zip(filled) {
                if let Some(color) = color {
                    *pixel = VisibilityPixel {
                        class: PixelClass::Foreground,
                        color,
                        front: pixel.front,
                    };
                }
            }
        }
        match &levels[..] {
            [finest, coarse] => finest.filled_from(coarse),
            _ => Vec::new(),
        }
    }

    /// The next level: of four pixels the nearest surface, the mean of its foreground, or a hole.
    fn pulled(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let pull = |i: usize| {
            let (x, y) = (2 * (i % width), 2 * (i / width));
            let children: Vec<&VisibilityPixel> = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)]
                .into_iter()
                .filter(|&(x, y)| x < self.width && y < self.height)
                .map(|(x, y)| self.at(x, y))
                .filter(|pixel| pixel.class != PixelClass::Background)
                .collect();
            // The first of equals, as a strict comparison finds it.
            let Some(nearest) = (children.iter().copied())
                .reduce(|a, b| if b.front[0] < a.front[0] { b } else { a })
            else {
                return VisibilityPixel::default();
            };
            let surface: Vec<&VisibilityPixel> = children
                .into_iter()
                .filter(|pixel| is_one_surface(nearest.front, pixel.front))
                .collect();
            let is_colored = |pixel: &&&VisibilityPixel| pixel.class == PixelClass::Foreground;
            let colored: Vec<&VisibilityPixel> =
                surface.iter().filter(is_colored).copied().collect();
            let (class, of) = if colored.is_empty() {
                (PixelClass::Hole, surface)
            } else {
                (PixelClass::Foreground, colored)
            };
            let n = of.len();
            let mean = |k: usize| of.iter().map(|p| p.front[k]).sum::<f32>() / n as f32;
            let color = [0, 1, 2].map(|c| match class {
                PixelClass::Foreground => {
                    rounded(of.iter().map(|p| usize::from(p.color[c])).sum(), n)
                }
                _ => 0,
            });
            VisibilityPixel {
                class,
                color,
                front: [mean(0), mean(1)],
            }
        };
        Self {
            width,
            height,
            pixels: (0..width * height).into_par_iter().map(pull).collect(),
        }
    }

    /// For every hole the bilinear mean of the four nearest pixels of the next level, of those of its surface.
    fn filled_from(&self, coarse: &Self) -> Vec<Option<[u8; 3]>> {
        let fill = |i: usize| {
            let pixel = &self.pixels[i];
            if pixel.class != PixelClass::Hole {
                return None;
            }
            // The middle of a pixel lies a quarter of a coarse pixel off that pixel's middle: weights 3 and 1.
            let sides = |c: usize, size: usize| {
                let near = c / 2;
                let away = if c % 2 == 1 {
                    Some(near + 1).filter(|&a| a < size)
                } else {
                    near.checked_sub(1)
                };
                [(Some(near), 3), (away, 1)]
            };
            let (mut sum, mut weights) = ([0; 3], 0);
            for (y, wy) in sides(i / self.width, coarse.height) {
                for (x, wx) in sides(i % self.width, coarse.width) {
                    let (Some(x), Some(y)) = (x, y) else { continue };
                    let parent = coarse.at(x, y);
                    if parent.class == PixelClass::Foreground
                        && is_one_surface(pixel.front, parent.front)
                    {
                        weights += wx * wy;
                        for (sum, c) in sum.iter_mut().zip(parent.color) {
                            *sum += wx * wy * usize::from(c);
                        }
                    }
                }
            }
            (weights > 0).then(|| sum.map(|s| rounded(s, weights)))
        };
        (0..self.pixels.len()).into_par_iter().map(fill).collect()
    }
}

/// A mean of bytes, rounded; halves go up.
fn rounded(sum: usize, count: usize) -> u8 {
    ((2 * sum + count) / (2 * count)) as u8
}
