//! The pipelines by which oriented polygons are drawn.

use crate::render::settings::PolygonSource;

/// Choice of the pipelines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PolygonVariant {
    pub(crate) kind: PolygonKind,
    /// Flags of the frame.
    pub(crate) flags: u32,
    /// Compute draws them, not the rasterizer.
    pub(crate) by_compute: bool,
}

/// Kind of the polygons of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PolygonKind {
    /// Splats from vertices: they may reach behind the eye, and have no thickness.
    Splats,
    /// Patches of a cut: in front of the near plane, and widened by what their thickness shows.
    Patches,
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
