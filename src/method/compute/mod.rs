//! Square splats by compute: the same picture as [`super::hybrid`]'s rasterized squares, at a fraction of their cost
//! where squares are small.
//!
//! A rasterizer sets every point up before it draws it, which on a software device takes some 130 ns, whatever the
//! point's size. Here `splats.nearest` lets every square leave (depth, number) in its pixels by a 64-bit atomic
//! maximum, and `splats.resolve` shades one splat a pixel. Source: Schütz, Kerbl and Wimmer, *Rendering Point Clouds
//! with Compute Shaders and Vertex Order Optimization* (Computer Graphics Forum, 2021).

use super::targets::{Context, Targets};
use super::triangles::targets;
use crate::abi::{ListConstants, Splat, shaders};
use crate::gpu::bind::Slice;
use crate::gpu::buffer::{Buffer, Upload, Usage};
use crate::gpu::frame::{Frame, Load, Uniform};
use crate::gpu::pipeline::{Depth, Description, Pipeline, Record, Topology};
use crate::gpu::{Error, Gpu};
use std::sync::Arc;

/// Largest side of a square that is drawn this way, pixels: above it a rasterizer fills faster than atomics do.
pub(crate) const LARGEST_SIDE_PX: f32 = 6.0;

const NOTHING: Record = Record {
    stride: 0,
    attributes: &[],
};

/// Pipelines and the buffer of the nearest, for one picture size.
#[derive(Debug)]
pub(crate) struct Squares {
    nearest: Pipeline,
    resolve: Pipeline,
    keys: Buffer,
    /// Splats in one binding.
    splats_a_binding: u32,
}

/// Parts of a list of `count` records that fit one binding each: number of the first record, and how many.
fn parts(count: u32, most: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..count)
        .step_by(most.max(1) as usize)
        .map(move |first| (first, most.min(count - first)))
}

impl Squares {
    /// Whether the device can: 64-bit atomics, and a picture that fits one binding.
    pub(crate) fn is_supported(gpu: &Gpu, width: u32, height: u32) -> bool {
        let info = gpu.info();
        info.has_int64_atomics
            && 8 * u64::from(width) * u64::from(height) <= info.max_storage_range
    }

    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        width: u32,
        height: u32,
        normals: bool,
    ) -> Result<Self, Error> {
        let record = size_of::<Splat>() as u64;
        // Whole records that end on an aligned offset.
        let step = Slice::ALIGNMENT / 8;
        let most = gpu.info().max_storage_range / record / step * step;
        Ok(Self {
            nearest: Pipeline::compute(gpu, "splats.nearest", &shaders::COMPUTE_NEAREST_COMP)?,
            resolve: Pipeline::new(
                gpu,
                &Description {
                    name: "splats.resolve",
                    vertex: &shaders::COMPUTE_RESOLVE_VERT,
                    fragment: Some(&shaders::COMPUTE_RESOLVE_FRAG),
                    constants: &[normals],
                    record: NOTHING,
                    topology: Topology::Triangles,
                    colors: targets(normals),
                    depth: Depth::Nearest,
                    is_additive: false,
                },
            )?,
            keys: Buffer::new(
                gpu,
                "nearest splats",
                Usage::Storage,
                8 * u64::from(width) * u64::from(height),
            )?,
            splats_a_binding: u32::try_from(most).unwrap_or(u32::MAX - 1),
        })
    }

    /// Passes splats.clear, splats.nearest and splats.resolve. Keeps what the targets hold where it is nearer.
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many parts.
    pub(crate) fn record(
        &self,
        frame: &mut Frame<'_>,
        targets: &Targets,
        (splats, count): (&Upload, u32),
        context: &Context,
        constants: Uniform,
    ) -> Result<(), Error> {
        if count == 0 {
            return Ok(());
        }
        let record = size_of::<Splat>() as u64;
        let parts = parts(count, self.splats_a_binding)
            .map(|(first, count)| {
                let list = frame.uniform(&ListConstants {
                    size_px: [context.width, context.height],
                    guard_px: context.guard_px as f32,
                    first,
                    count,
                })?;
                let bytes = u64::from(count) * record;
                Ok((Slice::new(splats, u64::from(first) * record, bytes), list, count))
            })
            .collect::<Result<Vec<_>, Error>>()?;
        frame.pass("splats.clear").fill(&self.keys, 0);
        frame
            .pass("splats.nearest")
            .storage_read(splats)
            .storage(&self.keys)
            .compute(|compute| {
                for &(part, list, count) in &parts {
                    compute.bind(
                        &self.nearest,
                        &[constants, list],
                        &[part, Slice::whole(&self.keys)],
                    );
                    compute.items(count);
                }
            });
        targets
            .attach_with(frame.pass("splats.resolve"), context, |_| Load::Keep)
            .fragment_storage(splats)
            .fragment_storage(&self.keys)
            .draw(
                [0.0, 0.0, context.width as f32, context.height as f32],
                |draw| {
                    draw.cull_back_faces(false, false);
                    for &(part, list, _) in &parts {
                        draw.bind_storage(
                            &self.resolve,
                            &[constants, list],
                            &[],
                            &[part, Slice::whole(&self.keys)],
                        );
                        draw.draw(0, 3);
                    }
                },
            );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_a_list_once_and_in_order() {
        for (count, most) in [(0, 4), (1, 4), (4, 4), (5, 4), (11, 4), (11, 1)] {
            let numbers: Vec<u32> = parts(count, most).flat_map(|(f, n)| f..f + n).collect();
            assert_eq!(numbers, (0..count).collect::<Vec<_>>(), "{count} {most}");
            assert!(parts(count, most).all(|(_, n)| n >= 1 && n <= most));
        }
    }
}
