//! Costs of drawing on a device, and the choices that follow from them. Pure: no device is asked.

pub(crate) mod choose;
pub mod model;
pub(crate) mod select_passes;
