//! Draw lists as storage: in parts that fit the device's bindings, each with its uniform block.

use crate::abi::{ListConstants, Splat};
use crate::gpu::Error;
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::AnyBuffer;
use crate::gpu::frame::{FrameRecorder, UniformBlock};
use crate::render::vulkan::opaque::compute_variant::ComputeVariant;
use crate::render::vulkan::opaque::triangle_runs::PageRange;
use crate::render::vulkan::raster_pass::{ListArguments, RecordRange};
use crate::render::vulkan::scene::DeviceScene;
use crate::render::vulkan::targets::Context;

/// What a frame draws.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ComputeList<'a> {
    pub(crate) scene: &'a DeviceScene,
    pub(crate) corners: &'a dyn AnyBuffer,
    pub(crate) runs: &'a [PageRange],
    pub(crate) splats: &'a dyn AnyBuffer,
    pub(crate) splat_count: u32,
    /// So many of them, the last, are samples: squares of a pixel.
    pub(crate) sample_count: u32,
    /// What the others are.
    pub(crate) variant: ComputeVariant,
    /// Parts of the picture in which anything can be.
    pub(crate) areas: &'a [[u32; 4]],
    /// Where the device wrote how many workgroups draw the lists; then the counts are those that there is room for.
    pub(crate) groups: Option<ListGroups<'a>>,
}

/// Arguments of dispatches over the lists of a cut.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ListGroups<'a> {
    pub(crate) splats: ListArguments<'a>,
    pub(crate) triangles: ListArguments<'a>,
}

/// Triangles of a scene: their corner indices, page by page.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TriangleRanges<'a> {
    pub(crate) scene: &'a DeviceScene,
    pub(crate) corners: &'a dyn AnyBuffer,
    pub(crate) runs: &'a [PageRange],
}

impl ComputeList<'_> {
    /// Tells whether nothing is drawn.
    pub(crate) fn is_empty(&self) -> bool {
        self.runs.is_empty() && self.splat_count == 0
    }
}

impl<'a> TriangleRanges<'a> {
    /// Parts of the list, each with the vertices of its page.
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many parts.
    pub(super) fn bound(
        &self,
        frame: &mut FrameRecorder<'_>,
        context: &Context,
        max_binding: u64,
    ) -> Result<Vec<(BoundRange<'a>, BufferSlice<'a>)>, Error> {
        let mut triangles = Vec::new();
        for run in self.runs {
            let range = RecordRange {
                first: run.first / 3,
                count: run.count / 3,
            };
            let own = bound(frame, context, max_binding, (self.corners, 12), range)?;
            let vertices = BufferSlice::whole(self.scene.vertices_of(run.page));
            triangles.extend(own.into_iter().map(|bound| (bound, vertices)));
        }
        Ok(triangles)
    }
}

/// A part with its uniform block, ready to be bound.
pub(crate) type BoundRange<'a> = (BufferSlice<'a>, UniformBlock, u32);

/// The items of a frame, ready to be bound.
pub(super) struct BoundItems<'a> {
    /// Each with what its splats are.
    pub(super) splats: Vec<(ComputeVariant, BoundRange<'a>)>,
    /// All of them, whatever they are.
    pub(super) all: Vec<BoundRange<'a>>,
    /// Each with the vertices of its page.
    pub(super) triangles: Vec<(BoundRange<'a>, BufferSlice<'a>)>,
}

/// The uniform block of a pass over a picture without items.
pub(crate) fn constants(context: &Context) -> ListConstants {
    ListConstants {
        rect_px: context.rect_px,
        size_px: [context.width, context.height],
        guard_px: context.guard_px as f32,
        first: 0,
        count: 0,
        begin: 0,
        dropped_sign: context.dropped_sign(),
    }
}

impl<'a> ComputeList<'a> {
    /// Binds everything.
    ///
    /// # Errors
    /// When the frame has no room for the constants of so many parts.
    pub(super) fn bound(
        &self,
        frame: &mut FrameRecorder<'_>,
        context: &Context,
        max_binding: u64,
    ) -> Result<BoundItems<'a>, Error> {
        let others = self.splat_count - self.sample_count;
        let records: (&dyn AnyBuffer, u64) = (self.splats, size_of::<Splat>() as u64);
        let mut of = |(first, count)| {
            let range = RecordRange { first, count };
            bound(frame, context, max_binding, records, range)
        };
        let (own, samples) = (of((0, others))?, of((others, self.sample_count))?);
        let all = of((0, self.splat_count))?;
        let own = own.into_iter().map(|bound| (self.variant, bound));
        let samples = samples
            .into_iter()
            .map(|bound| (ComputeVariant::SAMPLES, bound));
        let splats = own.chain(samples).collect();
        let triangles = TriangleRanges {
            scene: self.scene,
            corners: self.corners,
            runs: self.runs,
        };
        let triangles = triangles.bound(frame, context, max_binding)?;
        Ok(BoundItems {
            splats,
            all,
            triangles,
        })
    }
}

/// Binds the records `first .. first + count` of a buffer, each of `record` bytes.
///
/// # Errors
/// When the frame has no room for the constants of so many parts.
pub(crate) fn bound<'a>(
    frame: &mut FrameRecorder<'_>,
    context: &Context,
    max_binding: u64,
    (buffer, record): (&'a dyn AnyBuffer, u64),
    range: RecordRange,
) -> Result<Vec<BoundRange<'a>>, Error> {
    parts(range.first, range.count, record, max_binding)
        .map(|part| {
            let uniform = frame.uniform(&ListConstants {
                first: part.first,
                count: part.count,
                begin: part.begin,
                ..constants(context)
            })?;
            Ok((part.slice(buffer, record), uniform, part.count))
        })
        .collect()
}

/// Items of a list that fit one binding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct ListPart {
    first: u32,
    count: u32,
    /// First byte of the binding.
    offset: u64,
    /// Items in the binding before the first.
    begin: u32,
}

/// The items `first .. first + count`, of `record` bytes each (a multiple of 4), in parts that fit bindings of
/// `max_binding` bytes.
fn parts(first: u32, count: u32, record: u64, max_binding: u64) -> impl Iterator<Item = ListPart> {
    // So many records fill whole alignments, which are a power of two.
    let step = BufferSlice::ALIGNMENT
        >> record
            .trailing_zeros()
            .min(BufferSlice::ALIGNMENT.trailing_zeros());
    let most = (max_binding / (step * record)).saturating_sub(1) * step;
    let most = most.clamp(1, u64::from(u32::MAX / 2)) as u32;
    let end = first + count;
    (first..end).step_by(most as usize).map(move |first| {
        let aligned = u64::from(first) / step * step;
        ListPart {
            first,
            count: most.min(end - first),
            offset: aligned * record,
            begin: (u64::from(first) - aligned) as u32,
        }
    })
}

impl ListPart {
    fn slice<'a>(&self, buffer: &'a dyn AnyBuffer, record: u64) -> BufferSlice<'a> {
        let bytes = u64::from(self.begin + self.count) * record;
        BufferSlice::new(buffer, self.offset, bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_a_list_once_in_order_and_fit_their_bindings() {
        for (first, count, record, limit) in [
            (0, 0, 24, 4096),
            (0, 1, 24, 4096),
            (3, 1000, 44, 8192),
            (3, 1000, 32, 4096),
            (5, 400, 24, 4096),
            (77, 1000, 12, 4096),
            (64, 64, 12, 1 << 27),
        ] {
            let parts: Vec<ListPart> = parts(first, count, record, limit).collect();
            let numbers: Vec<u32> = parts
                .iter()
                .flat_map(|p| p.first..p.first + p.count)
                .collect();
            assert_eq!(numbers, (first..first + count).collect::<Vec<_>>());
            for part in parts {
                assert!(part.offset.is_multiple_of(BufferSlice::ALIGNMENT));
                assert_eq!(
                    part.offset + u64::from(part.begin) * record,
                    u64::from(part.first) * record
                );
                assert!(u64::from(part.begin + part.count) * record <= limit);
            }
        }
    }
}
