//! What a vertex buffer holds, and which of it a shader reads.

use ash::vk;

/// One vertex attribute: the shader's name for it, format and byte offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RecordAttribute {
    /// Name of the shader's input.
    pub name: &'static str,
    /// Format in memory.
    pub format: AttributeFormat,
    /// Byte offset in the record.
    pub offset: u32,
}

/// Format of a vertex attribute in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AttributeFormat {
    /// One float.
    Float,
    /// Two floats.
    Float2,
    /// Three floats.
    Float3,
    /// Two signed normalized 16-bit integers.
    Snorm16x2,
    /// Four unsigned normalized bytes.
    Unorm8x4,
}

impl AttributeFormat {
    pub(super) fn vk(self) -> vk::Format {
        match self {
            Self::Float => vk::Format::R32_SFLOAT,
            Self::Float2 => vk::Format::R32G32_SFLOAT,
            Self::Float3 => vk::Format::R32G32B32_SFLOAT,
            Self::Snorm16x2 => vk::Format::R16G16_SNORM,
            Self::Unorm8x4 => vk::Format::R8G8B8A8_UNORM,
        }
    }
}

/// The record of a vertex buffer.
#[derive(Debug, Clone, Copy)]
pub struct VertexRecord {
    /// Bytes from one record to the next.
    pub stride: u32,
    /// Attributes.
    pub attributes: &'static [RecordAttribute],
}

impl VertexRecord {
    /// No vertex buffer: the vertex shader knows the number of its vertex alone.
    pub const NOTHING: Self = Self {
        stride: 0,
        attributes: &[],
    };
}

/// The [`VertexRecord`] of a structure: the fields that a shader reads, by the names of its inputs, with their formats; `in` says in
/// which field they lie.
macro_rules! record {
    ($of:ty { $($name:ident: $format:ident $(in $outer:ident)?),+ $(,)? }) => {
        $crate::gpu::pipeline::VertexRecord {
            stride: size_of::<$of>() as u32,
            attributes: &[$($crate::gpu::pipeline::RecordAttribute {
                name: stringify!($name),
                format: $crate::gpu::pipeline::AttributeFormat::$format,
                offset: std::mem::offset_of!($of, $($outer.)? $name) as u32,
            }),+],
        }
    };
}
pub(crate) use record;
