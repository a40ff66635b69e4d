//! QSplat's node in few bits: a sphere in its parent's (13 bits), a normal by table (14), a cone (2), a color (16 or 24).
//!
//! Source: Rusinkiewicz and Levoy, *QSplat: A Multiresolution Point Rendering System for Large Meshes* (SIGGRAPH 2000),
//! section 3.1. Deviations, each for a bound that holds: a child's radius is the smallest of the thirteen with which the
//! decoded sphere contains the true one (the paper rounds the radius up and lets the sphere stick out); a normal is looked
//! up by the ratios of its components, so that all 16,224 cells are used; a cone counts the error of its rounded axis.

mod color;
mod cone;
mod normal;
mod sphere;

pub use color::{color_from_565, color_to_565};
pub use cone::{CONE_SINES, cone_code, widened_sine};
pub use normal::{NORMAL_CODES, NORMAL_ERROR, decode_normal, encode_normal, packed_normals};
pub use sphere::{LEVELS, PageSphere, SPHERE_CODES, decode_sphere, encode_sphere};

#[cfg(test)]
mod random;
#[cfg(test)]
pub(crate) use random::TestNumbers;
