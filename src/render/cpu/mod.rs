//! The fast renderer of the processor: opaque squares, discs and ellipses, filtered splats, splats from
//! vertices and triangles, by vectors as wide as the
//! processor has them.

pub(crate) mod ambient_occlusion;
pub(crate) mod clip;
mod corner_push;
pub(crate) mod darken;
pub(crate) mod eye_dome;
pub mod filtered;
pub(crate) mod float_planes;
pub(crate) mod frame_shading;
pub mod opaque;
pub(crate) mod photos;
pub mod picture;
#[cfg(feature = "viewer")]
pub(crate) mod predict;
pub mod renderer;
mod seen_polygon;
pub mod supported;
pub(crate) mod triangles;
