//! Every structure that a shader reads, byte for byte.
//!
//! `build.rs` reads the offsets from the compiled shaders and this file asserts them at compile time.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// One mesh vertex, 20 bytes: what the vertex buffer holds.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Vertex {
    /// Position in model space.
    pub position: Vec3,
    /// Unit normal, [`octahedral`](crate::math::octahedral) 2 x 16 bit.
    pub normal: [i16; 2],
    /// Red, green, blue (0..=255, used as value / 255 without decoding); alpha 255, or 0 when the vertex
    /// has no normal and is to be shaded as if it faced the light.
    pub color: [u8; 4],
}

/// One splat to draw, 24 bytes: what the draw list holds.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Splat {
    /// Center in model space.
    pub center: Vec3,
    /// Radius in model units; 0 asks for the constant size of the frame.
    pub radius: f32,
    /// Unit normal, octahedral 2 x 16 bit.
    pub normal: [i16; 2],
    /// As in [`Vertex::color`].
    pub color: [u8; 4],
}
