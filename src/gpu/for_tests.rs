//! The device of unit tests: opened under validation, closed in silence.

use super::{DeviceOptions, Gpu};
use std::sync::Arc;

/// A device under validation, or none where none is required, said in one line.
///
/// # Panics
/// When there is none and `SURFEL_REQUIRE_DEVICE` is set.
pub(crate) fn device() -> Option<Arc<Gpu>> {
    let options = DeviceOptions {
        validation: true,
        ..DeviceOptions::default()
    };
    match Gpu::open(&options) {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            assert!(
                std::env::var_os("SURFEL_REQUIRE_DEVICE").is_none(),
                "a device is required here: {error}"
            );
            eprintln!("no device, nothing tested: {error}");
            None
        }
    }
}

/// Closes the device, where nothing else holds it.
///
/// # Panics
/// When validation has said anything of it.
pub(crate) fn close_in_silence(gpu: Arc<Gpu>) {
    let messages = gpu.messages().clone();
    drop(gpu);
    let messages = messages.take();
    assert!(messages.is_empty(), "validation said: {messages:#?}");
}
