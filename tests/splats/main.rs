//! Round and fuzzy splats: the device against the mirror, closed forms, and what must not change a picture.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

#[path = "../common/mod.rs"]
mod common;
mod fuzzy;
mod lists;
mod opaque;
mod oracle;
