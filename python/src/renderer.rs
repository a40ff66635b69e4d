//! Renderers: a model made ready for pictures of one size.

use crate::camera::{PyCamera, checked_size};
use crate::errors::{DeviceError, raise, wrong};
use crate::look;
use crate::model::PyModel;
use crate::picture::PyPicture;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex, PoisonError};
use surfel::OpenedModel;
use surfel::gpu::{DeviceOptions, Error as GpuError, Gpu};
use surfel::math::camera::Camera;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Method, PictureOutputs, Settings, SplatKind};

self_cell::self_cell!(
    /// An engine with the model that it draws.
    struct EngineCell {
        owner: Arc<OpenedModel>,
        #[not_covariant]
        dependent: Engine,
    }
);

/// Draws pictures of one model in one size.
#[pyclass(frozen, name = "Renderer", module = "surfel")]
pub(crate) struct PyRenderer {
    engine: Mutex<EngineCell>,
    backend: Backend,
    size: (u32, u32),
    outputs: PictureOutputs,
}

/// Opens the backend of a name.
fn open_backend(name: &str, options: &DeviceOptions) -> PyResult<Backend> {
    let is_named = options.device.is_some();
    match name {
        "cpu" | "reference" if is_named => Err(wrong("backend cpu and reference have no device")),
        "cpu" => Ok(Backend::Cpu),
        "reference" => Ok(Backend::Reference),
        "vulkan" => Ok(Backend::Vulkan(Gpu::open(options).map_err(raise)?)),
        "auto" => match Backend::open(options) {
            Err(GpuError::NoLoader(_) | GpuError::NoDevice(_))
                if !is_named && !options.validation =>
            {
                Ok(Backend::WithoutDevice)
            }
            opened => opened.map_err(raise),
        },
        _ => Err(wrong(format!(
            "backend '{name}': one of auto, vulkan, cpu, reference"
        ))),
    }
}

/// Threshold of the program's smooth pictures of surfaces by squares, pixels.
const SMOOTH_THRESHOLD_PX: f32 = 0.125;

/// Side of the grid of samples in a pixel.
fn side_of(samples: u32) -> PyResult<u32> {
    let side = samples.isqrt();
    if (1..=8).contains(&side) && side * side == samples {
        Ok(side)
    } else {
        Err(wrong(format!("samples {samples}: a square from 1 to 64")))
    }
}

impl PyRenderer {
    /// Readies `model`; `depth` and `normals` say what pictures have beside colors.
    pub(crate) fn of(
        py: Python<'_>,
        model: &PyModel,
        size: (u32, u32),
        (depth, normal): (bool, bool),
        (backend, device, validation): (&str, Option<Bound<'_, PyAny>>, bool),
    ) -> PyResult<Self> {
        let size = checked_size(size)?;
        let options = DeviceOptions {
            device: device.map(|d| d.str().map(|d| d.to_string())).transpose()?,
            validation,
            ..DeviceOptions::default()
        };
        let outputs = PictureOutputs {
            depth,
            normal,
            values: false,
        };
        let opened = Arc::clone(&model.opened);
        py.detach(|| {
            let backend = open_backend(backend, &options)?;
            let engine = EngineCell::try_new(opened, |opened| {
                Engine::new(&backend, &opened.model, size, outputs)
            });
            Ok(Self {
                engine: Mutex::new(engine.map_err(raise)?),
                backend,
                size,
                outputs,
            })
        })
    }

    /// Draws one picture without Python's lock.
    pub(crate) fn draw(
        &self,
        py: Python<'_>,
        camera: &Camera,
        samples: u32,
        look: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyPicture> {
        let mut look = look::settings(look)?;
        let side = side_of(samples)?;
        if side > 1 && (self.outputs.depth || self.outputs.normal) {
            return Err(wrong(
                "depth and normals are those of one sample at the pixel's middle",
            ));
        }
        if (camera.width, camera.height) != self.size {
            return Err(wrong(format!(
                "the camera's picture is {} x {}, the renderer's {} x {}",
                camera.width, camera.height, self.size.0, self.size.1
            )));
        }
        py.detach(|| {
            // An engine that panicked has told so; its next picture begins anew.
            let mut cell = self.engine.lock().unwrap_or_else(PoisonError::into_inner);
            let opened = Arc::clone(cell.borrow_owner());
            let settings = &mut look.settings;
            let has_squares = settings.method == Method::Pop && settings.splat == SplatKind::Square;
            if side > 1 && !look.has_threshold && has_squares && opened.model.kind().is_surface() {
                settings.threshold_px = SMOOTH_THRESHOLD_PX;
            }
            let view = camera.view(opened.model.origin).map_err(raise)?;
            let settings: &Settings = settings;
            let picture = cell.with_dependent_mut(|_, engine| {
                let times = engine.draw(&view, settings).map_err(raise)?;
                if side == 1 {
                    let image = engine.read(&view).map_err(raise)?;
                    return Ok(PyPicture::single(image, &times));
                }
                let mean = engine.supersample(&view, settings, side).map_err(raise)?;
                Ok(PyPicture::mean(mean, &times))
            });
            self.validated()?;
            picture
        })
    }

    /// An error if the validation layer had anything to say.
    fn validated(&self) -> PyResult<()> {
        let Some(gpu) = self.backend.device() else {
            return Ok(());
        };
        match gpu.messages().list().first() {
            None => Ok(()),
            Some(first) => Err(DeviceError::new_err(format!(
                "the validation layer: {}: {}",
                first.id, first.text
            ))),
        }
    }
}

#[pymethods]
impl PyRenderer {
    #[new]
    #[pyo3(signature = (model, size=(500, 500), *, depth=false, normals=false, backend="auto", device=None, validate=false))]
    #[expect(clippy::too_many_arguments, reason = "they have names in Python")]
    fn new(
        py: Python<'_>,
        model: &PyModel,
        size: (u32, u32),
        depth: bool,
        normals: bool,
        backend: &str,
        device: Option<Bound<'_, PyAny>>,
        validate: bool,
    ) -> PyResult<Self> {
        Self::of(
            py,
            model,
            size,
            (depth, normals),
            (backend, device, validate),
        )
    }

    /// Draws one picture with a camera of the renderer's size.
    #[pyo3(signature = (camera, *, samples=1, **look))]
    fn render(
        &self,
        py: Python<'_>,
        camera: &PyCamera,
        samples: u32,
        look: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyPicture> {
        self.draw(py, &camera.camera, samples, look)
    }

    /// Name of the device; "cpu" or "reference" without one.
    #[getter]
    fn device(&self) -> &str {
        self.backend.name()
    }

    /// Width and height of the pictures.
    #[getter]
    fn size(&self) -> (u32, u32) {
        self.size
    }
}

/// Names of the Vulkan devices that can draw.
#[pyfunction]
pub(crate) fn devices(py: Python<'_>) -> PyResult<Vec<String>> {
    match py.detach(surfel::gpu::device::list) {
        Ok(found) => {
            let usable = found.into_iter().filter(|device| device.unusable.is_none());
            Ok(usable.map(|device| device.name).collect())
        }
        Err(GpuError::NoLoader(_) | GpuError::NoDevice(_)) => Ok(Vec::new()),
        Err(error) => Err(raise(error)),
    }
}
