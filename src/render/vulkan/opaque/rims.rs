//! Pass `polygons.rims`: pixels at the rims of patches show how much of them is covered. It reads the finished picture, and makes
//! another.

use crate::abi::{ListConstants, OrientedPolygon, shaders};
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::AnyBuffer;
use crate::gpu::frame::{FrameRecorder, TargetLoad, UniformBlock};
use crate::gpu::image::DeviceImage as Target;
use crate::gpu::pipeline::ShaderPipeline;
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::raster_pass::{
    RecordRange, ScreenDraw, full_screen, screen_description,
};
use crate::render::vulkan::storage_ranges;
use crate::render::vulkan::targets::{Context, FrameTargets};
use std::sync::Arc;

/// Patches that a picture shows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NumberedPatches<'a> {
    /// The records, from the start of a list.
    pub(crate) polygons: &'a dyn AnyBuffer,
    pub(crate) count: usize,
    /// Number in the list, from 1, of the one that a pixel shows; 0 of none.
    pub(crate) numbers: &'a Target,
}

/// The pipeline and the picture that it makes.
#[derive(Debug)]
pub(crate) struct RimPass {
    pipeline: ShaderPipeline,
    /// Flags of the frames that it draws.
    flags: u32,
    picture: Target,
    max_binding: u64,
}

impl RimPass {
    /// Readies the pass for pictures like those of `targets`, of frames with these flags; what was made for others is made anew.
    ///
    /// # Errors
    /// When memory runs out or a Vulkan call fails.
    pub(crate) fn ready(
        made: Option<Self>,
        gpu: &Arc<Gpu>,
        targets: &FrameTargets,
        flags: u32,
    ) -> Result<Self, Error> {
        let color = targets.color();
        let (kept, picture) = match made {
            Some(made) => (
                (made.flags == flags).then_some(made.pipeline),
                Some(made.picture),
            ),
            None => (None, None),
        };
        let shader = ("polygons.rims", &shaders::POLYGONS_RIMS_FRAG);
        let description = screen_description(shader, &[], color.format);
        let new = || {
            Target::new(
                gpu,
                "covered color",
                color.format,
                color.width,
                color.height,
            )
        };
        Ok(Self {
            pipeline: match kept {
                Some(pipeline) => pipeline,
                None => ShaderPipeline::for_flags(gpu, &description, flags)?,
            },
            flags,
            picture: picture.map_or_else(new, Ok)?,
            max_binding: gpu.info().max_storage_range,
        })
    }

    /// Records the pass, which reads colors and depths of the targets. Of a list that does not fit one binding the first patches
    /// count alone.
    ///
    /// # Errors
    /// When the frame has no room for its constants.
    pub(crate) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        targets: &FrameTargets,
        (patches, context): (NumberedPatches<'_>, &Context),
        constants: UniformBlock,
    ) -> Result<(), Error> {
        let records = (patches.polygons, size_of::<OrientedPolygon>() as u64);
        let range = RecordRange {
            first: 0,
            count: patches.count as u32,
        };
        let parts = storage_ranges::bound(frame, context, self.max_binding, records, range)?;
        let (slice, list) = match parts.first() {
            Some(&(slice, list, _)) => (slice, list),
            None => {
                let nothing: ListConstants = storage_ranges::constants(context);
                let slice = BufferSlice::new(patches.polygons, 0, 4);
                (slice, frame.uniform(&nothing)?)
            }
        };
        let [r, g, b] = context.background;
        let pass = frame
            .pass("polygons.rims")
            .color(&self.picture, TargetLoad::Clear([r, g, b, 0.0]))
            .fragment_storage(patches.polygons);
        let screen = ScreenDraw {
            pipeline: &self.pipeline,
            uniforms: &[constants, list],
            images: &[targets.color(), targets.depth(), patches.numbers],
            storage: &[slice],
        };
        full_screen(pass, &screen, context.rect_px);
        Ok(())
    }

    /// The picture of the last frame that had this pass.
    pub(crate) fn picture(&self) -> &Target {
        &self.picture
    }
}
