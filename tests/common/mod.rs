//! The harness of the tests that touch a device: a headless device with validation and synchronization
//! validation, whose messages fail the test, teardown included.
#![allow(dead_code, reason = "each test binary uses a part of the harness")]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::path::{Path, PathBuf};
use std::sync::Arc;
use surfel::generate::{Shape, Spec};
use surfel::gpu::messages::Messages;
use surfel::gpu::{Gpu, Options};
use surfel::math::camera::{Camera, View};
use surfel::progress::Silent;
use surfel::tree::{self, BuildOptions, Model};

/// A device under validation. Dropping it (last) checks that not one message was left.
pub(crate) struct Device {
    gpu: Option<Arc<Gpu>>,
    messages: Messages,
}

impl Device {
    /// Opens a device, or says why there is none; with `SURFEL_REQUIRE_DEVICE=1` that is a failure.
    pub(crate) fn open() -> Option<Self> {
        Self::open_with(Options::default())
    }

    /// As [`Device::open`], with further options.
    pub(crate) fn open_with(options: Options) -> Option<Self> {
        let options = Options {
            validation: true,
            ..options
        };
        match Gpu::open(&options) {
            Ok(gpu) => Some(Self {
                messages: gpu.messages().clone(),
                gpu: Some(gpu),
            }),
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

    /// The messages so far, taken: for tests that plant a fault.
    pub(crate) fn take_messages(&self) -> Vec<surfel::gpu::messages::Message> {
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

/// Folder of the real models, or one printed line and `None`.
pub(crate) fn models() -> Option<PathBuf> {
    let folder = std::env::var_os("SURFEL_MODELS").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/models"),
        PathBuf::from,
    );
    if folder.is_dir() {
        Some(folder)
    } else {
        eprintln!(
            "real models are absent ({}): nothing tested with them",
            folder.display()
        );
        None
    }
}

/// A generated model with its tree.
pub(crate) fn generated(shape: Shape, triangles: u64) -> Model {
    let spec = Spec::with_triangles(shape, triangles).unwrap();
    tree::build(
        surfel::generate::mesh(&spec),
        &BuildOptions::default(),
        &Silent,
    )
    .unwrap()
}

/// A real model with its tree, or `None` when the models are absent.
pub(crate) fn real(name: &str) -> Option<Model> {
    let mesh = load(&models()?.join(name));
    Some(tree::build(mesh, &BuildOptions::default(), &Silent).unwrap())
}

fn load(path: &Path) -> surfel::mesh::Mesh {
    let options = surfel::input::Options::default();
    surfel::input::load(path, &options, &Silent)
        .unwrap_or_else(|e| panic!("{e}"))
        .mesh
}

/// A model without perspective, off the middle of the picture, with pixels that are not square.
pub(crate) fn orthographic(model: &Model, size: (u32, u32)) -> View {
    let center = model.origin + model.orbit_center.as_dvec3();
    let mut camera = Camera::orbit(size, center, f64::from(model.orbit_radius), 0.5, 0.3, 0.7);
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
    Camera::orbit(
        size,
        model.origin + model.orbit_center.as_dvec3(),
        f64::from(model.orbit_radius),
        azimuth.to_radians(),
        elevation.to_radians(),
        fill,
    )
    .view(model.origin)
    .unwrap()
}
