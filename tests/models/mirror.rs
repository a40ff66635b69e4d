//! The CPU mirror against closed forms and against the rules of rasterization, counted pixel by pixel.

mod averages;
mod closed_forms;
mod coverage;
mod packing;
mod scene;
mod surface;
