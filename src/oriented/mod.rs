//! Points that carry few, sharp models: splats from vertices, cut at sharp edges.
//!
//! After D. Dietz, *Point Rendering* (thesis, 2009), who asks whether point renderers work on models with few points, and
//! finds that they need splats cut at edges, which he did not build. His splats, radius and angle test are here beside ours.
//!
//! Deviations from the text that proposes the cuts (M. Pauly et al., 2003, and his outlook):
//!
//! * A point answers for the parts of its faces that are nearest to it ([`radius`]), and its splats contain them. So no
//!   cut can open a hole on a flat face: where a cut would, triangles are drawn.
//! * Cuts lie along the edges themselves, projected into the splat's plane, not where the planes of two clusters meet: a
//!   border of an open surface has no second plane, and an edge that bends has no single one.
//! * Up to four cuts a splat, where they propose two.

pub mod angle_test;
pub mod choices;
pub mod clip;
pub mod cones;
pub mod levels;
pub mod look;
pub mod nearest;
pub mod quality;
pub mod radius;
pub mod resample;
pub(crate) mod shapes;
pub mod splats;
pub mod surface;
