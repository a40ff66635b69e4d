//! Images on surfaces: texels with their smaller sizes, and what of them is seen at a place or over a triangle.
//!
//! Values are used as they are stored, value / 255, as colors of vertices are: smaller sizes are means of stored values.
//! Coordinates are those of glTF: (0, 0) is the upper left corner of the image, (1, 1) the lower right one.

pub(crate) mod capacity;
mod level;
mod mesh;
#[cfg(test)]
mod tests;

pub(crate) use level::LevelTaps;
pub use level::TextureLevel;
pub use mesh::{MeshTextures, NO_IMAGE, TexturePoint};

use crate::math::powers::log2;
use glam::{Vec2, Vec3};

/// What lies beyond the border of an image.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum WrapMode {
    /// The image again.
    #[default]
    Repeat,
    /// The image again, every other time turned over.
    Mirror,
    /// The image's border.
    Clamp,
}

impl WrapMode {
    /// The coordinate within 0..=1 that shows the same; 0 for what is not finite.
    #[inline]
    pub fn within(self, coordinate: f32) -> f32 {
        if !coordinate.is_finite() {
            return 0.0;
        }
        match self {
            WrapMode::Repeat => coordinate - whole_below(coordinate),
            WrapMode::Mirror => {
                let place = coordinate - 2.0 * whole_below(0.5 * coordinate);
                if place > 1.0 { 2.0 - place } else { place }
            }
            WrapMode::Clamp => coordinate.clamp(0.0, 1.0),
        }
    }
}

/// The largest whole number that is not above, as `floor` has it; that is a call where the processor has no such word.
#[inline]
fn whole_below(number: f32) -> f32 {
    // From here on all numbers are whole.
    if number.abs() >= (1 << 23) as f32 {
        return number;
    }
    let cut = number as i32 as f32;
    if cut > number { cut - 1.0 } else { cut }
}

/// An image with its smaller sizes, each half of the one before (rounded down) along each side, down to one texel.
#[derive(Clone, PartialEq)]
pub struct TextureImage {
    name: String,
    /// Of the file, texels; larger than the first level where memory did not suffice.
    file_size: [u32; 2],
    wrap: [WrapMode; 2],
    levels: Vec<TextureLevel>,
}

impl std::fmt::Debug for TextureImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TextureImage")
            .field("name", &self.name)
            .field("size", &self.size())
            .field("wrap", &self.wrap)
            .finish_non_exhaustive()
    }
}

/// Most pieces along an edge of a triangle of which each gives a sample of its mean.
const MOST_PIECES: f32 = 8.0;

/// How fast texture coordinates change from a pixel to the next, in the image once.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TextureSlope {
    /// To the next pixel on the right.
    pub right: Vec2,
    /// To the next pixel below.
    pub down: Vec2,
}

/// How weights of the corners of a triangle change from a pixel to the next one on the right and below.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WeightSteps {
    /// To the next pixel on the right.
    pub right: Vec3,
    /// To the next pixel below.
    pub down: Vec3,
}

/// The coordinate where corners at these coordinates have weights in proportion to these.
#[inline]
pub fn place_at(corners: &[Vec2; 3], weights: Vec3) -> Vec2 {
    let [a, b, c] = corners;
    (*a * weights.x + *b * weights.y + *c * weights.z) / weights.element_sum()
}

impl TextureSlope {
    /// How a coordinate changes where weights of the corners are linear in the picture: those of perspective are, before
    /// they are divided by their sum.
    #[inline]
    pub fn at(corners: &[Vec2; 3], weights: Vec3, steps: WeightSteps) -> Self {
        let sum = weights.element_sum();
        let place = place_at(corners, weights);
        let [a, b, c] = corners;
        let along = |step: Vec3| {
            let change = *a * step.x + *b * step.y + *c * step.z;
            (change - place * step.element_sum()) / sum
        };
        Self {
            right: along(steps.right),
            down: along(steps.down),
        }
    }
}

impl TextureImage {
    /// An image of a file, whose size may be larger, with its smaller sizes.
    pub fn new(
        name: impl Into<String>,
        file_size: [u32; 2],
        wrap: [WrapMode; 2],
        first: TextureLevel,
    ) -> Self {
        let mut levels = vec![first];
        while let Some(smaller) = levels.last().and_then(TextureLevel::halved) {
            levels.push(smaller);
        }
        Self {
            name: name.into(),
            file_size,
            wrap,
            levels,
        }
    }

    /// The name of its file, or in its file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Width and height of the file, texels.
    pub fn file_size(&self) -> [u32; 2] {
        self.file_size
    }

    /// Width and height, texels.
    pub fn size(&self) -> [u32; 2] {
        let first = &self.levels[0];
        [first.width(), first.height()]
    }

    /// What lies beyond its borders, horizontally and vertically.
    pub fn wrap(&self) -> [WrapMode; 2] {
        self.wrap
    }

    /// All sizes, the largest first.
    pub fn levels(&self) -> &[TextureLevel] {
        &self.levels
    }

    /// Bytes of all sizes.
    pub fn bytes(&self) -> u64 {
        let of = |level: &TextureLevel| size_of_val(level.texels()) as u64;
        self.levels.iter().map(of).sum()
    }

    /// The level whose texels are as large as pixels, as Vulkan has it without anisotropy: the logarithm of the longer of
    /// both steps in texels. Below 0 where texels are larger than pixels.
    #[inline]
    pub fn level_of(&self, slope: TextureSlope) -> f32 {
        let [width, height] = self.size();
        let size = Vec2::new(width as f32, height as f32);
        let right = (slope.right * size).length_squared();
        let down = (slope.down * size).length_squared();
        0.5 * log2(right.max(down))
    }

    /// The texels around a coordinate: four of the level below the wanted one, and four of the next unless the part of the way
    /// between the levels, the last number, is 0.
    #[inline(always)]
    pub(crate) fn taps(&self, at: Vec2, level: f32) -> ([LevelTaps; 2], f32) {
        let last = (self.levels.len() - 1) as f32;
        // Not a number counts as the first.
        let level = if level > 0.0 { level.min(last) } else { 0.0 };
        let lower = level as usize;
        let part = level - lower as f32;
        let at = Vec2::new(self.wrap[0].within(at.x), self.wrap[1].within(at.y));
        let taps = self.levels[lower].taps(at, self.wrap);
        match self.levels.get(lower + 1) {
            Some(next) if part > 0.0 => ([taps, next.taps(at, self.wrap)], part),
            _ => ([taps; 2], 0.0),
        }
    }

    /// Red, green and blue (1 is white) at a coordinate: of four texels, of both nearest levels.
    #[inline]
    pub fn sample(&self, at: Vec2, level: f32) -> Vec3 {
        let ([taps, next], part) = self.taps(at, level);
        match part > 0.0 {
            true => taps.color().lerp(next.color(), part),
            false => taps.color(),
        }
    }

    /// Red, green and blue at the center of a pixel: of a triangle whose corners have these coordinates and weights.
    #[inline]
    pub fn seen(&self, corners: &[Vec2; 3], weights: Vec3, steps: WeightSteps) -> Vec3 {
        let slope = TextureSlope::at(corners, weights, steps);
        self.sample(place_at(corners, weights), self.level_of(slope))
    }

    /// Red, green and blue about the middle of a small triangle of these coordinates: a sample of the level whose texels are
    /// as large as the triangle.
    pub fn about(&self, corners: [Vec2; 3]) -> Vec3 {
        let [width, height] = self.size().map(|side| side as f32);
        let size = Vec2::new(width, height);
        let [a, b, c] = corners;
        let edges = [b - a, c - b, a - c].map(|edge| (edge * size).length_squared());
        let longest = edges[0].max(edges[1]).max(edges[2]);
        // Half of a square with such sides.
        self.sample((a + b + c) / 3.0, 0.5 * (0.5 * longest).log2())
    }

    /// The mean over a triangle of these coordinates. Of the level that has some eight texels along its longest edge, a sample
    /// in the middle of each of so many pieces.
    pub fn mean(&self, corners: [Vec2; 3]) -> Vec3 {
        let [width, height] = self.size().map(|side| side as f32);
        let size = Vec2::new(width, height);
        let [a, b, c] = corners;
        let edges = [b - a, c - b, a - c].map(|edge| (edge * size).length());
        let longest = edges[0].max(edges[1]).max(edges[2]);
        if !longest.is_finite() {
            return self.sample(Vec2::ZERO, f32::INFINITY);
        }
        let level = (longest / MOST_PIECES).log2().ceil().max(0.0);
        let pieces = (longest / level.exp2()).ceil().clamp(1.0, MOST_PIECES);
        let count = pieces as u32;
        let step = [(b - a) / pieces, (c - a) / pieces];
        let mut sum = Vec3::ZERO;
        for i in 0..count {
            for j in 0..count - i {
                let corner = a + step[0] * i as f32 + step[1] * j as f32;
                sum += self.sample(corner + (step[0] + step[1]) / 3.0, level);
                if i + j + 1 < count {
                    sum += self.sample(corner + (step[0] + step[1]) * (2.0 / 3.0), level);
                }
            }
        }
        sum / (pieces * pieces)
    }
}
