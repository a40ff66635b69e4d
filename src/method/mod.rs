//! The methods: how a model becomes a picture. Each has its passes and shaders in a folder of its name, and a
//! mirror on the CPU that tests compare it with.

mod by_id;
mod compute;
pub mod costs;
mod device_cut;
mod device_tree;
pub mod engine;
pub mod filtered;
pub mod fuzzy;
pub mod hybrid;
mod lists;
pub mod mirror;
pub mod overdraw;
pub mod plan;
pub mod renderer;
pub mod scene;
mod settings;
pub mod splats;
pub(crate) mod targets;
pub mod times;
pub mod triangles;
pub(crate) mod visibility;

pub use settings::{
    Blend, Culling, CutOn, ListOf, Method, Occlusion, Path, Reconstruction, Settings, Shading,
    SplatKind, SumFormat,
};

pub use crate::abi::constants::LARGEST_SMALL_BLENDED_PX as LARGEST_COMPUTE_BLENDED_PX;
pub use compute::LARGEST_ELLIPSE_PX as LARGEST_COMPUTE_ELLIPSE_PX;
pub use compute::LARGEST_SQUARE_PX as LARGEST_COMPUTE_SQUARE_PX;

use crate::gpu::image::Format;
use crate::gpu::pipeline::{Record, record};

/// Format of the color target: what the picture holds is what the target held.
pub(crate) const COLOR: Format = Format::Rgba8;
/// Format of the color target of pictures that are averaged: nothing is rounded before the mean is.
pub(crate) const SAMPLES: Format = Format::Rgba32Float;
/// Format of the normal target.
pub(crate) const NORMAL: Format = Format::Rgba32Float;

/// [`crate::abi::Vertex`] as pipelines see it.
pub(crate) const VERTEX: Record = record!(crate::abi::Vertex {
    position: Float3,
    normal: Snorm16x2,
    color: Unorm8x4,
});

/// [`crate::abi::Splat`] as pipelines see it.
pub(crate) const SPLAT: Record = record!(crate::abi::Splat {
    center: Float3,
    radius: Float,
    normal: Snorm16x2,
    color: Unorm8x4,
});
