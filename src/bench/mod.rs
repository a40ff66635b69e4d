//! `surfel bench`: every figure that the program has to reach, measured in one run, with pass or miss.
//!
//! A [`BenchSession`] is a device with what it costs there ([`calibrate`]) and how fast it moves bytes. The parts each measure a
//! [`BenchCase`] and return [`BenchFigure`]s: [`rates`] what a primitive and an empty frame cost, [`cuts`] the cut on the processor,
//! [`frames`] whole frames beside plain triangles, [`accuracy`] time against error beside ray casting and simplified
//! meshes ([`rivals`]), [`pictures`] the default picture beside one exact sample, [`pages`] paged files beside whole trees,
//! [`growth`] one view of ever larger models. [`verdict`] decides, [`report`] writes.
//!
//! What is compared is drawn in turn, frame by frame, so that what slows the machine down for a while slows all of it.
//! `docs/PERFORMANCE.md` says what the figures mean.

pub mod accuracy;
pub mod calibrate;
pub mod cases;
pub mod cuts;
pub mod frames;
pub mod growth;
pub mod memory;
pub mod pages;
pub mod pictures;
pub mod rates;
pub mod report;
pub mod rivals;
pub mod verdict;

pub use cases::{BenchCase, BenchLine, BenchPlan};
pub use report::{BenchFigure, BenchPlace, RunFacts};

use crate::gpu::Gpu;
use crate::render::PictureOutputs;
use crate::render::engine::{Backend, Engine};
use crate::tree::Model;
use calibrate::{CalibrationPart, DeviceCalibration, FoundCalibration};
use rates::MemoryBandwidth;
use std::path::Path;
use std::sync::Arc;

/// Why something could not be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// The device could not do what was asked.
    #[error(transparent)]
    Gpu(#[from] crate::gpu::Error),
    /// Pictures could not be compared.
    #[error(transparent)]
    Image(#[from] crate::image::Error),
    /// The model has no camera that shows it.
    #[error(transparent)]
    Camera(#[from] crate::math::camera::CameraError),
    /// A model could not be generated.
    #[error(transparent)]
    Generate(#[from] crate::generate::GenerateError),
    /// A tree could not be built.
    #[error(transparent)]
    Tree(#[from] crate::tree::Error),
    /// A model that was written could not be read.
    #[error(transparent)]
    Input(#[from] crate::input::Error),
    /// A file could not be built piece by piece.
    #[error(transparent)]
    External(#[from] crate::pages::external::ExternalError),
    /// A temporary file could not be made or read.
    #[error("a temporary file: {0}")]
    Temporary(#[from] std::io::Error),
    /// Less memory is free than a model needs.
    #[error(
        "{model} needs about {needed} bytes of memory, and {available} are free; leave it out or close something"
    )]
    Memory {
        /// The model.
        model: String,
        /// Bytes that building and drawing it takes at most.
        needed: u64,
        /// Bytes that are free.
        available: u64,
    },
    /// Another crate could not do its part of a comparison.
    #[error("{name}: {cause}")]
    Rival {
        /// Which.
        name: &'static str,
        /// What it says.
        cause: String,
    },
    /// The user asked for the end.
    #[error("cancelled")]
    Cancelled,
}

/// Threads that the machine runs at once.
pub fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// What all parts of a run share.
#[derive(Debug)]
pub struct BenchSession {
    /// The device.
    pub backend: Backend,
    /// Calibration of the device, measured anew for this run.
    pub found: FoundCalibration,
    /// How fast bytes move.
    pub bandwidth: MemoryBandwidth,
}

impl BenchSession {
    /// Measures a device's costs and bandwidths, and keeps the costs in `folder`.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn open(gpu: &Arc<Gpu>, folder: Option<&Path>) -> Result<Self, BenchError> {
        Ok(Self {
            backend: Backend::Device(gpu.clone()),
            found: DeviceCalibration::kept(gpu, folder, &CalibrationPart::ALL, true)?,
            bandwidth: MemoryBandwidth::measure(gpu)?,
        })
    }

    /// Tells whether the device is the processor itself.
    pub fn is_software(&self) -> bool {
        self.backend.device().is_some_and(|gpu| gpu.info().is_cpu())
    }

    /// Draws a model with what was calibrated.
    ///
    /// # Errors
    /// As [`Engine::new`].
    pub fn engine<'m>(&self, model: &'m Model, size: (u32, u32)) -> Result<Engine<'m>, BenchError> {
        let mut engine = Engine::new(&self.backend, model, size, PictureOutputs::default())?;
        engine.set_costs(Some(self.found.calibration.costs));
        Ok(engine)
    }

    /// What measured; `settings` are the options of the run.
    pub fn about(&self, settings: String) -> RunFacts {
        RunFacts {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: crate::measure::COMMIT.into(),
            device: self.backend.name().into(),
            driver: self
                .backend
                .device()
                .map_or_else(String::new, |gpu| gpu.info().driver.clone()),
            threads: threads(),
            settings,
        }
    }
}
