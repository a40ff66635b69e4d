//! Opaque splats and triangles: the nearest wins, by the hardware rasterizer or by compute.

pub(crate) mod compute;
pub mod hardware;
pub mod triangle_runs;
