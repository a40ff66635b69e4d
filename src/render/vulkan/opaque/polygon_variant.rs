//! The pipelines by which oriented polygons are drawn.

use crate::abi::PatchTexture;
use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::AnyBuffer;
use crate::gpu::frame::PassBuilder;
use crate::render::settings::PolygonSource;
use crate::render::vulkan::raster_pass::RecordRange;

/// Choice of the pipelines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PolygonVariant {
    pub(crate) kind: PolygonKind,
    /// Flags of the frame.
    pub(crate) flags: u32,
    /// Compute draws them, not the rasterizer.
    pub(crate) by_compute: bool,
    /// Patches show images.
    pub(crate) has_textures: bool,
}

/// Kind of the polygons of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PolygonKind {
    /// Splats from vertices: they may reach behind the eye, and have no thickness.
    Splats,
    /// Patches of a cut: in front of the near plane, and widened by what their thickness shows.
    Patches,
}

/// Polygons of a frame.
#[derive(Debug, Clone)]
pub(crate) struct PolygonRecords<'a> {
    /// The records, from the start of a list.
    pub(crate) polygons: &'a dyn AnyBuffer,
    pub(crate) count: usize,
    /// Images that patches show, and where they are in them.
    pub(crate) textures: Option<PatchImages<'a>>,
}

/// Images of patches.
#[derive(Debug, Clone)]
pub(crate) struct PatchImages<'a> {
    /// Images of each model whose patches are in the list ([`crate::render::vulkan::device_textures`]), with these.
    pub(crate) texels: Vec<(&'a dyn AnyBuffer, RecordRange)>,
    /// Places of all patches in them, one each.
    pub(crate) places: &'a dyn AnyBuffer,
}

/// Polygons of a list that are drawn with the same storage.
pub(super) struct PolygonRun<'a> {
    pub(super) range: RecordRange,
    /// Storage that a pipeline binds last.
    pub(super) images: Option<[BufferSlice<'a>; 2]>,
}

impl<'a> PolygonRecords<'a> {
    /// Declares that fragments of a pass read the images.
    pub(super) fn declared<'f>(&self, pass: PassBuilder<'f>) -> PassBuilder<'f> {
        let Some(images) = &self.textures else {
            return pass;
        };
        let texels = images.texels.iter().map(|&(texels, _)| texels);
        texels.fold(pass.fragment_storage(images.places), |pass, texels| {
            pass.fragment_storage(texels)
        })
    }

    /// Runs that are drawn one after the other.
    pub(super) fn runs(&self) -> Vec<PolygonRun<'a>> {
        let all = RecordRange {
            first: 0,
            count: self.count as u32,
        };
        let Some(images) = &self.textures else {
            return vec![PolygonRun {
                range: all,
                images: None,
            }];
        };
        let places = BufferSlice::new(
            images.places,
            0,
            (self.count * size_of::<PatchTexture>()) as u64,
        );
        let of = |&(texels, range): &(&'a dyn AnyBuffer, RecordRange)| PolygonRun {
            range,
            images: Some([BufferSlice::whole(texels), places]),
        };
        images.texels.iter().map(of).collect()
    }
}

impl PolygonKind {
    /// Kind of a source.
    pub(crate) fn of(source: PolygonSource) -> Self {
        match source {
            PolygonSource::Vertices(_) => Self::Splats,
            PolygonSource::Patches(_) => Self::Patches,
        }
    }

    /// Name of the pass.
    pub(super) fn pass(self) -> &'static str {
        match self {
            Self::Splats => "polygons.splats",
            Self::Patches => "polygons.patches",
        }
    }
}
