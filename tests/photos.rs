//! Photographs on models: real scenes of calibrated photographs, where they are, and generated ones.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

#[path = "photos/bad_input.rs"]
mod bad_input;
#[path = "photos/castle.rs"]
mod castle;
#[path = "photos/conventions.rs"]
mod conventions;
#[path = "common/models.rs"]
mod models;
#[path = "photos/scenes.rs"]
mod scenes;
#[path = "photos/walks.rs"]
mod walks;
