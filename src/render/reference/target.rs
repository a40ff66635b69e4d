//! The attachments of a frame, cut into bands of rows that are drawn in parallel.

use crate::image::{Image, unorm8};
use crate::math::camera::View;
use crate::pack::Style;
use crate::render::reference::Outputs;
use rayon::prelude::*;

/// Color, depth and the outputs that were asked for.
pub(super) struct Target {
    image: Image,
    /// Reversed depth, as the device's depth buffer holds it; cleared to the far plane.
    depth: Vec<f32>,
}

impl Target {
    pub(super) fn new(view: &View, style: &Style, outputs: Outputs) -> Self {
        let pixels = view.width as usize * view.height as usize;
        let [r, g, b] = style.background;
        let background = [r, g, b, 0.0];
        Self {
            image: Image {
                width: view.width,
                height: view.height,
                color: vec![background.map(|c| unorm8(f64::from(c))); pixels],
                depth: vec![f32::INFINITY; if outputs.depth { pixels } else { 0 }],
                normal: vec![[0.0; 3]; if outputs.normal { pixels } else { 0 }],
                values: vec![background; if outputs.values { pixels } else { 0 }],
            },
            depth: vec![0.0; pixels],
        }
    }

    /// Bands of whole rows, from the top; several a thread, since models are seldom spread evenly.
    pub(super) fn bands(&mut self) -> Vec<Band<'_>> {
        let width = self.image.width as usize;
        let rows = (self.image.height as usize)
            .div_ceil(4 * rayon::current_num_threads())
            .max(1);
        let size = (rows * width).max(1);
        let mut distance = self.image.depth.chunks_mut(size);
        let mut normal = self.image.normal.chunks_mut(size);
        let mut values = self.image.values.chunks_mut(size);
        let color = self.image.color.chunks_mut(size);
        let depth = self.depth.chunks_mut(size);
        color
            .zip(depth)
            .enumerate()
            .map(|(i, (color, depth))| Band {
                width,
                first_row: (i * rows) as u32,
                end_row: (i * rows + color.len() / width) as u32,
                color,
                depth,
                distance: distance.next(),
                normal: normal.next(),
                values: values.next(),
            })
            .collect()
    }

    pub(super) fn into_image(self) -> Image {
        self.image
    }
}

/// Consecutive rows of a target.
pub(super) struct Band<'a> {
    width: usize,
    first_row: u32,
    end_row: u32,
    color: &'a mut [[u8; 4]],
    depth: &'a mut [f32],
    distance: Option<&'a mut [f32]>,
    normal: Option<&'a mut [[f32; 3]]>,
    values: Option<&'a mut [[f32; 4]]>,
}

/// Coverage of a pixel that is covered at all: one step of eight bits.
pub(super) const LEAST_ALPHA: f64 = 1.0 / 255.0;

/// The colors of a picture of `pixels` that is made a pixel at a time: rounded, and as they are where that is asked for.
pub(super) fn in_formats(
    pixels: usize,
    outputs: Outputs,
    color_at: impl Fn(usize) -> [f64; 4] + Send + Sync,
) -> (Vec<[u8; 4]>, Vec<[f32; 4]>) {
    let exact: Vec<[f64; 4]> = (0..pixels).into_par_iter().map(color_at).collect();
    let color = exact.iter().map(|c| c.map(unorm8)).collect();
    let values = if outputs.values {
        exact.iter().map(|c| c.map(|v| v as f32)).collect()
    } else {
        Vec::new()
    };
    (color, values)
}

/// What a primitive leaves in a pixel.
#[derive(Clone, Copy)]
pub(super) struct Fragment {
    pub(super) color: [f64; 4],
    pub(super) normal: [f32; 3],
    /// View-space distance.
    pub(super) distance: f32,
}

impl Band<'_> {
    /// The part of a range of rows that lies in this band.
    pub(super) fn rows(&self, rows: &std::ops::Range<u32>) -> std::ops::Range<u32> {
        rows.start.max(self.first_row)..rows.end.min(self.end_row)
    }

    /// The depth test and, where it passes, the shading: strictly nearer wins, so the first drawn wins ties
    /// and a NaN never passes. `x` and `y` are pixels of the picture; `y` lies in this band.
    pub(super) fn put(&mut self, x: u32, y: u32, depth: f32, shade: impl FnOnce() -> Fragment) {
        let i = (y - self.first_row) as usize * self.width + x as usize;
        if depth > self.depth[i] {
            self.depth[i] = depth;
            let fragment = shade();
            self.color[i] = fragment.color.map(unorm8);
            if let Some(values) = &mut self.values {
                values[i] = fragment.color.map(|v| v as f32);
            }
            if let Some(distance) = &mut self.distance {
                distance[i] = fragment.distance;
            }
            if let Some(normal) = &mut self.normal {
                normal[i] = fragment.normal;
            }
        }
    }
}
