//! The harness of the tests that touch a device: a headless device with validation and synchronization
//! validation, whose messages fail the test, teardown included.
#![allow(dead_code, reason = "each test binary uses a part of the harness")]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

pub(crate) mod models;
pub(crate) mod pictures;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use surfel::generate::{GeneratedShape, ShapeSpec};
use surfel::gpu::messages::LayerMessages;
use surfel::gpu::{DeviceOptions, Gpu};
use surfel::math::camera::View;
use surfel::progress::SilentProgress;
use surfel::tree::{self, BuildOptions, Model};

/// Of the device that was opened last; 8 before one is.
static SUBPIXEL_BITS: AtomicU32 = AtomicU32::new(8);

/// Whether the device that was opened last is a graphics card.
static IS_CARD: AtomicBool = AtomicBool::new(false);

/// Tells whether the device of this test is a graphics card. Such a one snaps sizes of points to steps (1/16 pixel on an NVIDIA
/// H200), interpolates with fewer places, and rounds quotients and roots otherwise than the processor.
pub(crate) fn is_card() -> bool {
    IS_CARD.load(Ordering::Relaxed)
}

/// Bits of a pixel to which the device of this test snaps positions. All tests of a process have the same device.
pub(crate) fn subpixel_bits() -> u32 {
    SUBPIXEL_BITS.load(Ordering::Relaxed)
}

/// A device under validation. Dropping it (last) checks that not one message was left.
pub(crate) struct Device {
    gpu: Option<Arc<Gpu>>,
    messages: LayerMessages,
}

impl Device {
    /// Opens a device, or says why there is none; with `SURFEL_REQUIRE_DEVICE=1` that is a failure.
    pub(crate) fn open() -> Option<Self> {
        Self::open_with(DeviceOptions::default())
    }

    /// As [`Device::open`], with further options.
    pub(crate) fn open_with(options: DeviceOptions) -> Option<Self> {
        let options = DeviceOptions {
            validation: true,
            ..options
        };
        match Gpu::open(&options) {
            Ok(gpu) => {
                SUBPIXEL_BITS.store(gpu.info().subpixel_bits, Ordering::Relaxed);
                // One that is told to be a card rounds as it did.
                if options.narrowed.is_none() {
                    IS_CARD.store(!gpu.info().is_cpu(), Ordering::Relaxed);
                }
                Some(Self {
                    messages: gpu.messages().clone(),
                    gpu: Some(gpu),
                })
            }
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

    pub(crate) fn gpu(&self) -> &Arc<Gpu> {
        self.gpu.as_ref().unwrap()
    }

    /// As [`Device::open`], and only a device that draws by compute; else one line says what is not tested.
    pub(crate) fn with_compute() -> Option<Self> {
        Self::open().filter(|device| device.paths().len() > 1)
    }

    /// The ways in which the device draws: by the rasterizer and, if it can, by compute; else one line says so.
    pub(crate) fn paths(&self) -> &'static [surfel::render::Path] {
        use surfel::render::Path::{Compute, Raster};
        if self.gpu().info().has_int64_atomics {
            &[Raster, Compute]
        } else {
            println!("no 64-bit atomics: what compute draws is not tested");
            &[Raster]
        }
    }

    /// The messages so far, taken: for tests that plant a fault.
    pub(crate) fn take_messages(&self) -> Vec<surfel::gpu::messages::LayerMessage> {
        self.messages.take()
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        if let Some(gpu) = self.gpu.take() {
            let root = Arc::try_unwrap(gpu);
            if !std::thread::panicking() {
                assert!(root.is_ok(), "a resource outlives its test");
            }
        }
        let messages = self.messages.take();
        if !std::thread::panicking() {
            assert!(messages.is_empty(), "validation said: {messages:#?}");
        }
    }
}

/// A generated model with its tree.
pub(crate) fn generated(shape: GeneratedShape, triangles: u64) -> Model {
    let spec = ShapeSpec::with_triangles(shape, triangles).unwrap();
    tree::build(
        surfel::generate::mesh(&spec),
        &BuildOptions::default(),
        &SilentProgress,
    )
    .unwrap()
}

/// Views from 25 degrees above at these azimuths (degrees) and fills, and one without perspective.
pub(crate) fn views_around(model: &Model, size: (u32, u32), at: &[(f64, f64)]) -> Vec<View> {
    let orbits = at
        .iter()
        .map(|&(azimuth, fill)| orbit(model, size, azimuth, 25.0, fill));
    orbits.chain([orthographic(model, size)]).collect()
}

/// The vertices of a generated mesh, with its tree.
pub(crate) fn cloud(shape: GeneratedShape, triangles: u64) -> Model {
    let spec = ShapeSpec::with_triangles(shape, triangles).unwrap();
    let mut mesh = surfel::generate::mesh(&spec);
    mesh.triangles.clear();
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// A real model with its tree, or `None` when it is absent.
pub(crate) fn real(name: &str) -> Option<Model> {
    Some(built(&models::real_file(name)?))
}

/// Our own scan with its tree, and those of the named real models that are there.
pub(crate) fn scans(real: &[&str]) -> Vec<(String, Model)> {
    let files = models::scan_files(real).into_iter();
    files.map(|(name, path)| (name, built(&path))).collect()
}

fn built(path: &Path) -> Model {
    tree::build(load(path), &BuildOptions::default(), &SilentProgress).unwrap()
}

/// Tells whether a device is the processor in disguise; where not, one line says that its shortcuts are not tested.
pub(crate) fn is_software(device: &Device) -> bool {
    let is_software = device.gpu().info().is_cpu();
    if !is_software {
        println!("this is no software device: what the processor does in its place is not tested");
    }
    is_software
}

pub(crate) fn load(path: &Path) -> surfel::mesh::Mesh {
    let options = surfel::input::ReadOptions::default();
    surfel::input::load(path, &options, &SilentProgress)
        .unwrap_or_else(|e| panic!("{e}"))
        .mesh
}

/// A model without perspective, off the middle of the picture, with pixels that are not square.
pub(crate) fn orthographic(model: &Model, size: (u32, u32)) -> View {
    let mut camera = model.orbit_camera(size, 0.5, 0.3, 0.7);
    let (near, far) = (0.1, 100.0);
    camera.proj = glam::DMat4::from_cols(
        glam::DVec4::X * 0.6,
        glam::DVec4::Y * 0.72,
        glam::DVec4::Z / (near - far),
        glam::DVec4::new(0.1, -0.05, near / (near - far), 1.0),
    );
    let view = camera.view(model.origin).unwrap();
    assert!(!view.is_perspective);
    view
}

/// The standard orbit of a model; angles in degrees.
pub(crate) fn orbit(
    model: &Model,
    size: (u32, u32),
    azimuth: f64,
    elevation: f64,
    fill: f64,
) -> View {
    model
        .orbit_camera(size, azimuth.to_radians(), elevation.to_radians(), fill)
        .view(model.origin)
        .unwrap()
}
