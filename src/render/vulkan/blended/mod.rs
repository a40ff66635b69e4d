//! Blended splats: a depth pass, an accumulation of weighted colors, and a division.

pub(crate) mod compute;
pub mod filtered;
pub mod fuzzy;
