//! Triangles of the device's cut that become filtered splats, many of them in pieces.
//!
//! Which ones do depends on all of the cut, as [`crate::pack::filtered`] has it: so `cut.leaves` only names large triangles, and
//! pass `cut.pieces` counts them by their size on the screen, chooses, and writes numbers of pieces, or corners where triangles
//! stay such. It does what the processor does as long as the list has room for the pieces. A list with room for any cut
//! would take some 800 bytes a triangle, though no picture shows all in many pieces; so it has room for some a pixel.

use crate::abi::{CutCounters, shaders};
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::DeviceBuffer;
use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::gpu::pipeline::ShaderPipeline;
use crate::gpu::{Error, Gpu};
use crate::render::vulkan::device_tree::DeviceTree;
use std::sync::Arc;

/// Pieces for each pixel of the picture that there is room for at least. A surface that covers all of it in triangles of 3 to 6
/// pixels has some five.
const PIECES_IN_PIXEL: u64 = 8;

/// Most pieces there is room for: the passes count no more.
const MOST_PIECES: u64 = 1 << 25;

/// Pieces for each splat of the largest cut: more than 16 no triangle becomes where all do, and where those
/// above the limit do as well, there are at most twice as many splats as without them.
const PIECES_OF_SPLAT: u64 = 16;

/// Byte of the counters at which the workgroups are that look at named triangles.
const NAMED_GROUPS: u64 = std::mem::offset_of!(CutCounters, pieces.groups) as u64;

/// Number of pieces that a list has room for besides the splats of any cut, of a model with so many triangles, in a picture of so
/// many pixels, where a binding has room for so many records.
pub(super) fn most_pieces(most_splats: u64, triangles: u64, (pixels, records): (u64, u64)) -> u64 {
    let of_picture = pixels.saturating_mul(PIECES_IN_PIXEL).min(MOST_PIECES);
    // Every triangle may be a splat in one piece.
    of_picture
        .min(most_splats.saturating_mul(PIECES_OF_SPLAT))
        .min(records.saturating_sub(most_splats))
        .max(triangles)
}

/// Lists of a cut, with room for the pieces of its triangles.
#[derive(Debug, Clone, Copy)]
pub(super) struct PieceLists<'a> {
    pub(super) counters: &'a DeviceBuffer,
    /// Numbers of splats from the start, and from the end those of large triangles.
    pub(super) ids: &'a DeviceBuffer,
    /// Corners of triangles.
    pub(super) indices: &'a DeviceBuffer,
    /// Pipeline that counts the workgroups which draw them.
    pub(super) close: &'a ShaderPipeline,
}

/// Pipelines of the pass, in the order in which they run.
#[derive(Debug)]
pub(super) struct PiecePipelines {
    measure: ShaderPipeline,
    decide: ShaderPipeline,
    divide: ShaderPipeline,
    /// Largest picture that the lists have room for the pieces of, pixels.
    most_pixels: u64,
}

impl PiecePipelines {
    /// Makes the pipelines, for lists with room for the pieces of pictures of so many pixels.
    ///
    /// # Errors
    /// When a Vulkan call fails.
    pub(super) fn new(gpu: &Arc<Gpu>, most_pixels: u64) -> Result<Self, Error> {
        let pipeline = |name, shader| ShaderPipeline::compute(gpu, name, shader, &[]);
        Ok(Self {
            measure: pipeline("cut.measure", &shaders::CUT_MEASURE_COMP)?,
            decide: pipeline("cut.decide", &shaders::CUT_DECIDE_COMP)?,
            divide: pipeline("cut.divide", &shaders::CUT_DIVIDE_COMP)?,
            most_pixels,
        })
    }

    /// Tells whether lists have room for the pieces of a picture of so many pixels.
    pub(super) fn has_room_for(&self, pixels: u64) -> bool {
        pixels <= self.most_pixels
    }

    /// Pass `cut.pieces`: adds the pieces of named triangles to the splats, and corners of those that stay triangles.
    pub(super) fn record(
        &self,
        frame: &mut FrameRecorder<'_>,
        tree: &DeviceTree,
        lists: PieceLists<'_>,
        constants: UniformBlock,
    ) {
        let all = [lists.counters, lists.ids, lists.indices];
        let [counters, ids, indices] = all.map(|buffer| BufferSlice::whole(buffer));
        let of_tree = [&tree.leaves, &tree.corners];
        let [leaves, corners] = of_tree.map(|buffer| BufferSlice::whole(buffer));
        let pass = frame
            .pass("cut.pieces")
            .storage_read(&tree.leaves)
            .storage_read(&tree.corners)
            .storage(lists.ids)
            .storage(lists.indices)
            .storage(lists.counters);
        pass.compute(|compute| {
            compute.after();
            compute.bind(&self.measure, &[constants], &[counters, ids, leaves]);
            compute.groups_from(lists.counters, NAMED_GROUPS);
            compute.after();
            compute.bind(&self.decide, &[constants], &[counters]);
            compute.items(1);
            compute.after();
            let bound = [counters, ids, leaves, corners, indices];
            compute.bind(&self.divide, &[constants], &bound);
            compute.groups_from(lists.counters, NAMED_GROUPS);
            compute.after();
            compute.bind(lists.close, &[constants], &[counters, ids, indices]);
            compute.items(1);
        });
    }
}
