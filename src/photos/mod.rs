//! Calibrated photographs on a model: nothing is baked, photographs are chosen for the view and for what is left uncovered.
//!
//! [`formats`] reads a scene of photographs into the plain structures of [`scene`], in one convention; [`check`] finds wrong
//! conventions by the colors of sparse points. [`decode`] and [`library`] bring photographs into memory as [`pyramid`]s.
//!
//! The look is a pass over the pixels of a surface ([`surface`]), so it does not matter what drew that. [`choose`] picks
//! photographs for a frame, with directions corrected by [`hull`]; [`look`] gives each pixel its color from them, with
//! visibility by [`depth_map`] and exposures by [`gains`]. [`session`] holds what is loaded and drawn once,
//! [`stage`] has photographs for any view without a picture of it, and [`photo_loader`] brings them there on other threads. [`score`] leaves
//! one photograph out and predicts it from the others; [`walk`] measures how much the picture changes on the way between them.

pub use crate::projective::{depth_map, lens, look, projected, pyramid};

pub mod check;
pub mod choose;
pub mod decode;
pub mod error;
pub mod formats;
pub mod gains;
pub mod hull;
pub mod library;
pub mod metrics;
pub mod photo_loader;
pub mod prepared;
pub mod report;
pub mod scene;
pub mod score;
pub mod session;
pub mod stage;
pub mod surface;
pub mod walk;
