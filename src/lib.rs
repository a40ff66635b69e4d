//! `surfel` draws enormous meshes and scans with points, triangles or both.
//!
//! A model is ordered once into a tree of bounding spheres. Each view then takes from the tree only what it
//! needs: a part that is small on screen becomes one square splat, a triangle that is large stays a triangle. The
//! cost follows the picture, not the model. A Vulkan 1.3 device draws, hardware or software; the processor's own renderer takes its
//! place where that is faster or where there is no Vulkan.
//!
//! The folders follow the data: [`input`] reads a file into a [`mesh::Mesh`] (and [`generate`] makes one), [`tree`]
//! orders it into a bounding-sphere tree, [`cut`] chooses the nodes that a view needs, [`pack`] packs them into
//! lists of plain records, [`render`] turns the lists into a picture: on a Vulkan device, on the processor, or by the exact reference,
//! [`image`] keeps and compares pictures, [`measure`] keeps times, counts and errors, [`chart`] lays times and errors side
//! by side, [`mod@bench`] holds the times to what they have to reach. [`scenes`] are models that methods fail at,
//! [`failures`] says how far and why. [`gpu`] is the only place with Vulkan.
//!
//! # From a file to a picture, without a window
//!
//! ```no_run
//! use std::path::Path;
//! use surfel::gpu::Options;
//! use surfel::math::camera::Camera;
//! use surfel::render::Settings;
//! use surfel::render::engine::{Backend, Engine};
//! use surfel::render::PictureOutputs;
//! use surfel::progress::Silent;
//! use surfel::{input, tree};
//!
//! fn main() -> Result<(), surfel::Error> {
//!     // A file becomes a mesh, and the mesh a tree.
//!     let mesh = input::load(Path::new("horse.ply"), &input::Options::default(), &Silent)?.mesh;
//!     let model = tree::build(mesh, &tree::BuildOptions::default(), &Silent)?;
//!     // Azimuth 0.5 and elevation 0.35 radians; fill 1: the bounding sphere fills the picture.
//!     let center = model.origin + model.orbit_center.as_dvec3();
//!     let radius = f64::from(model.orbit_radius);
//!     let view = Camera::orbit((800, 600), center, radius, 0.5, 0.35, 1.0).view(model.origin)?;
//!     // The best device here; with `device: Some("mirror".into())` the CPU draws, without Vulkan.
//!     let backend = Backend::open(&Options::default())?;
//!     let mut engine = Engine::new(&backend, &model, (800, 600), PictureOutputs::default())?;
//!     let image = engine.render(&view, &Settings::default())?;
//!     image.save_png(Path::new("horse.png"))?;
//!     Ok(())
//! }
//! ```
//!
//! `examples/headless.rs` is the same with arguments. Errors are [`Error`], one variant a layer. Long work takes a
//! [`progress::Progress`], which hears how far it is and can cancel it.
//!
//! # Features
//!
//! `viewer` (default) adds the window to the program. Without default features everything headless builds with
//! rustc and a C++ compiler alone. `rivals` adds a ray caster and simplified meshes to what `surfel bench` compares.

pub mod abi;
pub mod bench;
pub mod chart;
pub mod cut;
pub mod error;
pub mod failures;
pub mod generate;
pub mod gpu;
pub mod image;
pub mod input;
pub mod math;
pub mod measure;
pub mod mesh;
pub mod pack;
pub mod progress;
pub mod render;
pub mod scenes;
mod simd;
mod threads;
pub mod tree;
#[cfg(feature = "viewer")]
pub mod viewer;

pub use error::Error;
