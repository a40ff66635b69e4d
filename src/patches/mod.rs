//! Error patches: a node is drawn as one oriented polygon as soon as its error is small, whatever its size.
//!
//! [`build`] makes a [`NodePatch`] of each node, once for a model, and [`PatchConditions`] of them; [`select`] chooses those that a view draws as patches;
//! [`draw()`] makes an exact picture of them, [`PatchRaster`] a fast one. Ours; no paper.

mod build;
mod check;
mod conditions;
mod cut;
mod draw;
mod edges;
mod fit;
mod footprint;
mod nearest;
mod packed;
mod raster;
mod record;
mod resident;
mod rim_rules;
mod settings;
#[cfg(test)]
mod tests;
mod texture;

pub use build::{FULL_LEVELS, MOST_SHADE_LEVELS, build};
pub use check::{check_record, check_records};
pub use conditions::PatchConditions;
pub use cut::{PatchCounts, PatchCut, PatchRefusals, PatchSelector, select};
pub use draw::{PatchPicture, PatchStyle, draw, draw_triangles};
pub use raster::{PatchLight, PatchList, PatchPixel, PatchRaster, PatchTarget, RimPicture};
pub use record::{MOST_CORNERS, NodePatch, NodePatches, RESIDUAL_LEVELS};
pub use resident::{ResidentPatches, add_records};
pub(crate) use rim_rules::{AROUND, RIM_PLACES, RIM_SAMPLES, StraightDepth, outward_direction};
pub use settings::{ErrorTolerances, PatchCutSettings, PatchRules};
pub(crate) use texture::PixelRays;
