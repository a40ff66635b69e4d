//! Filtered splats by number: a pass makes of each node, splat of a row, leaf or piece of a triangle that a list names what
//! [`crate::pack::filtered`] would have written, as the eye of the frame sees it.
//!
//! The processor takes twenty times as long for that as a graphics card needs to draw the splats, and looks at nodes,
//! attributes and moments of all; so it writes 8 bytes for 48. Numbers of what covers nothing are in the list, and become records
//! that show nothing. The arithmetic is that of the processor in its order. Other lights than the headlight have powers,
//! which a device rounds otherwise.

#[cfg(test)]
mod tests;

use crate::abi::constants::FLAG_CULLS_BACK;
use crate::abi::specialization::HAVE_TRIANGLES;
use crate::abi::{FilteredConstants, FilteredSplat, ListConstants, SplatId, shaders};
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::{AnyBuffer, DeviceBuffer};
use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::pipeline::ShaderPipeline;
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::device_tree::{SceneTree, page_of};
use crate::render::vulkan::raster_pass::ListArguments;
use std::sync::Arc;

/// Pipeline of the pass, for frames with the same flags.
#[derive(Debug)]
pub(super) struct FilteredExpansion {
    flags: u32,
    pipeline: ShaderPipeline,
}

/// Numbers of filtered splats, and the room for their records.
#[derive(Debug, Clone, Copy)]
pub(super) struct NamedFiltered<'a> {
    pub(super) ids: &'a dyn AnyBuffer,
    pub(super) count: usize,
    /// A dispatch over the numbers, where the device chose them; then `count` is what there is room for, and copies of the
    /// first number fill the last workgroups up.
    pub(super) groups: Option<ListArguments<'a>>,
    pub(super) records: &'a DeviceBuffer,
    pub(super) eye: &'a FilteredConstants,
}

impl FilteredExpansion {
    /// Flags that decide the pipeline: points have no backs.
    pub(super) fn flags_of(flags: u32, has_triangles: bool) -> u32 {
        match has_triangles {
            true => flags,
            false => flags & !FLAG_CULLS_BACK,
        }
    }

    /// Makes the pipeline of trees whose leaves are triangles or, without, points.
    ///
    /// # Errors
    /// When a Vulkan call fails.
    pub(super) fn new(gpu: &Arc<Gpu>, flags: u32, has_triangles: bool) -> Result<Self, Error> {
        let flags = Self::flags_of(flags, has_triangles);
        let constants = [HAVE_TRIANGLES.is(has_triangles)];
        let shader = &shaders::LISTS_FILTERED_COMP;
        let name = "lists.filtered";
        Ok(Self {
            flags,
            pipeline: ShaderPipeline::compute_for_flags(gpu, name, shader, &constants, flags)?,
        })
    }

    /// Tells whether it is of frames with such flags.
    pub(super) fn is_of(&self, flags: u32, has_triangles: bool) -> bool {
        self.flags == Self::flags_of(flags, has_triangles)
    }

    /// Pass `lists.filtered`: writes the records of a list of numbers. `blocks`: those of the frame and of a list.
    ///
    /// # Errors
    /// When the scene lies in several pages, the tree has no moments, or the frame has no room for constants.
    pub(super) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        on: SceneTree<'_>,
        named: NamedFiltered<'_>,
        blocks: (UniformBlock, ListConstants),
    ) -> Result<(), Error> {
        let NamedFiltered {
            ids,
            count,
            groups,
            records,
            eye,
        } = named;
        if count == 0 {
            return Ok(());
        }
        let in_tree = on.tree.buffers_of_splats(page_of(on.scene)?);
        let moments = on.tree.moments()?;
        let (of_frame, list) = blocks;
        let list = frame.uniform(&ListConstants {
            begin: 0,
            count: count as u32,
            ..list
        })?;
        let eye = frame.uniform(eye)?;
        let mut pass = frame.pass("lists.filtered").storage_read(ids);
        for buffer in in_tree {
            pass = pass.storage_read(buffer);
        }
        let [nodes, attributes, leaves, corners, vertices] = in_tree.map(BufferSlice::whole);
        let first = |bytes: usize| (count * bytes) as u64;
        let bound = [
            BufferSlice::new(ids, 0, first(size_of::<SplatId>())),
            leaves,
            corners,
            vertices,
            BufferSlice::new(records, 0, first(size_of::<FilteredSplat>())),
            nodes,
            attributes,
            BufferSlice::whole(moments),
        ];
        pass = pass.storage_read(moments).storage(records);
        if let Some(groups) = groups {
            pass = pass.group_arguments(groups.buffer);
        }
        pass.compute(|compute| {
            compute.bind(&self.pipeline, &[of_frame, list, eye], &bound);
            match groups {
                Some(groups) => compute.groups_from(groups.buffer, groups.offset),
                None => compute.items(count as u32),
            }
        });
        Ok(())
    }
}
