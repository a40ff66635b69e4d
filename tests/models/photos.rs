//! Photographs on models: real scenes of calibrated photographs, where they are, and generated ones.

mod bad_input;
mod castle;
mod conventions;
mod scenes;
mod walks;
