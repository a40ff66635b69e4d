//! Cameras.

use crate::errors::{raise, wrong};
use glam::{DMat4, DVec3};
use numpy::{PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use std::path::PathBuf;
use surfel::math::camera::{Camera, MAX_SIDE};

/// A camera: the size of its picture and where it looks.
#[pyclass(frozen, name = "Camera", module = "surfel")]
pub(crate) struct PyCamera {
    pub(crate) camera: Camera,
}

/// Refuses sizes that no picture has.
pub(crate) fn checked_size((width, height): (u32, u32)) -> PyResult<(u32, u32)> {
    let is_side = |side| (1..=MAX_SIDE).contains(&side);
    if is_side(width) && is_side(height) {
        Ok((width, height))
    } else {
        Err(wrong(format!(
            "size {width} x {height}: both sides must be 1 to {MAX_SIDE}"
        )))
    }
}

impl PyCamera {
    /// A camera that can be drawn with, else an error.
    pub(crate) fn checked(camera: Camera) -> PyResult<Self> {
        camera.view(DVec3::ZERO).map_err(raise)?;
        Ok(Self { camera })
    }
}

/// A matrix as an array that multiplies column vectors: rows first.
fn array<'py>(py: Python<'py>, matrix: &DMat4) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rows = matrix.transpose().to_cols_array().to_vec();
    numpy::PyArray1::from_vec(py, rows).reshape([4, 4])
}

#[pymethods]
impl PyCamera {
    /// Looks from `eye` at `target`. `up` is the y axis where it is not given. `fov` is the vertical field of view in degrees;
    /// `near` and `far` bound what is seen.
    #[staticmethod]
    #[pyo3(signature = (eye, target, *, up=None, fov=45.0, near=None, far=None, size=(500, 500)))]
    fn look_at(
        eye: [f64; 3],
        target: [f64; 3],
        up: Option<[f64; 3]>,
        fov: f64,
        near: Option<f64>,
        far: Option<f64>,
        size: (u32, u32),
    ) -> PyResult<Self> {
        let up = up.unwrap_or([0.0, 1.0, 0.0]);
        let [eye, target, up] = [eye, target, up].map(DVec3::from);
        if ![eye, target, up].iter().all(|v| v.is_finite()) || up == DVec3::ZERO {
            return Err(wrong("eye, target and up must be finite, and up not zero"));
        }
        let distance = eye.distance(target);
        if distance <= 0.0 {
            return Err(wrong("eye and target are the same point"));
        }
        if !(fov > 0.0 && fov < 180.0) {
            return Err(wrong(format!(
                "fov {fov}: must be above 0 and below 180 degrees"
            )));
        }
        let near = near.unwrap_or(distance * 0.01);
        let far = far.unwrap_or(distance * 100.0);
        if !(near > 0.0 && near < far && far.is_finite()) {
            return Err(wrong(format!(
                "near {near} and far {far}: 0 < near < far is needed"
            )));
        }
        let size = checked_size(size)?;
        Self::checked(Camera::look_at(
            size,
            eye,
            target,
            up,
            fov.to_radians(),
            (near, far),
        ))
    }

    /// Reads a camera file, as `surfel render --save-camera` writes it.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        let camera = Camera::read(&path).map_err(raise)?;
        Ok(Self { camera })
    }

    /// Makes a camera of the text of a camera file.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        let camera = serde_json::from_str(text).map_err(|e| wrong(format!("no camera: {e}")))?;
        Self::checked(camera)
    }

    /// The text of a camera file.
    fn to_json(&self) -> PyResult<String> {
        serde_json::to_string_pretty(&self.camera).map_err(|e| wrong(e.to_string()))
    }

    /// The same camera for a picture of another size and the same shape.
    fn resized(&self, size: (u32, u32)) -> PyResult<Self> {
        let (width, height) = checked_size(size)?;
        let own = (self.camera.width, self.camera.height);
        if u64::from(width) * u64::from(own.1) != u64::from(height) * u64::from(own.0) {
            return Err(wrong(format!(
                "size {width} x {height} has another shape than the camera's {} x {}",
                own.0, own.1
            )));
        }
        let camera = Camera {
            width,
            height,
            ..self.camera.clone()
        };
        Ok(Self { camera })
    }

    /// Width and height of the picture in pixels.
    #[getter]
    fn size(&self) -> (u32, u32) {
        (self.camera.width, self.camera.height)
    }

    /// View space from world space, 4 x 4, for column vectors. View space looks along -z, y is up.
    #[getter]
    fn view<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array(py, &self.camera.view)
    }

    /// Clip space from view space, 4 x 4, for column vectors; depth 0 near, 1 far.
    #[getter]
    fn projection<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array(py, &self.camera.proj)
    }

    /// Position in the coordinates of the file.
    #[getter]
    fn eye(&self) -> (f64, f64, f64) {
        self.camera.view.inverse().w_axis.truncate().into()
    }

    fn __repr__(&self) -> String {
        let (x, y, z) = self.eye();
        format!(
            "<surfel.Camera {} x {} at ({x:.6}, {y:.6}, {z:.6})>",
            self.camera.width, self.camera.height
        )
    }
}
