//! What of the surface is at the center of a pixel, a vector of them at a time.

use crate::abi::{Splat, SplatRadius, Vertex};
use crate::pack::small_triangles::coverage::LANES;
use crate::pack::small_triangles::texels::TextureQueue;
use crate::textures::{TextureImage, WeightSteps};
use fearless_simd::prelude::*;
use glam::{Vec2, Vec3};

type Numbers<S> = <S as Simd>::f32s;

/// So many may wait, with room for what a vector of triangles covers.
const MANY: usize = 64;
pub(super) const ROOM: usize = MANY + LANES * crate::pack::small_triangles::MOST_PIXELS as usize;

pub(super) type ShadedRow<T> = [T; ROOM];

/// Pixels whose surface is not yet known: numbers of one kind in a row each, corner by corner.
#[derive(Debug)]
pub(super) struct ShadingQueue<'m> {
    len: usize,
    weights: [ShadedRow<f32>; 3],
    positions: [[ShadedRow<f32>; 3]; 3],
    normals: [ShadedRow<u32>; 3],
    colors: [ShadedRow<u32>; 3],
    textures: TextureQueue<'m>,
}

impl<'m> ShadingQueue<'m> {
    pub(super) fn new() -> Self {
        Self {
            len: 0,
            weights: [[0.0; ROOM]; 3],
            positions: [[[0.0; ROOM]; 3]; 3],
            normals: [[0; ROOM]; 3],
            colors: [[0; ROOM]; 3],
            textures: TextureQueue::new(),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    pub(super) fn is_full(&self) -> bool {
        self.len >= MANY
    }

    /// A pixel of a triangle with these corners, whose weights there are proportional to these.
    #[inline(always)]
    pub(super) fn push(&mut self, corners: [&Vertex; 3], weights: [f32; 3]) {
        let at = self.len;
        for (i, corner) in corners.into_iter().enumerate() {
            self.weights[i][at] = weights[i];
            self.positions[i][0][at] = corner.position.x;
            self.positions[i][1][at] = corner.position.y;
            self.positions[i][2][at] = corner.position.z;
            self.normals[i][at] = bytemuck::cast(corner.normal);
            self.colors[i][at] = bytemuck::cast(corner.color);
        }
        self.len += 1;
    }

    /// The pixel that is pushed next shows an image, in which the corners have these places.
    #[inline(always)]
    pub(super) fn push_texture(
        &mut self,
        image: &'m TextureImage,
        places: [Vec2; 3],
        steps: WeightSteps,
    ) {
        self.textures.put(self.len, image, places, steps);
    }

    /// Writes all.
    #[inline(always)]
    pub(super) fn empty<S: Simd>(&mut self, simd: S, mut write: impl FnMut(Splat)) {
        let mut at = 0;
        while at < self.len {
            let four = self.surface(simd, at);
            let count = (self.len - at).min(Numbers::<S>::LEN);
            for lane in 0..count {
                write(Splat {
                    center: Vec3::new(
                        four.center[0][lane],
                        four.center[1][lane],
                        four.center[2][lane],
                    ),
                    radius: SplatRadius::with_rest(four.fine[lane]),
                    normal: bytemuck::cast(four.normal[lane]),
                    color: bytemuck::cast(four.color[lane]),
                });
            }
            at += Numbers::<S>::LEN;
        }
        self.textures.clear();
        self.len = 0;
    }

    /// Surfaces number `at` and on.
    #[inline(always)]
    fn surface<S: Simd>(&self, simd: S, at: usize) -> SampledSurface {
        let end = at + Numbers::<S>::LEN;
        let numbers = |row: &ShadedRow<f32>| Numbers::<S>::from_slice(simd, &row[at..end]);
        let words = |row: &ShadedRow<u32>| S::u32s::from_slice(simd, &row[at..end]);
        let zero = Numbers::<S>::splat(simd, 0.0);
        let one = Numbers::<S>::splat(simd, 1.0);
        let (a, b, c) = (
            numbers(&self.weights[0]),
            numbers(&self.weights[1]),
            numbers(&self.weights[2]),
        );
        let sum = a + b + c;
        let w = [a / sum, b / sum, c / sum];
        let mut surface = SampledSurface {
            center: [[0.0; LANES]; 3],
            normal: [0; LANES],
            fine: [0; LANES],
            color: [0; LANES],
        };
        let lanes = ..Numbers::<S>::LEN;
        for axis in 0..3 {
            let [a, b, c] = &self.positions;
            let center =
                numbers(&a[axis]) * w[0] + numbers(&b[axis]) * w[1] + numbers(&c[axis]) * w[2];
            center.store_slice(&mut surface.center[axis][lanes]);
        }
        let (mut x, mut y, mut z) = (zero, zero, zero);
        let (mut red, mut green, mut blue) = (zero, zero, zero);
        for ((weight, normals), colors) in w.into_iter().zip(&self.normals).zip(&self.colors) {
            let word = words(normals);
            let color = words(colors);
            let [nx, ny, nz] = decoded(simd, word);
            // Alpha 0 marks a vertex without normal: it leaves the others to decide.
            let has_normal = color.simd_ge(1 << 24);
            let share = has_normal.select(weight, zero) / (nx * nx + ny * ny + nz * nz).sqrt();
            x += nx * share;
            y += ny * share;
            z += nz * share;
            red += byte::<S>(color, 0) * weight;
            green += byte::<S>(color, 8) * weight;
            blue += byte::<S>(color, 16) * weight;
        }
        if !self.textures.is_empty() {
            [red, green, blue] = self.textures.colors(simd, at, sum, w, [red, green, blue]);
        }
        let [red, fine_red] = byte_and_rest::<S>(red);
        let [green, fine_green] = byte_and_rest::<S>(green);
        let [blue, fine_blue] = byte_and_rest::<S>(blue);
        let has_normal = x.simd_ne(0.0) | y.simd_ne(0.0) | z.simd_ne(0.0);
        let nothing = S::u32s::splat(simd, 0);
        let alpha = has_normal.select(S::u32s::splat(simd, 255 << 24), nothing);
        let color = red | (green << 8) | (blue << 16) | alpha;
        color.store_slice(&mut surface.color[lanes]);
        let norm = x.abs() + y.abs() + z.abs();
        let (px, py, pz) = (x / norm, y / norm, z / norm);
        let is_up = pz.simd_ge(0.0);
        let (x, y) = (
            is_up.select(px, (one - py.abs()) * one.copysign(px)),
            is_up.select(py, (one - px.abs()) * one.copysign(py)),
        );
        let ([x, fine_x], [y, fine_y]) = (quantized::<S>(x), quantized::<S>(y));
        let is_some = has_normal & norm.is_finite();
        let code = is_some.select((x & 0xffff) | (y << 16), nothing);
        let fine_normal = is_some.select((fine_x & FINE) | ((fine_y & FINE) << FINE_BITS), nothing);
        let fine_color = fine_red | (fine_green << REST_BITS) | (fine_blue << (2 * REST_BITS));
        let fine = fine_normal | (fine_color << (2 * FINE_BITS));
        code.store_slice(&mut surface.normal[lanes]);
        fine.store_slice(&mut surface.fine[lanes]);
        surface
    }
}

/// The surface at some pixels, as [`Splat`] has it.
struct SampledSurface {
    center: [[f32; LANES]; 3],
    normal: [u32; LANES],
    fine: [u32; LANES],
    color: [u32; LANES],
}

/// What an octahedral code of 16 bits leaves out of a coordinate is kept in so many bits, steps of the code over 2 to the
/// power of one less: as many places as single precision has there. See [`SplatRadius::with_rest`].
const FINE_BITS: u32 = 11;
const FINE: u32 = (1 << FINE_BITS) - 1;
/// Bits of what a byte leaves out of a color, steps of the byte over 2 to their power. Samples of a pixel have much the same
/// color: what each is rounded by would stay in their mean.
const REST_BITS: u32 = 3;
const REST: u32 = (1 << REST_BITS) - 1;

/// What [`octahedral::decode`](crate::math::octahedral::decode) gives, before it is made a unit vector.
#[inline(always)]
fn decoded<S: Simd>(simd: S, word: S::u32s) -> [Numbers<S>; 3] {
    let word: S::i32s = word.bitcast();
    let (x, y): (Numbers<S>, Numbers<S>) =
        (((word << 16) >> 16).to_float(), (word >> 16).to_float());
    let (x, y) = (
        (x * (1.0 / 32767.0)).max(-1.0),
        (y * (1.0 / 32767.0)).max(-1.0),
    );
    let z = Numbers::<S>::splat(simd, 1.0) - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    [x - fold.copysign(x), y - fold.copysign(y), z]
}

/// A coordinate of a code, and what it leaves out.
#[inline(always)]
fn quantized<S: Simd>(v: Numbers<S>) -> [S::u32s; 2] {
    let scaled = v.max(-1.0).min(1.0) * 32767.0;
    let half = Numbers::<S>::splat(v.token(), 0.5).copysign(scaled);
    let code: S::i32s = (scaled + half).to_int();
    let left: Numbers<S> = code.to_float();
    let fine: S::i32s = ((scaled - left) * (1 << (FINE_BITS - 1)) as f32).to_int();
    [code.bitcast(), fine.bitcast()]
}

/// A channel of colors, 0 to 255.
#[inline(always)]
pub(super) fn byte<S: Simd>(color: S::u32s, shift: u32) -> Numbers<S> {
    let byte: S::i32s = ((color >> shift) & 0xff).bitcast();
    byte.to_float()
}

/// Rounded to 0..=255, and what that leaves out.
#[inline(always)]
fn byte_and_rest<S: Simd>(v: Numbers<S>) -> [S::u32s; 2] {
    let steps = v * (1 << REST_BITS) as f32 + 0.5;
    let steps: S::i32s = steps.max(0.0).min((255 << REST_BITS) as f32).to_int();
    let steps: S::u32s = steps.bitcast();
    let byte = (steps + (1 << (REST_BITS - 1))) >> REST_BITS;
    // Of two's complement, of which the lowest bits are kept.
    [byte, (steps - (byte << REST_BITS)) & REST]
}
