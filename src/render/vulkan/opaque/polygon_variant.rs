//! The pipelines by which oriented polygons are drawn.

use crate::gpu::bind::BufferSlice;
use crate::gpu::buffer::AnyBuffer;
use crate::gpu::frame::PassBuilder;
use crate::render::settings::PolygonSource;

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
#[derive(Debug, Clone, Copy)]
pub(crate) struct PolygonRecords<'a> {
    /// The records, from the start of a list.
    pub(crate) polygons: &'a dyn AnyBuffer,
    pub(crate) count: usize,
    /// Images that patches show, and where they are in them.
    pub(crate) textures: Option<PatchImages<'a>>,
}

/// Images of patches.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PatchImages<'a> {
    /// All images ([`crate::render::vulkan::device_textures`]).
    pub(crate) texels: &'a dyn AnyBuffer,
    /// Places of the patches in them, one each, and their bytes.
    pub(crate) places: (&'a dyn AnyBuffer, u64),
}

impl<'a> PatchImages<'a> {
    /// Declares that fragments of a pass read them.
    pub(super) fn declared<'f>(self, pass: PassBuilder<'f>) -> PassBuilder<'f> {
        pass.fragment_storage(self.texels)
            .fragment_storage(self.places.0)
    }

    /// Storage that a pipeline binds last.
    pub(super) fn bound(self) -> [BufferSlice<'a>; 2] {
        let (places, bytes) = self.places;
        [
            BufferSlice::whole(self.texels),
            BufferSlice::new(places, 0, bytes),
        ]
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
