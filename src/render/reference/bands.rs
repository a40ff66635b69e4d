//! The one loop of the reference: bands of rows of the picture are drawn in parallel, and each visits the pixels of every
//! primitive in the order of the list. What a pixel holds, and what a fragment makes of it, is the technique's own.

use crate::image::{Image, unorm8};
use crate::math::camera::View;
use crate::pack::PrimitiveStyle;
use crate::render::PictureOutputs;
use rayon::prelude::*;
use std::ops::Range;

/// Primitives that are set up before any is rasterized: bounds the memory of the set-up, and is large enough
/// that starting the workers costs nothing.
const CHUNK: usize = 1 << 16;

/// Coverage of a pixel that is covered at all: one step of eight bits.
pub(super) const LEAST_ALPHA: f64 = 1.0 / 255.0;

/// The pixels of a picture that a primitive covers.
pub(super) trait PixelCoverage {
    /// What the rule of coverage finds at a pixel besides that it is covered.
    type Sample;

    /// Rows of the picture that it may cover.
    fn rows(&self) -> Range<u32>;

    /// Columns of such a row that it may cover.
    fn columns(&self, y: u32) -> Range<u32>;

    /// The sample at a pixel of these rows and columns; `None` where it is not covered.
    fn sample(&self, x: u32, y: u32) -> Option<Self::Sample>;
}

/// Calls `fragment` for every pixel of a band that a primitive covers.
fn for_each_fragment<S: PixelCoverage, T>(
    primitive: &S,
    band: &mut PixelBand<'_, T>,
    mut fragment: impl FnMut(&mut T, S::Sample),
) {
    let rows = primitive.rows();
    for y in rows.start.max(band.rows.start)..rows.end.min(band.rows.end) {
        for x in primitive.columns(y) {
            if let Some(sample) = primitive.sample(x, y) {
                let row = (y - band.rows.start) as usize;
                fragment(&mut band.pixels[row * band.width + x as usize], sample);
            }
        }
    }
}

/// A picture whose pixels hold a `T`, row by row from the top left.
pub(super) struct PixelRows<T> {
    width: usize,
    height: usize,
    pixels: Vec<T>,
}

/// Consecutive rows of such a picture.
struct PixelBand<'a, T> {
    width: usize,
    rows: Range<u32>,
    pixels: &'a mut [T],
}

/// A pixel, and what a splat leaves in one.
#[derive(Clone, Copy)]
pub(super) struct OpaquePixel {
    /// Reversed depth, as the device's depth buffer holds it; cleared to the far plane.
    pub(super) depth: f32,
    pub(super) shown: ShownPixel,
    /// Number of the patch that it shows.
    pub(super) patch: Option<u32>,
}

impl<T: Copy + Send> PixelRows<T> {
    /// A picture of the size of a view.
    pub(super) fn cleared(view: &View, to: T) -> Self {
        let (width, height) = (view.width as usize, view.height as usize);
        Self {
            width,
            height,
            pixels: vec![to; width * height],
        }
    }

    /// Draws primitives in their order: `set_up` gives what the rasterizer makes of one, `fragment` gets each pixel
    /// that this covers with the sample there. No pixel depends on the number or the timing of threads.
    pub(super) fn draw<P: Sync, S: PixelCoverage + Send + Sync, I: IntoIterator<Item = S>>(
        &mut self,
        primitives: &[P],
        set_up: impl Fn(&P) -> I + Sync,
        fragment: impl Fn(&mut T, &S, S::Sample) + Sync,
    ) {
        for chunk in primitives.chunks(CHUNK) {
            let ready: Vec<Vec<S>> = chunk
                .par_chunks(1024)
                .map(|part| part.iter().flat_map(&set_up).collect())
                .collect();
            self.bands().par_iter_mut().for_each(|band| {
                for primitive in ready.iter().flatten() {
                    for_each_fragment(primitive, band, |pixel, sample| {
                        fragment(pixel, primitive, sample);
                    });
                }
            });
        }
    }

    /// The pixels.
    pub(super) fn into_pixels(self) -> Vec<T> {
        self.pixels
    }

    /// Bands of whole rows, from the top; several a thread, since models are seldom spread evenly.
    fn bands(&mut self) -> Vec<PixelBand<'_, T>> {
        let width = self.width;
        let height = self
            .height
            .div_ceil(4 * rayon::current_num_threads())
            .max(1);
        self.pixels
            .chunks_mut((height * width).max(1))
            .enumerate()
            .map(|(i, pixels)| PixelBand {
                width,
                rows: (i * height) as u32..(i * height + pixels.len() / width) as u32,
                pixels,
            })
            .collect()
    }
}

/// What a pixel shows.
#[derive(Clone, Copy)]
pub(super) struct ShownPixel {
    /// Red, green, blue, and coverage.
    pub(super) color: [f64; 4],
    /// View-space distance; infinite where nothing is.
    pub(super) distance: f32,
    /// World-space unit normal, or zero.
    pub(super) normal: [f32; 3],
}

impl ShownPixel {
    /// The background of a style.
    pub(super) fn background(style: &PrimitiveStyle) -> Self {
        let [r, g, b] = style.background.map(f64::from);
        Self {
            color: [r, g, b, 0.0],
            distance: f32::INFINITY,
            normal: [0.0; 3],
        }
    }
}

/// The picture of a view whose pixel `i`, from the top left, is `shown(i)`.
pub(super) fn picture(
    view: &View,
    outputs: PictureOutputs,
    shown: impl Fn(usize) -> ShownPixel + Send + Sync,
) -> Image {
    let count = view.width as usize * view.height as usize;
    let pixels: Vec<ShownPixel> = (0..count).into_par_iter().map(shown).collect();
    Image {
        width: view.width,
        height: view.height,
        color: pixels.iter().map(|p| p.color.map(unorm8)).collect(),
        depth: plane(outputs.depth, &pixels, |p| p.distance),
        normal: plane(outputs.normal, &pixels, |p| p.normal),
        values: plane(outputs.values, &pixels, |p| p.color.map(|v| v as f32)),
    }
}

/// A value of every pixel; empty unless it is asked for.
pub(super) fn plane<T, V>(is_wanted: bool, pixels: &[T], value: impl Fn(&T) -> V) -> Vec<V> {
    if is_wanted {
        pixels.iter().map(value).collect()
    } else {
        Vec::new()
    }
}
