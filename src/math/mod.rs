//! Geometry without Vulkan: spheres, cones, frusta, cameras, packed directions.

pub mod camera;
pub mod cone;
pub mod frustum;
pub mod measured_line;
pub mod octahedral;
pub(crate) mod powers;
pub mod section_box;
pub mod section_line;
pub mod sphere;
pub mod up_axis;
