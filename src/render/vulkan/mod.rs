//! The renderer on a Vulkan device. Each technique has its passes in a folder of its name; the shaders of a pass lie in
//! `shaders` under the name of the pass.

pub mod blended;
pub(crate) mod device_cut;
pub(crate) mod device_textures;
pub(crate) mod device_tree;
pub(crate) mod draw_lists;
mod expand_filtered;
pub(crate) mod expand_ids;
mod expand_patches;
pub(crate) mod expanded_lists;
pub(crate) mod look;
pub(crate) mod look_pass;
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
/// Format of a target that numbers of polygons are drawn into.
pub(crate) const NUMBER: ImageFormat = ImageFormat::R32Uint;
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

/// [`crate::abi::OrientedPolygon`] as pipelines see it.
pub(crate) const POLYGON: VertexRecord = record!(crate::abi::OrientedPolygon {
    center: Float3,
    round_radius: Float,
    normal: Float3,
    thickness: Float,
    axis: Float3,
    corners_0: Float4 in corners at 0,
    corners_2: Float4 in corners at 16,
    corners_4: Float4 in corners at 32,
    corners_6: Float4 in corners at 48,
    shading_normal: Float3,
    color: Unorm8x4,
    shape_operator: Float3,
    spread: Float,
    slopes_u: Snorm8x4 in color_slopes at 0,
    slopes_v: Snorm8x4 in color_slopes at 4,
});
