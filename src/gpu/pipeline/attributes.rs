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
    /// Four floats.
    Float4,
    /// Two signed normalized 16-bit integers.
    Snorm16x2,
    /// Four signed normalized bytes.
    Snorm8x4,
    /// Four unsigned normalized bytes.
    Unorm8x4,
}

impl AttributeFormat {
    pub(super) fn vk(self) -> vk::Format {
        match self {
            Self::Float => vk::Format::R32_SFLOAT,
            Self::Float2 => vk::Format::R32G32_SFLOAT,
            Self::Float3 => vk::Format::R32G32B32_SFLOAT,
            Self::Float4 => vk::Format::R32G32B32A32_SFLOAT,
            Self::Snorm8x4 => vk::Format::R8G8B8A8_SNORM,
            Self::Snorm16x2 => vk::Format::R16G16_SNORM,
            Self::Unorm8x4 => vk::Format::R8G8B8A8_UNORM,
        }
    }
}

/// The record of a vertex buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
/// which field they lie, and `at` how many bytes behind the start of that, where they have no name of their own.
macro_rules! record {
    (@offset $of:ty, $name:ident) => {
        std::mem::offset_of!($of, $name)
    };
    (@offset $of:ty, $name:ident in $outer:ident) => {
        std::mem::offset_of!($of, $outer.$name)
    };
    (@offset $of:ty, $name:ident in $outer:ident at $bytes:literal) => {
        std::mem::offset_of!($of, $outer) + $bytes
    };
    ($of:ty {
        $($name:ident: $format:ident $(in $outer:ident $(at $bytes:literal)?)?),+ $(,)?
    }) => {
        $crate::gpu::pipeline::VertexRecord {
            stride: size_of::<$of>() as u32,
            attributes: &[$($crate::gpu::pipeline::RecordAttribute {
                name: stringify!($name),
                format: $crate::gpu::pipeline::AttributeFormat::$format,
                offset: $crate::gpu::pipeline::record!(
                    @offset $of, $name $(in $outer $(at $bytes)?)?
                ) as u32,
            }),+],
        }
    };
}
pub(crate) use record;
