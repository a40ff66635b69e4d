//! The kinds of passes that draw splats.

use crate::render::settings::{Blend, Settings, SplatKind};

/// The passes that draw the splats of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Technique {
    /// There are none.
    Nothing,
    /// The nearest splat wins.
    Opaque,
    /// The weighted mean of all that is near the front.
    Fuzzy,
    /// Deposits of area.
    Filtered,
    /// Oriented polygons, the nearest wins.
    Polygons,
    /// Visible centers, and what lies between reconstructed.
    Visibility,
}

impl Technique {
    /// The technique of settings that [`check`](crate::render::supported::check) found no fault with.
    pub(crate) fn of(settings: &Settings) -> Self {
        match settings.splat {
            _ if !settings.draws_splats() => Self::Nothing,
            SplatKind::Visibility => Self::Visibility,
            _ if settings.blend() != Blend::Opaque => Self::Fuzzy,
            _ if settings.drawn_polygons().is_some() => Self::Polygons,
            SplatKind::Filtered => Self::Filtered,
            _ => Self::Opaque,
        }
    }

    /// Tells whether splats from vertices are blended or hide centers.
    pub(crate) fn blends_vertex_splats(settings: &Settings) -> bool {
        settings.drawn_vertex_splats().is_some() && Self::of(settings) != Self::Polygons
    }
}
