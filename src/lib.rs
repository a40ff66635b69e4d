//! `surfel` draws enormous meshes and scans with points, triangles or both.
//!
//! A model is ordered once into a tree of bounding spheres. Each view then takes from the tree only what it
//! needs: a part that is small on screen becomes one square splat, a triangle that is large stays a triangle. The
//! cost follows the picture, not the model. A Vulkan 1.3 device draws, hardware or software; the processor's own renderer takes its
//! place where that is faster or where there is no Vulkan.
//!
//! The folders follow the data: [`mod@open`] is the one door. It lets [`input`] read a file into a [`mesh::Mesh`] (or
//! [`generate`] make one), and [`tree`] order that into a bounding-sphere tree. [`cut`] chooses the nodes that a view
//! needs, [`pack`] packs them into lists of plain records, [`render`] turns the lists into a picture on the device or on
//! the CPU, [`image`] keeps and compares pictures, [`measure`] keeps times, counts and errors, [`chart`] lays times and
//! errors side by side, [`mod@bench`] holds the times to what they have to reach. [`scenes`] are models that methods fail
//! at, [`stability`] says how far and why. [`photos`] puts calibrated photographs on what was drawn. [`gpu`] is the only place with Vulkan.
//!
//! # From a file to a picture, without a window
//!
//! ```no_run
//! use surfel::progress::SilentProgress;
//! use surfel::render::Settings;
//! use surfel::render::engine::{Backend, Engine};
//!
//! fn main() -> Result<(), surfel::Error> {
//!     let model = surfel::open("horse.ply", &Default::default(), &SilentProgress)?.model;
//!     let camera = model.orbit_camera((800, 600), 0.5, 0.35, 1.0);
//!     let backend = Backend::open(&Default::default())?;
//!     let mut engine = Engine::new(&backend, &model, (800, 600), Default::default())?;
//!     let view = camera.view(model.origin)?;
//!     let image = engine.smooth(&view, &Settings::for_people(&model))?.to_image();
//!     Ok(image.save_png("horse.png".as_ref())?)
//! }
//! ```
//!
//! [`open()`] builds the tree where the file has none, and says what the file was and what was left out. The camera looks
//! from azimuth 0.5 and elevation 0.35 radians; with fill 1 the bounding sphere fills the picture. The device is the best
//! one here; with `device: Some("reference".into())` in [`gpu::DeviceOptions`] the processor draws, without Vulkan.
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
pub mod free_memory;
pub mod generate;
pub mod gpu;
pub mod image;
pub mod input;
pub mod math;
pub mod measure;
pub mod mesh;
pub mod open;
pub mod oriented;
pub mod pack;
pub mod pages;
pub mod patches;
pub mod photos;
mod printable;
pub mod progress;
pub mod projective;
pub mod render;
pub mod scenes;
mod simd;
pub mod stability;
pub mod textures;
mod threads;
pub mod tree;
#[cfg(feature = "viewer")]
pub mod viewer;

pub use error::Error;
pub use open::{OpenOptions, OpenedModel, open};
