//! Filtered splats by compute: the passes of [`super::Filtered`] with atomics in the place of depth test and blending.
//!
//! A rasterizer sets every point up before it draws it, which a software device does in 100 ns and more, twice. Here a
//! splat leaves its pushed depth in the pixels of its square by an atomic maximum (`filtered.depth`), and adds its deposits
//! where that does not hide it (`filtered.blend`). Sums are numbers of fixed point, so the order of drawing cannot show.
//! The rasterizer still draws triangles and what is larger than [`LARGEST_SMALL_FILTERED_PX`](crate::abi::constants::LARGEST_SMALL_FILTERED_PX); its depth is where the
//! compute passes begin from, and its sums are added to theirs.

use super::NOTHING;
use crate::abi::{FilteredSplat, shaders};
use crate::gpu::bind::Slice;
use crate::gpu::buffer::{Buffer, Upload, Usage};
use crate::gpu::frame::{Frame, Load, Uniform};
use crate::gpu::image::Image as Target;
use crate::gpu::pipeline::{Depth, Description, Pipeline, Topology};
use crate::gpu::{Error, Gpu};
use crate::method::compute::list::{self, Bound};
use crate::method::compute::rect;
use crate::method::targets::{Context, Targets};
use crate::method::triangles::targets;
use std::sync::Arc;

/// Pipelines and the sums, for one picture size.
#[derive(Debug)]
pub(crate) struct Twin {
    depth: Pipeline,
    blend: Pipeline,
    merge: Pipeline,
    normalize: Pipeline,
    /// As `normalize`, where the rasterizer drew as well.
    normalize_all: Pipeline,
    front: Buffer,
    sums: Buffer,
    max_binding: u64,
    /// Red, green and blue are the same in all that is drawn.
    pub(crate) is_gray: bool,
}

/// A list of splats, bound.
pub(crate) struct Ready<'a> {
    splats: &'a Upload,
    parts: Vec<Bound<'a>>,
}

/// Bytes of the sums of a pixel.
const fn sum_bytes(is_gray: bool) -> u64 {
    if is_gray { 16 } else { 32 }
}

/// Bytes of the largest storage that a picture needs.
pub(crate) fn storage_bytes((width, height): (u32, u32)) -> u64 {
    sum_bytes(false) * u64::from(width) * u64::from(height)
}

impl Twin {
    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        (width, height): (u32, u32),
        is_gray: bool,
    ) -> Result<Self, Error> {
        let base = Description {
            name: "filtered.merge",
            vertex: &shaders::FILTERED_NORMALIZE_VERT,
            fragment: Some(&shaders::FILTERED_MERGE_FRAG),
            constants: &[],
            record: NOTHING,
            topology: Topology::Triangles,
            colors: &[],
            depth: Depth::Nearest,
            is_additive: false,
        };
        let normalize = |name, has_large| {
            Pipeline::new(
                gpu,
                &Description {
                    name,
                    fragment: Some(&shaders::FILTERED_NORMALIZE_SMALL_FRAG),
                    constants: &[is_gray, has_large],
                    colors: targets(false),
                    // Also where there is no depth: beyond the squares of the first pass.
                    depth: Depth::NotFarther,
                    ..base
                },
            )
        };
        let pixels = u64::from(width) * u64::from(height);
        Ok(Self {
            depth: Pipeline::compute(
                gpu,
                "filtered.depth small",
                &shaders::FILTERED_DEPTH_COMP,
                &[],
            )?,
            blend: Pipeline::compute(
                gpu,
                "filtered.blend small",
                &shaders::FILTERED_BLEND_COMP,
                &[is_gray],
            )?,
            merge: Pipeline::new(gpu, &base)?,
            normalize: normalize("filtered.normalize small", false)?,
            normalize_all: normalize("filtered.normalize all", true)?,
            front: Buffer::new(gpu, "front of small splats", Usage::Storage, 4 * pixels)?,
            sums: Buffer::new(
                gpu,
                "sums of small splats",
                Usage::Storage,
                sum_bytes(is_gray) * pixels,
            )?,
            max_binding: gpu.info().max_storage_range,
            is_gray,
        })
    }

    /// Binds the first `count` splats of a list.
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many parts.
    pub(crate) fn ready<'a>(
        &self,
        frame: &mut Frame<'_>,
        splats: &'a Upload,
        count: u32,
        context: &Context,
    ) -> Result<Ready<'a>, Error> {
        let record = size_of::<FilteredSplat>() as u64;
        let parts = list::bound(
            frame,
            context,
            self.max_binding,
            (splats, record),
            (0, count),
        )?;
        Ok(Ready { splats, parts })
    }

    /// Pass `filtered.clear`: empties the sums, and begins with the depth that the rasterizer left, if it drew.
    pub(crate) fn clear(
        &self,
        frame: &mut Frame<'_>,
        rastered: Option<&Target>,
        context: &Context,
    ) {
        let pixels = rect::pixels(context.rect_px);
        let sums = (&self.sums as _, sum_bytes(self.is_gray) * pixels);
        match rastered {
            None => frame
                .pass("filtered.clear")
                .fill(&[sums, (&self.front, 4 * pixels)], 0),
            Some(depth) => {
                frame.pass("filtered.clear").fill(&[sums], 0);
                let [left, top, right, bottom] = context.rect_px;
                let part = [left, top, right - left, bottom - top];
                frame.copy_part("filtered.front", depth, part, &self.front);
            }
        }
    }

    /// Pass `filtered.depth` of a list: the nearest pushed depth of each pixel. May be repeated with further lists.
    pub(crate) fn depth(&self, frame: &mut Frame<'_>, list: &Ready<'_>, constants: Uniform) {
        let front = Slice::whole(&self.front);
        frame
            .pass("filtered.depth")
            .storage_read(list.splats)
            .storage(&self.front)
            .compute(|compute| {
                for &(part, uniform, count) in &list.parts {
                    compute.bind(&self.depth, &[constants, uniform], &[part, front]);
                    compute.items(count);
                }
            });
    }

    /// Pass `filtered.merge`: brings the front to the depth target, for what the rasterizer blends.
    ///
    /// # Errors
    /// When the frame has no room for constants.
    pub(crate) fn merge(
        &self,
        frame: &mut Frame<'_>,
        depth: &Target,
        context: &Context,
    ) -> Result<(), Error> {
        let picture = frame.uniform(&list::constants(context))?;
        frame
            .pass("filtered.merge")
            .depth(depth, Load::Keep)
            .fragment_storage(&self.front)
            .draw(whole(context), |draw| {
                draw.cull_back_faces(false, false);
                draw.scissor(context.rect_px);
                draw.bind_storage(&self.merge, &[picture], &[], &[Slice::whole(&self.front)]);
                draw.draw(0, 3);
            });
        Ok(())
    }

    /// Pass `filtered.blend` of a list, once the depth of all lists is known.
    pub(crate) fn blend(&self, frame: &mut Frame<'_>, list: &Ready<'_>, constants: Uniform) {
        let (front, sums) = (Slice::whole(&self.front), Slice::whole(&self.sums));
        frame
            .pass("filtered.blend")
            .storage_read(list.splats)
            .storage_read(&self.front)
            .storage(&self.sums)
            .compute(|compute| {
                for &(part, uniform, count) in &list.parts {
                    compute.bind(&self.blend, &[constants, uniform], &[part, front, sums]);
                    compute.items(count);
                }
            });
    }

    /// Pass `filtered.normalize`: color and depth of the picture, with the sums of what was rastered, if anything was.
    ///
    /// # Errors
    /// When the frame has no room for constants.
    pub(crate) fn normalize(
        &self,
        frame: &mut Frame<'_>,
        targets: &Targets,
        (rastered, none): (Option<&Target>, &Target),
        context: &Context,
        constants: Uniform,
    ) -> Result<(), Error> {
        let picture = frame.uniform(&list::constants(context))?;
        let (front, sums) = (Slice::whole(&self.front), Slice::whole(&self.sums));
        // Every binding must be written; without rastered sums this one is not looked at.
        let large = rastered.unwrap_or(none);
        let pipeline = if rastered.is_some() {
            &self.normalize_all
        } else {
            &self.normalize
        };
        targets
            .attach(frame.pass("filtered.normalize"), context)
            .sampled(large)
            .fragment_storage(&self.front)
            .fragment_storage(&self.sums)
            .draw(whole(context), |draw| {
                draw.cull_back_faces(false, false);
                draw.scissor(context.rect_px);
                draw.bind_storage(pipeline, &[constants, picture], &[large], &[front, sums]);
                draw.draw(0, 3);
            });
        Ok(())
    }
}

/// The viewport of a pass over the picture.
fn whole(context: &Context) -> [f32; 4] {
    [0.0, 0.0, context.width as f32, context.height as f32]
}
