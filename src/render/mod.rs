//! From a model and a view to a picture: settings, the plan of a frame, and three backends of which none knows another.
//!
//! A frame is planned ([`frame_plan`]), prepared, cut, packed, drawn (surface, resolve) and given a look. `vulkan` draws
//! every technique by the hardware rasterizer and by compute; [`cpu`] is the fast renderer of the processor;
//! [`mod@reference`] is exact and slow, and the oracle of the tests.

pub(crate) mod backdrop;
pub(crate) mod backend_choice;
pub(crate) mod capabilities;
pub(crate) mod compute_limits;
pub mod cost;
pub mod cpu;
pub mod cut_key;
pub mod engine;
pub(crate) mod frame_constants;
#[cfg(feature = "viewer")]
pub mod frame_estimate;
pub mod frame_plan;
pub(crate) mod hole_filling;
pub mod model_facts;
mod outputs;
pub mod pack_params;
pub mod paged_model;
pub mod part_cuts;
pub(crate) mod photo_look;
#[cfg(feature = "viewer")]
pub(crate) mod probe_area;
pub mod reference;
#[cfg(feature = "viewer")]
pub(crate) mod rest_picture;
pub(crate) mod screen_bounds;
mod settings;
pub mod stats;
pub mod supported;
pub(crate) mod technique;
pub(crate) mod vertex_looks;
mod vertex_splats;
pub mod vulkan;
#[cfg(feature = "viewer")]
pub mod window_renderer;

pub use crate::render::outputs::PictureOutputs;
pub use crate::render::settings::{
    AmbientOcclusion, Blend, Culling, CutOn, CutTraversal, EyeDome, ListOf, Method, Occlusion,
    Path, PhotoDisplay, Reconstruction, Settings, Shading, SplatKind, SumFormat,
};

pub use crate::abi::constants::LARGEST_SMALL_BLENDED_PX as LARGEST_COMPUTE_BLENDED_PX;
pub use crate::render::compute_limits::LARGEST_ELLIPSE_PX as LARGEST_COMPUTE_ELLIPSE_PX;
pub use crate::render::compute_limits::LARGEST_SQUARE_PX as LARGEST_COMPUTE_SQUARE_PX;
