//! The window.

pub mod camera;
