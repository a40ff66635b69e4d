//! Pictures as arrays.

use crate::errors::{raise, wrong};
use numpy::{Element, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use surfel::image::{FloatImage, Image};
use surfel::render::stats::FrameTimes;

/// A picture, row 0 on top.
#[pyclass(frozen, name = "Picture", module = "surfel")]
pub(crate) struct PyPicture {
    /// In bytes, with depth and normals where they were asked for.
    pub(crate) image: Image,
    /// What the bytes are rounded from, where several samples were averaged.
    pub(crate) mean: Option<FloatImage>,
    times: FrameTimes,
}

impl PyPicture {
    /// A picture of one sample a pixel.
    pub(crate) fn single(image: Image, times: &FrameTimes) -> Self {
        let times = times.clone();
        Self {
            image,
            mean: None,
            times,
        }
    }

    /// A mean of several.
    pub(crate) fn mean(mean: FloatImage, times: &FrameTimes) -> Self {
        Self {
            image: mean.to_image(),
            mean: Some(mean),
            times: times.clone(),
        }
    }

    fn shape(&self) -> [usize; 2] {
        [self.image.height as usize, self.image.width as usize]
    }

    fn plane<'py, T: Element>(
        &self,
        py: Python<'py>,
        values: Vec<T>,
    ) -> PyResult<Bound<'py, PyArray2<T>>> {
        PyArray1::from_vec(py, values).reshape(self.shape())
    }

    fn colors<'py, T: Element>(
        &self,
        py: Python<'py>,
        values: Vec<T>,
    ) -> PyResult<Bound<'py, PyArray3<T>>> {
        let [height, width] = self.shape();
        PyArray1::from_vec(py, values).reshape([height, width, 3])
    }
}

#[pymethods]
impl PyPicture {
    /// Red, green and blue as in a PNG of `surfel render`: uint8, (height, width, 3).
    #[getter]
    fn color<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let bytes = self.image.color.iter().flat_map(|&[r, g, b, _]| [r, g, b]);
        self.colors(py, bytes.collect())
    }

    /// What the color is rounded from, 1 is white: float32, (height, width, 3).
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let float = self.mean.clone().unwrap_or_else(|| self.image.to_float());
        let values = float.color.iter().flat_map(|&[r, g, b, _]| [r, g, b]);
        self.colors(py, values.collect())
    }

    /// Covered part of each pixel, 0 to 1: float32, (height, width).
    #[getter]
    fn coverage<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let float = self.mean.clone().unwrap_or_else(|| self.image.to_float());
        self.plane(py, float.color.iter().map(|c| c[3]).collect())
    }

    /// Distance along the view direction, infinite where nothing is: float32, (height, width). None unless asked for.
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        if self.image.depth.is_empty() {
            return Ok(None);
        }
        self.plane(py, self.image.depth.clone()).map(Some)
    }

    /// Unit normals in the world, zero where nothing is: float32, (height, width, 3). None unless asked for.
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f32>>>> {
        if self.image.normal.is_empty() {
            return Ok(None);
        }
        let values = self.image.normal.iter().flatten().copied().collect();
        self.colors(py, values).map(Some)
    }

    /// Counts of the cut and what was drawn, and times in milliseconds.
    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (t, c) = (&self.times, &self.times.counts);
        let told = PyDict::new(py);
        for (name, count) in [
            ("nodes_visited", c.nodes_visited),
            ("hidden", c.hidden),
            ("between", c.between),
            ("splats", c.splats),
            ("triangles", c.triangles),
            ("points", c.points),
            ("draw_list_bytes", c.draw_list_bytes),
        ] {
            told.set_item(name, count)?;
        }
        for (name, ms) in [
            ("frame_ms", t.frame_ms),
            ("cut_ms", t.cut_ms),
            ("pack_ms", t.pack_ms),
        ] {
            told.set_item(name, ms)?;
        }
        Ok(told)
    }

    /// Width and height in pixels.
    #[getter]
    fn size(&self) -> (u32, u32) {
        (self.image.width, self.image.height)
    }

    /// Writes the picture: .png (8 bit) or .exr (float).
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        py.detach(|| match (ending.as_deref(), &self.mean) {
            (Some("png"), _) => self.image.save_png(&path).map_err(raise),
            (Some("exr"), Some(mean)) => mean.save_exr(&path).map_err(raise),
            (Some("exr"), None) => self.image.save_exr(&path).map_err(raise),
            _ => Err(wrong(format!(
                "{}: the ending must be .png or .exr",
                path.display()
            ))),
        })
    }

    fn __repr__(&self) -> String {
        format!(
            "<surfel.Picture {} x {}>",
            self.image.width, self.image.height
        )
    }
}
