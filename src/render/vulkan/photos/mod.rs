//! Photographs on the surface: their pixels and depth maps on the device, and the pass over the picture that reads them.

pub(crate) mod pass;
pub(crate) mod pool;

use crate::projective::frame_photos::FramePhotos;
use pool::PhotoPool;
use std::sync::{Arc, Mutex};

/// Photographs of the next frames, and the memory of the device that they go to. Renderers of one device may share it, as long
/// as one after the other draws.
#[derive(Debug, Clone)]
pub struct DevicePhotos {
    /// Photographs that were chosen.
    pub frame: Arc<FramePhotos>,
    /// Where they lie.
    pub pool: Arc<Mutex<PhotoPool>>,
}
