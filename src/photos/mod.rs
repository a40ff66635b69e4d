//! Calibrated photographs on a model: nothing is baked, photographs are chosen for the view and for what is left uncovered.
//!
//! [`formats`] reads a scene of photographs into the plain structures of [`scene`], in one convention; [`check`] finds wrong
//! conventions by the colors of sparse points. [`decode`] and [`library`] bring photographs into memory as [`pyramid`]s.

pub mod check;
pub mod decode;
pub mod error;
pub mod formats;
pub mod lens;
pub mod library;
pub mod pyramid;
pub mod scene;
