//! The package `surfel` for Python: open a model, look at it, get arrays, compare pictures.
//!
//! Everything is done by the library of the program; this crate translates. Long work runs without Python's lock, so that
//! other threads go on.

mod camera;
mod compare;
mod errors;
mod look;
mod model;
mod picture;
mod renderer;

use pyo3::prelude::*;

/// The compiled part of the package.
#[pymodule]
mod _surfel {
    #[pymodule_export]
    use crate::camera::PyCamera;
    #[pymodule_export]
    use crate::compare::compare;
    #[pymodule_export]
    use crate::errors::{DeviceError, Error, InputError};
    #[pymodule_export]
    use crate::model::{PyModel, open};
    #[pymodule_export]
    use crate::picture::PyPicture;
    #[pymodule_export]
    use crate::renderer::{PyRenderer, devices};

    use pyo3::prelude::*;

    /// Adds what is no class and no function.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
