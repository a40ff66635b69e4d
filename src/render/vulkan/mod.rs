//! The renderer on a Vulkan device. Each technique has its passes in a folder of its name; the shaders of a pass lie in
//! `shaders` under the name of the pass.

pub mod blended;
pub(crate) mod device_cut;
pub(crate) mod device_textures;
pub(crate) mod device_tree;
pub(crate) mod draw_lists;
pub(crate) mod expand_ids;
pub(crate) mod expanded_lists;
pub(crate) mod eye_dome;
pub(crate) mod look;
pub mod opaque;
pub mod overdraw;
mod page_pool;
pub mod photos;
pub(crate) mod raster_pass;
pub mod renderer;
pub mod scene;
pub(crate) mod storage_ranges;
pub(crate) mod targets;
pub mod triangles;
pub(crate) mod visibility;

use crate::gpu::image::ImageFormat;
use crate::gpu::pipeline::{VertexRecord, record};

/// Format of the color target: what the picture holds is what the target held.
pub(crate) const COLOR: ImageFormat = ImageFormat::Rgba8;
/// Format of the color target of pictures that are averaged: nothing is rounded before the mean is.
pub(crate) const SAMPLES: ImageFormat = ImageFormat::Rgba32Float;
/// Format of the normal target.
pub(crate) const NORMAL: ImageFormat = ImageFormat::Rgba32Float;

/// [`crate::abi::Vertex`] as pipelines see it.
pub(crate) const VERTEX: VertexRecord = record!(crate::abi::Vertex {
    position: Float3,
    normal: Snorm16x2,
    color: Unorm8x4,
});

/// [`crate::abi::Splat`] as pipelines see it.
pub(crate) const SPLAT: VertexRecord = record!(crate::abi::Splat {
    center: Float3,
    radius: Float,
    normal: Snorm16x2,
    color: Unorm8x4,
});
