//! Comparison of pictures.

use crate::errors::{raise, wrong};
use crate::picture::PyPicture;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use surfel::image::{FloatImage, PixelSource, compare as differences};
use surfel::measure::{PIXELS_PER_DEGREE, flip, ssim};

/// A picture with what is known of its coverage.
struct GivenPicture {
    image: FloatImage,
    has_coverage: bool,
}

/// The picture in `given`: one of ours, an array of bytes or floats, or a file.
fn read(given: &Bound<'_, PyAny>) -> PyResult<GivenPicture> {
    if let Ok(picture) = given.cast::<PyPicture>() {
        let picture = picture.get();
        let image = picture.mean.clone();
        return Ok(GivenPicture {
            image: image.unwrap_or_else(|| picture.image.to_float()),
            has_coverage: true,
        });
    }
    if let Ok(array) = given.extract::<PyReadonlyArray3<'_, u8>>() {
        return of_array(&array, |byte| f32::from(byte) / 255.0);
    }
    if let Ok(array) = given.extract::<PyReadonlyArray3<'_, f32>>() {
        return of_array(&array, |value| value);
    }
    let path: PathBuf = given.extract().map_err(|_| {
        wrong("a picture is a surfel.Picture, an array (height, width, 3 or 4) of uint8 or float32, or a file")
    })?;
    let image = FloatImage::load(&path).map_err(raise)?;
    Ok(GivenPicture {
        image,
        has_coverage: false,
    })
}

fn of_array<T: numpy::Element + Copy>(
    array: &PyReadonlyArray3<'_, T>,
    value: impl Fn(T) -> f32,
) -> PyResult<GivenPicture> {
    let array = array.as_array();
    let &[height, width, channels] = array.shape() else {
        return Err(wrong("an array of three dimensions is needed"));
    };
    let side = |side: usize| u32::try_from(side).map_err(|_| wrong("the picture is too large"));
    if !(3..=4).contains(&channels) {
        return Err(wrong(format!("{channels} channels: 3 or 4 are needed")));
    }
    let mut color = Vec::with_capacity(width * height);
    for row in array.outer_iter() {
        for pixel in row.outer_iter() {
            let alpha = if channels == 4 { value(pixel[3]) } else { 1.0 };
            color.push([value(pixel[0]), value(pixel[1]), value(pixel[2]), alpha]);
        }
    }
    Ok(GivenPicture {
        image: FloatImage {
            width: side(width)?,
            height: side(height)?,
            color,
            ..FloatImage::default()
        },
        has_coverage: channels == 4,
    })
}

/// Compares a picture with its reference: FLIP, PSNR, SSIM, levels of 255, and where both have coverage what of the object
/// is missing. `flip_map` adds the FLIP difference of each pixel.
#[pyfunction]
#[pyo3(signature = (reference, picture, *, pixels_per_degree=PIXELS_PER_DEGREE, flip_map=false))]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    reference: &Bound<'py, PyAny>,
    picture: &Bound<'py, PyAny>,
    pixels_per_degree: f32,
    flip_map: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let (a, b) = (read(reference)?, read(picture)?);
    let (found, flips, structure) = py.detach(|| {
        let found = differences(&a.image, &b.image, 1.0).map_err(raise)?;
        let flips = flip(&a.image, &b.image, pixels_per_degree).map_err(raise)?;
        let structure = ssim(&a.image, &b.image).map_err(raise)?;
        Ok::<_, PyErr>((found, flips, structure))
    })?;
    let told = PyDict::new(py);
    told.set_item("flip", flips.mean)?;
    told.set_item("psnr", found.whole.psnr_db)?;
    told.set_item("ssim", structure)?;
    told.set_item("max_level", found.whole.max_level)?;
    told.set_item("mean_level", 255.0 * found.whole.mean_abs)?;
    told.set_item("pixels_past_a_level", found.whole.past_level)?;
    if a.has_coverage && b.has_coverage {
        told.set_item("object_psnr", found.object.psnr_db)?;
        told.set_item("object_pixels", found.object.pixels)?;
        told.set_item("missing", found.missing)?;
        told.set_item("extra", found.extra)?;
        told.set_item("hole_pixels", found.hole_pixels)?;
        told.set_item("silhouette_iou", found.silhouette_iou)?;
    }
    if flip_map {
        let [width, height] = a.image.size().map(|side| side as usize);
        let map = PyArray1::from_vec(py, flips.map).reshape([height, width])?;
        told.set_item("flip_map", map)?;
    }
    Ok(told)
}
