//! Errors of the library as exceptions.

use pyo3::exceptions::{PyException, PyFileNotFoundError, PyKeyboardInterrupt};
use pyo3::{PyErr, create_exception};
use std::error::Error as StdError;
use std::io;

create_exception!(
    surfel,
    Error,
    PyException,
    "Anything that surfel refuses or that fails."
);
create_exception!(
    surfel,
    InputError,
    Error,
    "A file, a value or an option is wrong."
);
create_exception!(
    surfel,
    DeviceError,
    Error,
    "The device or the system failed."
);

/// An error of values that were given.
pub(crate) fn wrong(text: impl Into<String>) -> PyErr {
    InputError::new_err(text.into())
}

/// The exception of an error of the library. A file that is not there is Python's own exception.
pub(crate) fn raise(error: impl Into<surfel::Error>) -> PyErr {
    use surfel::Error as E;
    use surfel::gpu::Error as G;
    let error = error.into();
    if error.is_cancelled() {
        return PyKeyboardInterrupt::new_err(());
    }
    let text = error.to_string();
    if is_missing_file(&error) {
        return PyFileNotFoundError::new_err(text);
    }
    match &error {
        E::Gpu(G::UnknownDevice { .. } | G::Limit { .. } | G::Unsupported { .. }) => wrong(text),
        E::Gpu(_) | E::Profile(_) | E::Bench(_) => DeviceError::new_err(text),
        E::Image(surfel::image::Error::Read { .. } | surfel::image::Error::Size { .. }) => {
            wrong(text)
        }
        E::Image(_) => DeviceError::new_err(text),
        _ => wrong(text),
    }
}

/// Whether the cause of an error is a file that is not there.
fn is_missing_file(error: &surfel::Error) -> bool {
    let mut cause: Option<&dyn StdError> = Some(error);
    while let Some(error) = cause {
        let io = error.downcast_ref::<io::Error>();
        if io.is_some_and(|e| e.kind() == io::ErrorKind::NotFound) {
            return true;
        }
        cause = error.source();
    }
    false
}
