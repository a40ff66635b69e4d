//! The methods: how a model becomes a picture. Each has its passes and shaders in a folder of its name, and a
//! mirror on the CPU that tests compare it with.

pub mod engine;
pub mod filtered;
pub mod hybrid;
mod lists;
pub mod mirror;
pub mod plan;
pub mod points;
pub mod renderer;
pub mod scene;
pub(crate) mod targets;
pub mod triangles;

use crate::cut::SizeMetric;
use crate::draw::ColorBy;
use crate::gpu::image::Format;
use crate::gpu::pipeline::{Attribute, AttributeFormat, Record};

/// How the model is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Every triangle of the mesh: the reference.
    Triangles,
    /// Every vertex as a square of the threshold's size, without a tree.
    Points,
    /// Triangles where they are large on screen, splats where they are small (Benda, POP).
    #[default]
    Pop,
}

/// What a splat of [`Method::Pop`] looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SplatKind {
    /// An opaque square, facing the viewer, of the threshold's size.
    #[default]
    Square,
    /// A square that deposits the area its patch of surface covers; the sums are coverage and mean color.
    Filtered,
}

/// Whether what faces away is dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Culling {
    /// Where it cannot be seen: on surfaces that are closed and oriented outward.
    #[default]
    Auto,
    /// Always. On an open surface its back disappears.
    On,
    /// Never.
    Off,
}

/// Everything that decides a picture besides model and camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// How the model is drawn.
    pub method: Method,
    /// What splats look like.
    pub splat: SplatKind,
    /// Largest projected diameter of a node drawn whole, and side of its square; pixels. At least 0.
    pub threshold_px: f32,
    /// Factor of the depth offset of filtered splats; at least 0. The offset is half a splat's side over the cosine of
    /// the viewing angle (at least 0.1), times this. What lies behind the front by less is mixed into it. 1 is
    /// enough for a smooth surface seen from the front; at a rim the surface turns away under the splat, and 1
    /// loses its area. Larger lets what is near behind thin parts shine through.
    pub depth_offset: f32,
    /// Back-face and normal-cone culling.
    pub culling: Culling,
    /// What decides the color.
    pub color_by: ColorBy,
    /// Light both sides of a surface.
    pub two_sided: bool,
    /// Multiply by vertex colors.
    pub use_colors: bool,
    /// Background, red green blue in 0..=1.
    pub background: [f32; 3],
    /// What "projected diameter" means.
    pub size: SizeMetric,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: Method::Pop,
            splat: SplatKind::Square,
            depth_offset: 3.0,
            threshold_px: 1.0,
            culling: Culling::Auto,
            color_by: ColorBy::Shading,
            two_sided: true,
            use_colors: true,
            background: [0.0; 3],
            size: SizeMetric::Exact,
        }
    }
}

impl Settings {
    /// Whether what faces away is dropped for a model that is closed or not.
    pub fn culls_back(&self, is_closed: bool) -> bool {
        match self.culling {
            Culling::Auto => is_closed,
            Culling::On => true,
            Culling::Off => false,
        }
    }
}

/// Format of the color target: what the picture holds is what the target held.
pub(crate) const COLOR: Format = Format::Rgba8;
/// Format of the normal target.
pub(crate) const NORMAL: Format = Format::Rgba32Float;

/// [`crate::abi::Vertex`] as pipelines see it.
pub(crate) const VERTEX: Record = Record {
    stride: size_of::<crate::abi::Vertex>() as u32,
    attributes: &[
        Attribute {
            name: "position",
            format: AttributeFormat::Float3,
            offset: std::mem::offset_of!(crate::abi::Vertex, position) as u32,
        },
        Attribute {
            name: "normal",
            format: AttributeFormat::Snorm16x2,
            offset: std::mem::offset_of!(crate::abi::Vertex, normal) as u32,
        },
        Attribute {
            name: "color",
            format: AttributeFormat::Unorm8x4,
            offset: std::mem::offset_of!(crate::abi::Vertex, color) as u32,
        },
    ],
};

/// [`crate::abi::Splat`] as pipelines see it.
pub(crate) const SPLAT: Record = Record {
    stride: size_of::<crate::abi::Splat>() as u32,
    attributes: &[
        Attribute {
            name: "center",
            format: AttributeFormat::Float3,
            offset: std::mem::offset_of!(crate::abi::Splat, center) as u32,
        },
        Attribute {
            name: "radius",
            format: AttributeFormat::Float,
            offset: std::mem::offset_of!(crate::abi::Splat, radius) as u32,
        },
        Attribute {
            name: "normal",
            format: AttributeFormat::Snorm16x2,
            offset: std::mem::offset_of!(crate::abi::Splat, normal) as u32,
        },
        Attribute {
            name: "color",
            format: AttributeFormat::Unorm8x4,
            offset: std::mem::offset_of!(crate::abi::Splat, color) as u32,
        },
    ],
};
