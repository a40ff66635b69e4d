//! Patches by number: a pass makes of each node that a list names the polygon that [`crate::patches`] would have written.
//!
//! So the processor writes 4 bytes for 152, and looks at no records. The device unpacks the 36 bytes of a node (48 with colors)
//! in the same steps, to the same bits where roots and quotients round alike. Places in images it copies, 32 bytes each.

#[cfg(test)]
mod tests;

use crate::abi::specialization::HAVE_COLORS;
use crate::abi::{ListConstants, OrientedPolygon, PatchTexture, shaders};
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::{DeviceBuffer, UploadBuffer};
use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::pipeline::ShaderPipeline;
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::device_tree::DeviceTree;
use std::sync::Arc;

/// Pipelines of the pass.
#[derive(Debug)]
pub(super) struct PatchExpansion {
    /// Of models without and with colors.
    pipelines: [ShaderPipeline; 2],
    places: ShaderPipeline,
}

/// The uniform block of so many items of a list, from the first on.
///
/// # Errors
/// When the frame has no room for it.
fn all_of(
    frame: &mut FrameRecorder<'_>,
    count: usize,
    list: ListConstants,
) -> Result<UniformBlock, Error> {
    frame.uniform(&ListConstants {
        begin: 0,
        count: count as u32,
        ..list
    })
}

impl PatchExpansion {
    /// # Errors
    /// When a Vulkan call fails.
    pub(super) fn new(gpu: &Arc<Gpu>) -> Result<Self, Error> {
        let of = |have_colors| {
            let constants = [HAVE_COLORS.is(have_colors)];
            let shader = &shaders::LISTS_PATCHES_COMP;
            ShaderPipeline::compute(gpu, "lists.patches", shader, &constants)
        };
        let places = &shaders::LISTS_PLACES_COMP;
        Ok(Self {
            pipelines: [of(false)?, of(true)?],
            places: ShaderPipeline::compute(gpu, "lists.places", places, &[])?,
        })
    }

    /// Pass `lists.places`: writes the places in images of the patches of a list of so many numbers.
    ///
    /// # Errors
    /// When the tree has no places of patches, or the frame has no room for constants.
    pub(super) fn record_places(
        &self,
        frame: &mut FrameRecorder<'_>,
        tree: &DeviceTree,
        (ids, count, places): (&UploadBuffer, usize, &DeviceBuffer),
        list: ListConstants,
    ) -> Result<(), Error> {
        let of_nodes = tree.places_of_patches()?;
        let list = all_of(frame, count, list)?;
        let first = |bytes: usize| (count * bytes) as u64;
        let bound = [
            BufferSlice::new(ids, 0, first(4)),
            BufferSlice::whole(of_nodes),
            BufferSlice::new(places, 0, first(size_of::<PatchTexture>())),
        ];
        let pass = (frame.pass("lists.places"))
            .storage_read(ids)
            .storage_read(of_nodes);
        pass.storage(places).compute(|compute| {
            compute.bind(&self.places, &[list], &bound);
            compute.items(count as u32);
        });
        Ok(())
    }

    /// Pass `lists.patches`: writes the polygons of a list of so many numbers.
    ///
    /// # Errors
    /// When the tree has no records of patches, or the frame has no room for constants.
    pub(super) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        tree: &DeviceTree,
        (ids, count, polygons): (&UploadBuffer, usize, &DeviceBuffer),
        list: ListConstants,
    ) -> Result<(), Error> {
        if count == 0 {
            return Ok(());
        }
        let patches = tree.patches()?;
        // What is bound in the place of colors is not read.
        let colors = patches.colors.as_ref().unwrap_or(&patches.records);
        let list = all_of(frame, count, list)?;
        let first = |bytes: usize| (count * bytes) as u64;
        let bound = [
            BufferSlice::new(ids, 0, first(4)),
            BufferSlice::whole(&tree.nodes),
            BufferSlice::whole(&patches.records),
            BufferSlice::whole(colors),
            BufferSlice::new(polygons, 0, first(size_of::<OrientedPolygon>())),
        ];
        let pass = (frame.pass("lists.patches"))
            .storage_read(ids)
            .storage_read(&tree.nodes)
            .storage_read(&patches.records);
        let pass = match &patches.colors {
            Some(colors) => pass.storage_read(colors),
            None => pass,
        };
        pass.storage(polygons).compute(|compute| {
            let pipeline = &self.pipelines[usize::from(patches.colors.is_some())];
            compute.bind(pipeline, &[list], &bound);
            compute.items(count as u32);
        });
        Ok(())
    }
}
