//! Texels that are seen at the centers of pixels. Places, levels and mixing are found a vector of pixels at a time; between, texels are
//! gathered, which wait for nothing but memory.

use crate::pack::small_triangles::coverage::LANES;
use crate::pack::small_triangles::shading::{ROOM, ShadedRow, byte};
use crate::textures::{TextureImage, WeightSteps};
use fearless_simd::prelude::*;
use glam::{Vec2, Vec3};

type Numbers<S> = <S as Simd>::f32s;

/// Numbers of a vector of pixels.
type LaneRow<T> = [T; LANES];

/// Images of waiting pixels, and where their triangles are in them.
#[derive(Debug)]
pub(super) struct TextureQueue<'m> {
    is_empty: bool,
    images: [Option<&'m TextureImage>; ROOM],
    /// Width and height, texels.
    sizes: [ShadedRow<f32>; 2],
    /// Texture coordinates of the corners.
    places: [[ShadedRow<f32>; 3]; 2],
    /// Changes of the weights of the corners to the next pixel on the right, and below.
    steps: [[ShadedRow<f32>; 3]; 2],
}

/// Texels of a vector of pixels, and where between them it is.
struct GatheredTexels {
    /// Four of a level, then four of the next.
    texels: [LaneRow<u32>; 8],
    /// Parts of the way to the right and down among the first and the last four, and from those to these; this last is negative where
    /// there is no image.
    parts: [LaneRow<f32>; 5],
}

impl<'m> TextureQueue<'m> {
    pub(super) fn new() -> Self {
        Self {
            is_empty: true,
            images: [None; ROOM],
            sizes: [[1.0; ROOM]; 2],
            places: [[[0.0; ROOM]; 3]; 2],
            steps: [[[0.0; ROOM]; 3]; 2],
        }
    }

    /// Tells whether no pixel shows an image.
    pub(super) fn is_empty(&self) -> bool {
        self.is_empty
    }

    /// Forgets all.
    pub(super) fn clear(&mut self) {
        if !self.is_empty {
            self.images = [None; ROOM];
            self.is_empty = true;
        }
    }

    /// The pixel of a number shows an image.
    #[inline(always)]
    pub(super) fn put(
        &mut self,
        at: usize,
        image: &'m TextureImage,
        [a, b, c]: [Vec2; 3],
        steps: WeightSteps,
    ) {
        self.is_empty = false;
        self.images[at] = Some(image);
        let [width, height] = image.size();
        self.sizes[0][at] = width as f32;
        self.sizes[1][at] = height as f32;
        for (rows, [a, b, c]) in (self.places.iter_mut()).zip([[a.x, b.x, c.x], [a.y, b.y, c.y]]) {
            rows[0][at] = a;
            rows[1][at] = b;
            rows[2][at] = c;
        }
        for (rows, Vec3 { x, y, z }) in self.steps.iter_mut().zip([steps.right, steps.down]) {
            rows[0][at] = x;
            rows[1][at] = y;
            rows[2][at] = z;
        }
    }

    /// Red, green and blue, 0 to 255, of the pixels number `at` and on that show an image; of others the given ones. Their corners
    /// have weights `w` of sum 1, before of another sum.
    #[inline(always)]
    pub(super) fn colors<S: Simd>(
        &self,
        simd: S,
        at: usize,
        sum: Numbers<S>,
        w: [Numbers<S>; 3],
        given: [Numbers<S>; 3],
    ) -> [Numbers<S>; 3] {
        let found = self.gather(simd, at, sum, w);
        let lanes = ..Numbers::<S>::LEN;
        let numbers = |row: &LaneRow<f32>| Numbers::<S>::from_slice(simd, &row[lanes]);
        let words = |row: &LaneRow<u32>| S::u32s::from_slice(simd, &row[lanes]);
        let [right, down, next_right, next_down, between] = &found.parts;
        let (right, down) = (numbers(right), numbers(down));
        let (next_right, next_down) = (numbers(next_right), numbers(next_down));
        let between = numbers(between);
        let has_image = between.simd_ge(0.0);
        let [a, b, c, d, e, f, g, h] = &found.texels;
        let (a, b, c, d) = (words(a), words(b), words(c), words(d));
        let (e, f, g, h) = (words(e), words(f), words(g), words(h));
        let mut colors = given;
        for (color, shift) in colors.iter_mut().zip([0, 8, 16]) {
            let upper = mixed::<S>(byte::<S>(a, shift), byte::<S>(b, shift), right);
            let lower = mixed::<S>(byte::<S>(c, shift), byte::<S>(d, shift), right);
            let next_upper = mixed::<S>(byte::<S>(e, shift), byte::<S>(f, shift), next_right);
            let next_lower = mixed::<S>(byte::<S>(g, shift), byte::<S>(h, shift), next_right);
            let own = mixed::<S>(upper, lower, down);
            let next = mixed::<S>(next_upper, next_lower, next_down);
            *color = has_image.select(mixed::<S>(own, next, between), *color);
        }
        colors
    }

    /// Finds the texels.
    #[inline(always)]
    fn gather<S: Simd>(
        &self,
        simd: S,
        at: usize,
        sum: Numbers<S>,
        w: [Numbers<S>; 3],
    ) -> GatheredTexels {
        let end = at + Numbers::<S>::LEN;
        let numbers = |row: &ShadedRow<f32>| Numbers::<S>::from_slice(simd, &row[at..end]);
        let mut place = [[0.0; LANES]; 2];
        // Squares of the steps in texels to the right and down.
        let zero = Numbers::<S>::splat(simd, 0.0);
        let mut squares = [zero, zero];
        let axes = place.iter_mut().zip(&self.places).zip(&self.sizes);
        for ((place, [a, b, c]), size) in axes {
            let (a, b, c) = (numbers(a), numbers(b), numbers(c));
            let here = a * w[0] + b * w[1] + c * w[2];
            here.store_slice(&mut place[..Numbers::<S>::LEN]);
            let scale = numbers(size) / sum;
            for (square, steps) in squares.iter_mut().zip(&self.steps) {
                let [to_a, to_b, to_c] = steps;
                let (to_a, to_b, to_c) = (numbers(to_a), numbers(to_b), numbers(to_c));
                let moved = (a - here) * to_a + (b - here) * to_b + (c - here) * to_c;
                *square += moved * scale * (moved * scale);
            }
        }
        let mut level = [0.0; LANES];
        let found = log2::<S>(squares[0].max(squares[1])) * 0.5;
        found.store_slice(&mut level[..Numbers::<S>::LEN]);
        let mut gathered = GatheredTexels {
            texels: [[0; LANES]; 8],
            parts: [[-1.0; LANES]; 5],
        };
        for (lane, image) in self.images[at..end].iter().enumerate() {
            let Some(image) = image else { continue };
            let place = Vec2::new(place[0][lane], place[1][lane]);
            let ([first, second], part) = image.taps(place, level[lane]);
            for i in 0..4 {
                gathered.texels[i][lane] = u32::from_le_bytes(first.texels[i]);
                gathered.texels[i + 4][lane] = u32::from_le_bytes(second.texels[i]);
            }
            gathered.parts[0][lane] = first.right;
            gathered.parts[1][lane] = first.down;
            gathered.parts[2][lane] = second.right;
            gathered.parts[3][lane] = second.down;
            gathered.parts[4][lane] = part;
        }
        gathered
    }
}

/// A number between two.
#[inline(always)]
fn mixed<S: Simd>(from: Numbers<S>, to: Numbers<S>, part: Numbers<S>) -> Numbers<S> {
    from + (to - from) * part
}

/// Binary logarithms, by the steps of [`powers::log2`](crate::math::powers::log2).
#[inline(always)]
fn log2<S: Simd>(value: Numbers<S>) -> Numbers<S> {
    const ROOT_OF_HALF: i32 = 0x3f35_04f3;
    let word: S::i32s = value.bitcast();
    let bits = word - ROOT_OF_HALF;
    let exponent: Numbers<S> = (bits >> 23).to_float();
    let mantissa: Numbers<S> = ((bits & 0x007f_ffff) + ROOT_OF_HALF).bitcast();
    let t = (mantissa - 1.0) / (mantissa + 1.0);
    let square = t * t;
    let series = ((square * (1.0 / 7.0) + 1.0 / 5.0) * square + 1.0 / 3.0) * square + 1.0;
    exponent + t * series * (2.0 * std::f32::consts::LOG2_E)
}
