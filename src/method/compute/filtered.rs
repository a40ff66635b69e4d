//! Filtered splats and small triangles by compute: the passes of [`super::super::filtered`] with atomics in the place
//! of depth test and blending. Sums are fixed-point numbers, so the order of drawing cannot show.

use super::list::{self, Items, List};
use super::{NOTHING, Targets, targets};
use crate::abi::{FilteredSplat, shaders};
use crate::gpu::bind::Slice;
use crate::gpu::buffer::{Buffer, Usage};
use crate::gpu::frame::{Frame, Load, Uniform};
use crate::gpu::image::Image as Target;
use crate::gpu::pipeline::{Depth, Description, Pipeline, Topology};
use crate::gpu::{Error, Gpu};
use crate::method::targets::Context;
use std::sync::Arc;

/// Pipelines and the sums of small primitives, for one picture size.
#[derive(Debug)]
pub(crate) struct Sums {
    depth_splats: Pipeline,
    depth_triangles: Pipeline,
    merge: Pipeline,
    blend_splats: Pipeline,
    blend_triangles: Pipeline,
    normalize: Pipeline,
    front: Buffer,
    sums: Buffer,
    max_binding: u64,
}

/// The small primitives of a frame, bound.
pub(crate) struct Ready<'a> {
    list: List<'a>,
    items: Items<'a>,
    /// The block of passes over the whole picture.
    picture: Uniform,
    constants: Uniform,
}

/// Bytes of the sums of a picture.
pub(super) fn sum_bytes(size: &Targets) -> u64 {
    16 * u64::from(size.color().width) * u64::from(size.color().height)
}

impl Sums {
    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(crate) fn new(gpu: &Arc<Gpu>, size: &Targets) -> Result<Self, Error> {
        let base = Description {
            name: "",
            vertex: &shaders::COMPUTE_RESOLVE_VERT,
            fragment: None,
            constants: &[],
            record: NOTHING,
            topology: Topology::Triangles,
            colors: &[],
            depth: Depth::Nearest,
            is_additive: false,
        };
        let compute = |name, shader| Pipeline::compute(gpu, name, shader);
        Ok(Self {
            depth_splats: compute(
                "filtered.depth small splats",
                &shaders::COMPUTE_FILTERED_DEPTH_COMP,
            )?,
            depth_triangles: compute(
                "filtered.depth small triangles",
                &shaders::COMPUTE_FILTERED_DEPTH_TRIANGLES_COMP,
            )?,
            merge: Pipeline::new(
                gpu,
                &Description {
                    name: "filtered.merge",
                    fragment: Some(&shaders::COMPUTE_MERGE_FRAG),
                    ..base
                },
            )?,
            blend_splats: compute(
                "filtered.blend small splats",
                &shaders::COMPUTE_FILTERED_BLEND_COMP,
            )?,
            blend_triangles: compute(
                "filtered.blend small triangles",
                &shaders::COMPUTE_FILTERED_BLEND_TRIANGLES_COMP,
            )?,
            normalize: Pipeline::new(
                gpu,
                &Description {
                    name: "filtered.normalize all",
                    fragment: Some(&shaders::COMPUTE_FILTERED_NORMALIZE_FRAG),
                    colors: targets(false),
                    depth: Depth::None,
                    ..base
                },
            )?,
            front: Buffer::new(gpu, "front of small", Usage::Storage, sum_bytes(size) / 4)?,
            sums: Buffer::new(gpu, "sums of small", Usage::Storage, sum_bytes(size))?,
            max_binding: gpu.info().max_storage_range,
        })
    }

    /// Binds the list of a frame.
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many parts.
    pub(crate) fn ready<'a>(
        &self,
        frame: &mut Frame<'_>,
        list: List<'a>,
        context: &Context,
        constants: Uniform,
    ) -> Result<Ready<'a>, Error> {
        Ok(Ready {
            list,
            items: list.bound::<FilteredSplat>(frame, context, self.max_binding)?,
            picture: frame.uniform(&list::constants(context))?,
            constants,
        })
    }

    /// Passes small.clear, filtered.depth small and filtered.merge: the pushed depth of all into `depth`, where the
    /// nearer stays.
    pub(crate) fn record_depth(
        &self,
        frame: &mut Frame<'_>,
        ready: &Ready<'_>,
        depth: &Target,
        context: &Context,
    ) {
        frame
            .pass("small.clear")
            .fill(&[&self.front, &self.sums], 0);
        let front = Slice::whole(&self.front);
        let mut pass = frame
            .pass("filtered.depth small")
            .storage_read(ready.list.corners)
            .storage_read(ready.list.splats)
            .storage(&self.front);
        for page in &ready.list.scene.pages {
            pass = pass.storage_read(&page.vertices);
        }
        pass.compute(|compute| {
            for &((part, uniform, count), vertices) in &ready.items.triangles {
                compute.bind(
                    &self.depth_triangles,
                    &[ready.constants, uniform],
                    &[],
                    &[part, vertices, front],
                );
                compute.items(count);
            }
            for &(part, uniform, count) in &ready.items.splats {
                compute.bind(
                    &self.depth_splats,
                    &[ready.constants, uniform],
                    &[],
                    &[part, front],
                );
                compute.items(count);
            }
        });
        frame
            .pass("filtered.merge")
            .depth(depth, Load::Keep)
            .fragment_storage(&self.front)
            .draw(picture(context), |draw| {
                draw.cull_back_faces(false, false);
                draw.bind_storage(&self.merge, &[ready.picture], &[], &[front]);
                draw.draw(0, 3);
            });
    }

    /// Pass filtered.blend small: sums of all that is not behind `depth`.
    pub(crate) fn record_blend(&self, frame: &mut Frame<'_>, ready: &Ready<'_>, depth: &Target) {
        let sums = Slice::whole(&self.sums);
        let mut pass = frame
            .pass("filtered.blend small")
            .compute_sampled(depth)
            .storage_read(ready.list.corners)
            .storage_read(ready.list.splats)
            .storage(&self.sums);
        for page in &ready.list.scene.pages {
            pass = pass.storage_read(&page.vertices);
        }
        pass.compute(|compute| {
            for &((part, uniform, count), vertices) in &ready.items.triangles {
                compute.bind(
                    &self.blend_triangles,
                    &[ready.constants, uniform],
                    &[depth],
                    &[part, vertices, sums],
                );
                compute.items(count);
            }
            for &(part, uniform, count) in &ready.items.splats {
                compute.bind(
                    &self.blend_splats,
                    &[ready.constants, uniform],
                    &[depth],
                    &[part, sums],
                );
                compute.items(count);
            }
        });
    }

    /// Pass filtered.normalize: both sums into `color`.
    pub(crate) fn record_normalize(
        &self,
        frame: &mut Frame<'_>,
        ready: &Ready<'_>,
        large: &Target,
        color: &Target,
        context: &Context,
    ) {
        let [r, g, b] = context.background;
        frame
            .pass("filtered.normalize")
            .color(color, Load::Clear([r, g, b, 0.0]))
            .sampled(large)
            .fragment_storage(&self.sums)
            .draw(picture(context), |draw| {
                draw.cull_back_faces(false, false);
                draw.bind_storage(
                    &self.normalize,
                    &[ready.constants, ready.picture],
                    &[large],
                    &[Slice::whole(&self.sums)],
                );
                draw.draw(0, 3);
            });
    }
}

/// The viewport of a pass over the picture.
fn picture(context: &Context) -> [f32; 4] {
    [0.0, 0.0, context.width as f32, context.height as f32]
}
