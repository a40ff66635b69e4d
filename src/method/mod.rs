//! Methods: from draw lists to a picture.

pub mod mirror;
