//! Models and what is known about them.

use crate::camera::{PyCamera, checked_size};
use crate::errors::{raise, wrong};
use crate::picture::PyPicture;
use crate::renderer::PyRenderer;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;
use surfel::input::{ColorSetting, PointColoring};
use surfel::math::camera::Camera;
use surfel::math::up_axis::UpAxis;
use surfel::progress::Progress;
use surfel::{OpenOptions, OpenedModel};

/// A model that was opened.
#[pyclass(frozen, name = "Model", module = "surfel")]
pub(crate) struct PyModel {
    pub(crate) opened: Arc<OpenedModel>,
}

/// Progress that is cancelled by Ctrl-C in Python.
struct SignalProgress {
    start: Instant,
    /// Milliseconds since the start at which signals were looked at last.
    looked_ms: AtomicU64,
    is_interrupted: AtomicBool,
}

impl Progress for SignalProgress {
    fn stage(&self, _name: &str, _total: u64) {}

    fn advance(&self, _amount: u64) {}

    fn is_cancelled(&self) -> bool {
        let now = self.start.elapsed().as_millis() as u64;
        if now > self.looked_ms.load(Ordering::Relaxed) + 100 {
            self.looked_ms.store(now, Ordering::Relaxed);
            // Python tells its main thread alone; in any other this says nothing.
            if Python::attach(|py| py.check_signals()).is_err() {
                self.is_interrupted.store(true, Ordering::Relaxed);
            }
        }
        self.is_interrupted.load(Ordering::Relaxed)
    }
}

/// Opens a model: a file, `generate:SHAPE[:TRIANGLES]` or `scene:NAME`, and orders it into its tree.
///
/// `crease` is the angle in degrees above which edges are sharp; None keeps the normals of the file, else 40. `color_by`
/// colors points by "height" or an attribute of the file.
#[pyfunction]
#[pyo3(signature = (path, *, weld=false, crease=None, textures=true, color_by=None, color_range=None, frame_all=false))]
#[expect(clippy::too_many_arguments, reason = "they have names in Python")]
pub(crate) fn open(
    py: Python<'_>,
    path: PathBuf,
    weld: bool,
    crease: Option<f32>,
    textures: bool,
    color_by: Option<&str>,
    color_range: Option<(f64, f64)>,
    frame_all: bool,
) -> PyResult<PyModel> {
    if path.as_os_str() == "-" {
        return Err(wrong("standard input is Python's own; give a file"));
    }
    let mut options = OpenOptions {
        frame_all,
        ..OpenOptions::default()
    };
    if crease.is_some_and(|degrees| !(0.0..=180.0).contains(&degrees)) {
        return Err(wrong("crease: an angle from 0 to 180 degrees"));
    }
    options.tree.crease_degrees = crease;
    options.input.weld = weld;
    options.input.textures = textures;
    options.input.color = match (color_by, color_range) {
        (Some(name), range) => Some(ColorSetting {
            by: match name {
                "height" => PointColoring::Height,
                name => PointColoring::Attribute(name.to_owned()),
            },
            range: match range {
                Some((low, high)) if !low.is_finite() || !high.is_finite() || low >= high => {
                    return Err(wrong("color_range: two numbers, the smaller first"));
                }
                range => range.map(|(low, high)| [low, high]),
            },
        }),
        (None, Some(_)) => return Err(wrong("color_range goes with color_by")),
        (None, None) => None,
    };
    let progress = SignalProgress {
        start: Instant::now(),
        looked_ms: AtomicU64::new(0),
        is_interrupted: AtomicBool::new(false),
    };
    let opened = py
        .detach(|| surfel::open(&path, &options, &progress))
        .map_err(raise)?;
    Ok(PyModel {
        opened: Arc::new(opened),
    })
}

/// The axis of a name; of "auto" the one that the model has.
fn axis(name: &str, opened: &OpenedModel) -> PyResult<UpAxis> {
    match name {
        "auto" => Ok(opened.up.axis),
        "x" => Ok(UpAxis::X),
        "y" => Ok(UpAxis::Y),
        "z" => Ok(UpAxis::Z),
        _ => Err(wrong(format!("up '{name}': one of auto, x, y, z"))),
    }
}

impl PyModel {
    fn world(&self, v: glam::Vec3) -> (f64, f64, f64) {
        (self.opened.model.origin + v.as_dvec3()).into()
    }

    /// The camera of the standard orbit.
    fn orbit_camera(
        &self,
        (azimuth, elevation, fill): (f64, f64, f64),
        up: &str,
        size: (u32, u32),
    ) -> PyResult<Camera> {
        let size = checked_size(size)?;
        if !(azimuth.is_finite() && (-90.0..=90.0).contains(&elevation)) {
            return Err(wrong("elevation must be -90 to 90 degrees, azimuth finite"));
        }
        if !(fill > 0.0 && fill.is_finite()) {
            return Err(wrong(format!("fill {fill}: must be above 0")));
        }
        let sphere = self.opened.model.orbit_sphere();
        let up = axis(up, &self.opened)?;
        let angles = (azimuth.to_radians(), elevation.to_radians(), fill);
        Ok(Camera::orbit_about(
            up,
            size,
            sphere.center,
            sphere.radius,
            angles,
        ))
    }
}

#[pymethods]
impl PyModel {
    /// The source as it was named.
    #[getter]
    fn name(&self) -> &str {
        &self.opened.name
    }

    /// Format of the file, such as "PLY (binary)".
    #[getter]
    fn format(&self) -> &str {
        self.opened.format.name()
    }

    /// "surface", "points" or "empty".
    #[getter]
    fn kind(&self) -> &str {
        use surfel::tree::ModelKind;
        match self.opened.model.kind() {
            ModelKind::Surface => "surface",
            ModelKind::Points => "points",
            ModelKind::Empty => "empty",
        }
    }

    /// Number of vertices.
    #[getter]
    fn vertex_count(&self) -> usize {
        self.opened.model.vertices.len()
    }

    /// Number of triangles.
    #[getter]
    fn triangle_count(&self) -> usize {
        self.opened.model.triangles.len()
    }

    /// Number of nodes of the tree, with its leaves.
    #[getter]
    fn node_count(&self) -> usize {
        let tree = &self.opened.model.tree;
        tree.nodes.len() + tree.leaves.len()
    }

    /// Smallest and largest corner in the coordinates of the file.
    #[getter]
    fn bounds(&self) -> ((f64, f64, f64), (f64, f64, f64)) {
        let model = &self.opened.model;
        (self.world(model.min), self.world(model.max))
    }

    /// Middle of what the orbit frames, in the coordinates of the file.
    #[getter]
    fn center(&self) -> (f64, f64, f64) {
        self.opened.model.orbit_sphere().center.into()
    }

    /// Largest distance of a vertex from the center.
    #[getter]
    fn radius(&self) -> f64 {
        self.opened.model.orbit_sphere().radius
    }

    /// The axis that is up: "x", "y" or "z".
    #[getter]
    fn up(&self) -> &str {
        self.opened.up.axis.name()
    }

    /// The surface is closed and its triangles face outward.
    #[getter]
    fn is_closed(&self) -> bool {
        self.opened.model.is_closed
    }

    /// The file has colors or images.
    #[getter]
    fn has_colors(&self) -> bool {
        self.opened.model.has_colors
    }

    /// What was repaired or left out, a sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.opened
            .warnings
            .iter()
            .map(ToString::to_string)
            .collect()
    }

    /// Memory of model and tree in bytes.
    #[getter]
    fn memory_bytes(&self) -> u64 {
        let memory = self.opened.model.memory_bytes();
        memory.total()
    }

    /// A camera that looks at the model's middle from azimuth and elevation in degrees; with fill 1 the bounding sphere fills
    /// the picture.
    #[pyo3(signature = (azimuth=30.0, elevation=20.0, fill=1.0, *, up="auto", size=(500, 500)))]
    fn orbit(
        &self,
        azimuth: f64,
        elevation: f64,
        fill: f64,
        up: &str,
        size: (u32, u32),
    ) -> PyResult<PyCamera> {
        PyCamera::checked(self.orbit_camera((azimuth, elevation, fill), up, size)?)
    }

    /// The camera that a built-in scene comes with; None for any other model.
    #[getter]
    fn scene_camera(&self) -> Option<PyCamera> {
        let camera = self.opened.scene.as_ref()?.camera.clone();
        Some(PyCamera { camera })
    }

    /// Draws one picture. For several of one size a Renderer is faster.
    #[pyo3(signature = (camera=None, *, samples=1, depth=false, normals=false, backend="auto", device=None, validate=false, **look))]
    #[expect(clippy::too_many_arguments, reason = "they have names in Python")]
    fn render(
        &self,
        py: Python<'_>,
        camera: Option<&PyCamera>,
        samples: u32,
        depth: bool,
        normals: bool,
        backend: &str,
        device: Option<Bound<'_, PyAny>>,
        validate: bool,
        look: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyPicture> {
        let camera = match camera {
            Some(camera) => camera.camera.clone(),
            None => self.orbit_camera((30.0, 20.0, 1.0), "auto", (500, 500))?,
        };
        let size = (camera.width, camera.height);
        let renderer = PyRenderer::of(
            py,
            self,
            size,
            (depth, normals),
            (backend, device, validate),
        )?;
        renderer.draw(py, &camera, samples, look)
    }

    fn __repr__(&self) -> String {
        format!(
            "<surfel.Model {}: {}, {} vertices, {} triangles>",
            self.opened.name,
            self.kind(),
            self.vertex_count(),
            self.triangle_count()
        )
    }
}
