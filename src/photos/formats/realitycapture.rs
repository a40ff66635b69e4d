//! RealityCapture: a table of cameras (`.csv`), or an XMP file beside each photograph.
//!
//! The focal length is that of a film 36 mm wide, along the larger side of the photograph, and the principal point is
//! relative to the middle, in the same unit (the table) or in parts of the larger side (XMP). The size is the photograph's.
//! The table has heading, pitch and roll: with all 0 the camera looks straight down with north on top.

use super::source::{FoundPhoto, PhotoFolders, camera_of, read_text, rows};
use crate::photos::error::PhotoError;
use crate::photos::lens::{CameraLens, LensModel};
use crate::photos::scene::{PhotoScene, SceneFormat, ScenePhoto};
use glam::{DMat3, DVec3};
use std::path::{Path, PathBuf};

/// Width of the film that focal lengths are given for, millimeters.
const FILM_MM: f64 = 36.0;

/// First word of a table of cameras.
pub(super) const TABLE_MAGIC: &str = "#name";

const REMARK: &str = "the principal point is read relative to the middle of the photograph, in parts of its larger side; programs differ in this, so look at the correlation of the sparse points or at an overlay";

/// A camera whose size is known once its photograph is.
fn complete(mut photo: ScenePhoto) -> ScenePhoto {
    let camera = &mut photo.camera;
    let [w, h] = [camera.width, camera.height].map(f64::from);
    camera.principal = [camera.principal[0] + 0.5 * w, camera.principal[1] + 0.5 * h];
    photo
}

pub(super) fn read_table(path: &Path, folder: Option<&Path>) -> Result<PhotoScene, PhotoError> {
    let text = read_text(path)?;
    let mut lines = (1..).zip(text.lines());
    let header = lines.next().map_or("", |line| line.1);
    let names: Vec<String> = header
        .split(',')
        .map(|name| name.trim().to_lowercase())
        .collect();
    let folders = PhotoFolders::new(path, folder);
    let mut photos = Vec::new();
    for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let cells: Vec<&str> = line
            .split(',')
            .map(|cell| cell.trim().trim_matches('"'))
            .collect();
        let failed = |cause: String| PhotoError::at_line(path, number, cause);
        let cell = |name: &str| {
            let column = names.iter().position(|n| n == name)?;
            cells.get(column).copied()
        };
        let value = |name: &str| -> Result<Option<f64>, PhotoError> {
            let Some(cell) = cell(name).filter(|cell| !cell.is_empty()) else {
                return Ok(None);
            };
            match cell.parse::<f64>() {
                Ok(value) => Ok(Some(value)),
                Err(_) => Err(failed(format!("{name} is not a number: {cell}"))),
            }
        };
        let needed = |name: &str| -> Result<f64, PhotoError> {
            value(name)?.ok_or_else(|| failed(format!("it has no {name}")))
        };
        let or_zero = |name: &str| -> Result<f64, PhotoError> { Ok(value(name)?.unwrap_or(0.0)) };
        let name = cell(TABLE_MAGIC).filter(|name| !name.is_empty());
        let name = name.ok_or_else(|| failed("it has no name".into()))?;
        let [heading, pitch, roll] = [needed("heading")?, needed("pitch")?, needed("roll")?];
        let up = match value("alt")? {
            Some(altitude) => altitude,
            None => needed("z")?,
        };
        let axes = DMat3::from_rotation_z(-heading.to_radians())
            * DMat3::from_rotation_x(pitch.to_radians())
            * DMat3::from_rotation_y(roll.to_radians());
        let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let mut camera = camera_of(flip * axes.transpose(), DVec3::ZERO);
        camera.center = DVec3::new(needed("x")?, needed("y")?, up);
        camera.focal = [needed("f")? / FILM_MM; 2];
        camera.principal = [or_zero("px")? / FILM_MM, or_zero("py")? / FILM_MM];
        let [k1, k2, k3, k4] = [
            or_zero("k1")?,
            or_zero("k2")?,
            or_zero("k3")?,
            or_zero("k4")?,
        ];
        let coefficients = [k1, k2, or_zero("t1")?, or_zero("t2")?, k3, k4];
        camera.lens = CameraLens::new(LensModel::Brown, &coefficients);
        let mut photo = FoundPhoto::new(name, camera);
        photo.is_normalized = true;
        photos.push(complete(photo.locate(&folders)));
    }
    Ok(PhotoScene {
        format: SceneFormat::RealityCaptureCsv,
        path: path.to_owned(),
        photos,
        points: Vec::new(),
        remarks: vec![REMARK.to_owned()],
    })
}

/// Reads the XMP files of a folder.
pub(super) fn read_folder(folder: &Path, photos: Option<&Path>) -> Result<PhotoScene, PhotoError> {
    let files = xmp_files(folder)?;
    let mut found = Vec::new();
    let mut unregistered = Vec::new();
    for file in &files {
        let folders = PhotoFolders::new(file, photos);
        match read_xmp(file)? {
            Some(photo) => found.push(complete(photo.locate(&folders))),
            None => unregistered.push(file.display().to_string()),
        }
    }
    let mut remarks = vec![REMARK.to_owned()];
    if !unregistered.is_empty() {
        remarks.push(format!(
            "{} XMP files hold no pose and are left out: {}",
            unregistered.len(),
            unregistered.join(", ")
        ));
    }
    Ok(PhotoScene {
        format: SceneFormat::RealityCaptureXmp,
        path: folder.to_owned(),
        photos: found,
        points: Vec::new(),
        remarks,
    })
}

/// The XMP files of a folder, by name.
pub(super) fn xmp_files(folder: &Path) -> Result<Vec<PathBuf>, PhotoError> {
    let failed = |e: std::io::Error| PhotoError::Read {
        path: folder.to_owned(),
        cause: e.to_string(),
    };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("xmp"))
        {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn read_xmp(path: &Path) -> Result<Option<FoundPhoto>, PhotoError> {
    let text = read_text(path)?;
    // Adobe's wrapper may stand around it, with a byte order mark in an attribute.
    let failed = |cause: String| PhotoError::format(path, "the XMP", cause);
    let document = roxmltree::Document::parse(text.trim()).map_err(|e| failed(e.to_string()))?;
    // A value is an attribute or an element of its name, in whatever namespace.
    let value = |name: &str| {
        document.descendants().find_map(|node| {
            let attribute = node
                .attributes()
                .find(|a| a.name() == name)
                .map(|a| a.value());
            attribute.or_else(|| {
                (node.is_element() && node.tag_name().name() == name)
                    .then(|| node.text())
                    .flatten()
            })
        })
    };
    let list = |name: &str| -> Result<Option<Vec<f64>>, PhotoError> {
        let Some(text) = value(name) else {
            return Ok(None);
        };
        let numbers: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
        numbers
            .map(Some)
            .map_err(|_| failed(format!("{name} holds what is no number")))
    };
    let (Some(rotation), Some(position)) = (list("Rotation")?, list("Position")?) else {
        return Ok(None);
    };
    let (Ok(rotation), Ok(position)) = (
        <[f64; 9]>::try_from(rotation),
        <[f64; 3]>::try_from(position),
    ) else {
        return Err(failed("Rotation has 9 and Position 3 numbers".into()));
    };
    let one = |name: &str| -> Result<Option<f64>, PhotoError> {
        Ok(list(name)?.and_then(|values| values.first().copied()))
    };
    let focal =
        one("FocalLength35mm")?.ok_or_else(|| failed("it has no FocalLength35mm".into()))?;
    let mut camera = camera_of(rows(rotation), DVec3::ZERO);
    camera.center = DVec3::from(position);
    camera.focal = [focal / FILM_MM; 2];
    let [u, v] = [one("PrincipalPointU")?, one("PrincipalPointV")?];
    camera.principal = [u.unwrap_or(0.0), v.unwrap_or(0.0)];
    let model = value("DistortionModel").unwrap_or("perspective");
    // Also the name that the program misspells.
    let coefficients = match list("DistortionCoeficients")? {
        Some(values) => values,
        None => list("DistortionCoefficients")?.unwrap_or_default(),
    };
    let k = |i: usize| coefficients.get(i).copied().unwrap_or(0.0);
    camera.lens = match model {
        "perspective" => CameraLens::default(),
        "brown3" | "brown4" | "brown3t2" | "brown4t2" => {
            CameraLens::new(LensModel::Brown, &[k(0), k(1), k(4), k(5), k(2), k(3)])
        }
        _ => {
            return Err(PhotoError::Lens {
                path: path.to_owned(),
                model: model.to_owned(),
            });
        }
    };
    let stem = path
        .file_stem()
        .map(|name| name.to_string_lossy().into_owned());
    let mut photo = FoundPhoto::new(stem.unwrap_or_default(), camera);
    photo.is_normalized = true;
    Ok(Some(photo))
}
