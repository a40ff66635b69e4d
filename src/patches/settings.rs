//! What the cut by error may choose.

use crate::cut::CutSettings;

/// How wrong a patch may be on the picture. A negative number draws no patches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorTolerances {
    /// Thickness and overhang at silhouettes, pixels. They grow by at most twice the larger of both tolerances.
    pub rim_px: f32,
    /// Thickness and overhang elsewhere, pixels.
    pub inside_px: f32,
    /// Error of the shade, grey levels of 255.
    pub shade_levels: f32,
}

impl Default for ErrorTolerances {
    fn default() -> Self {
        Self {
            rim_px: 0.15,
            inside_px: 0.25,
            shade_levels: 24.0,
        }
    }
}

impl ErrorTolerances {
    /// Tolerances for one number of pixels, the usual ones at 0.25. At silhouettes 0.6 of it. Grey levels grow by its root, as
    /// the shade changes with the angle of surfaces, and thickness with its square.
    pub fn within(inside_px: f32) -> Self {
        let usual = Self::default();
        Self {
            inside_px,
            ..usual.times(inside_px / usual.inside_px)
        }
    }

    /// Tolerances that are `factor` times as large in pixels, and its root in grey levels. Those that draw no patches stay.
    pub fn times(&self, factor: f32) -> Self {
        Self {
            rim_px: self.rim_px * factor,
            inside_px: self.inside_px * factor,
            shade_levels: self.shade_levels * factor.sqrt(),
        }
    }

    /// Draws no patches.
    pub const NONE: Self = Self {
        rim_px: -1.0,
        inside_px: -1.0,
        shade_levels: -1.0,
    };
}

/// Which nodes a frame draws as patches.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PatchRules {
    /// How wrong a patch may be.
    pub tolerances: ErrorTolerances,
    /// The shade keeps to its tolerance at every vertex, not on average.
    pub is_strict: bool,
    /// Nodes below the threshold are their polygon too instead of a square, where no second sheet is below them: nearer to the
    /// triangles, and slower.
    pub tiny_polygons: bool,
    /// Pixels at the rims of patches show how much of them is covered, by sixteen samples; else what is at their centers.
    pub covers_rims: bool,
}

impl PatchRules {
    /// Tells whether any node may be a patch: not where both tolerances of places, or that of the shade, are 0 or negative.
    pub fn draw_any(&self) -> bool {
        let ErrorTolerances {
            rim_px,
            inside_px,
            shade_levels,
        } = self.tolerances;
        rim_px.max(inside_px).min(shade_levels) > 0.0
    }
}

/// What the cut by error may choose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchCutSettings {
    /// Threshold of splats, culling and size metric, as for a cut by size.
    pub cut: CutSettings,
    /// How wrong a patch may be.
    pub tolerances: ErrorTolerances,
    /// Projected diameter from which on a node may be a patch, pixels.
    pub least_px: f32,
    /// Draw nodes below the threshold as their polygon instead of a square, where no second sheet is below them.
    pub tiny_polygons: bool,
}

impl Default for PatchCutSettings {
    fn default() -> Self {
        Self {
            cut: CutSettings::default(),
            tolerances: ErrorTolerances::default(),
            least_px: 1.0,
            tiny_polygons: false,
        }
    }
}
