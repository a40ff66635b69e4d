//! Projective texturing: the color of a place of a surface from calibrated photographs of it.
//!
//! Plain values and functions without files, devices or models, so that every backend and every shader can do the same:
//! [`camera`] and [`lens`] project, [`pyramid`] holds a photograph's pixels, [`depth_map`] what it sees of the surface, and
//! [`look`] weighs photographs at a pixel, whose place [`surface_rays`] finds. [`frame_photos`] has those of a frame.

pub mod camera;
pub mod depth_map;
pub mod frame_photos;
pub mod lens;
pub mod look;
pub mod projected;
pub mod pyramid;
pub mod surface_rays;
pub(crate) mod wide_look;
