//! Visibility splatting: visible centers, then a reconstruction of the pixels between them.

pub(crate) mod compute;
pub(crate) mod hardware;
mod pull_push;
mod targets;
