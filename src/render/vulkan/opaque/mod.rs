//! Opaque splats, polygons and triangles: the nearest wins, by the hardware rasterizer or by compute.

pub(crate) mod compute;
pub(crate) mod compute_variant;
pub mod hardware;
pub(crate) mod polygon_variant;
pub(crate) mod polygons;
pub(crate) mod polygons_by_compute;
pub(crate) mod rims;
pub mod triangle_runs;
