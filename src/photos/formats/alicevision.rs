//! AliceVision and Meshroom: `.sfm` and `.json`, whose numbers are written as text.
//!
//! A pose is a rotation (world to camera, nine numbers column by column) and a center. The principal point is relative to
//! the middle of the photograph since version 1.2.1, to its corner before. Focal lengths are in pixels, since 1.2.0 one
//! for each axis, or in millimeters with the width of the sensor.

use super::json::{name, number, numbers, read_json};
use super::source::{FoundPhoto, PhotoFolders, camera_of};
use crate::photos::error::PhotoError;
use crate::photos::lens::{CameraLens, LensModel};
use crate::photos::scene::{PhotoScene, PointView, SceneFormat, SparsePoint};
use glam::{DMat3, DVec3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Intrinsics of a camera.
struct SfmCamera {
    size: [u32; 2],
    focal: [f64; 2],
    principal: [f64; 2],
    lens: CameraLens,
}

fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value
        .get(key)
        .and_then(Value::as_array)
        .map_or(&[], Vec::as_slice)
}

fn id(value: &Value, key: &str) -> Option<String> {
    value.get(key).and_then(name)
}

pub(super) fn read(path: &Path, folder: Option<&Path>) -> Result<PhotoScene, PhotoError> {
    let json = read_json(path)?;
    let failed = |place: String, cause: &str| PhotoError::format(path, place, cause);
    let version: [f64; 3] = json.get("version").and_then(numbers).unwrap_or([0.0; 3]);
    // Lexical order of the three numbers.
    let is_centered = version >= [1.0, 2.0, 1.0];
    let mut cameras = BTreeMap::new();
    for (index, value) in list(&json, "intrinsics").iter().enumerate() {
        let place = format!("intrinsic {index}");
        let key = id(value, "intrinsicId").ok_or_else(|| failed(place, "it has no intrinsicId"))?;
        cameras.insert(key, read_camera(path, index, value)?);
    }
    let mut poses = BTreeMap::new();
    for (index, value) in list(&json, "poses").iter().enumerate() {
        let broken = || {
            failed(
                format!("pose {index}"),
                "it needs poseId, and pose.transform with a rotation of 9 and a center of 3 numbers",
            )
        };
        let transform = value.pointer("/pose/transform").ok_or_else(broken)?;
        let rotation = transform
            .get("rotation")
            .and_then(numbers::<9>)
            .ok_or_else(broken)?;
        let center = transform
            .get("center")
            .and_then(numbers::<3>)
            .ok_or_else(broken)?;
        let key = id(value, "poseId").ok_or_else(broken)?;
        poses.insert(
            key,
            (DMat3::from_cols_array(&rotation), DVec3::from(center)),
        );
    }
    let folders = PhotoFolders::new(path, folder);
    let (mut photos, mut photo_of, mut unregistered) = (Vec::new(), BTreeMap::new(), Vec::new());
    for (index, view) in list(&json, "views").iter().enumerate() {
        let place = || format!("view {index}");
        let file = view.get("path").and_then(Value::as_str);
        let file = file.ok_or_else(|| failed(place(), "it has no path"))?;
        // A view without a pose of its own has that of its number.
        let pose = id(view, "poseId")
            .or_else(|| id(view, "viewId"))
            .and_then(|key| poses.get(&key));
        let Some((rotation, center)) = pose else {
            unregistered.push(file.to_owned());
            continue;
        };
        let intrinsics = id(view, "intrinsicId").and_then(|key| cameras.get(&key));
        let intrinsics = intrinsics
            .ok_or_else(|| failed(place(), "its intrinsicId is not among the intrinsics"))?;
        let mut camera = camera_of(*rotation, DVec3::ZERO);
        camera.center = *center;
        [camera.width, camera.height] = intrinsics.size;
        (camera.focal, camera.principal) = (intrinsics.focal, intrinsics.principal);
        camera.lens = intrinsics.lens;
        let mut photo = FoundPhoto::new(file, camera);
        photo.is_centered = is_centered;
        if let Some(key) = id(view, "viewId") {
            photo_of.insert(key, photos.len() as u32);
        }
        photos.push(photo.locate(&folders));
    }
    let mut remarks = Vec::new();
    if !unregistered.is_empty() {
        remarks.push(format!(
            "{} photographs have no pose and are left out: {}",
            unregistered.len(),
            unregistered.join(", ")
        ));
    }
    let points = list(&json, "structure").iter().filter_map(|value| {
        let views = list(value, "observations").iter().filter_map(|seen| {
            let pixel: [f64; 2] = seen.get("x").and_then(numbers).unwrap_or([f64::NAN; 2]);
            Some(PointView {
                photo: *photo_of.get(&id(seen, "observationId")?)?,
                pixel: pixel.map(|v| v as f32),
            })
        });
        Some(SparsePoint {
            position: DVec3::from(value.get("X").and_then(numbers::<3>)?),
            color: value
                .get("color")
                .and_then(numbers::<3>)?
                .map(|c| c.clamp(0.0, 255.0) as u8),
            views: views.collect(),
        })
    });
    Ok(PhotoScene {
        format: SceneFormat::AliceVision,
        path: path.to_owned(),
        points: points.collect(),
        photos,
        remarks,
    })
}

fn read_camera(path: &Path, index: usize, value: &Value) -> Result<SfmCamera, PhotoError> {
    let of = |key: &str| value.get(key).and_then(number);
    let failed = |cause: &str| PhotoError::format(path, format!("intrinsic {index}"), cause);
    let size = [of("width").unwrap_or(0.0), of("height").unwrap_or(0.0)];
    let pixels = value.get("pxFocalLength");
    let focal = pixels
        .and_then(numbers::<2>)
        .or_else(|| pixels.and_then(number).map(|f| [f; 2]))
        .or_else(|| {
            let ratio = of("pixelRatio").filter(|ratio| *ratio > 0.0).unwrap_or(1.0);
            let f = of("focalLength")? / of("sensorWidth").filter(|w| *w > 0.0)? * size[0];
            Some([f, f * ratio])
        })
        .ok_or_else(|| failed("it has no pxFocalLength, and no focalLength with sensorWidth"))?;
    let principal = value.get("principalPoint").and_then(numbers::<2>);
    let text = |key: &str| {
        value
            .get(key)
            .and_then(Value::as_str)
            .map(str::to_lowercase)
    };
    let kind = text("type").unwrap_or_else(|| "pinhole".to_owned());
    // Since 1.2.6 the distortion has a name of its own.
    let model = match text("distortionType") {
        Some(distortion) => distortion,
        None => kind.clone(),
    };
    let mut values = Vec::new();
    for (place, value) in list(value, "distortionParams").iter().enumerate() {
        let value =
            number(value).ok_or_else(|| failed(&format!("distortion {place} is no number")))?;
        values.push(value);
    }
    let at = |i: usize| values.get(i).copied().unwrap_or(0.0);
    let lens = match model.as_str() {
        "pinhole" | "none" | "" if kind != "equidistant" => CameraLens::default(),
        "radial1" | "radialk1" => CameraLens::new(LensModel::Brown, &[at(0)]),
        "radial3" | "radialk3" => {
            CameraLens::new(LensModel::Brown, &[at(0), at(1), 0.0, 0.0, at(2)])
        }
        "brown" => CameraLens::new(LensModel::Brown, &[at(0), at(1), at(3), at(4), at(2)]),
        "fisheye" | "fisheye4" => CameraLens::new(LensModel::Fisheye, &values),
        _ => {
            return Err(PhotoError::Lens {
                path: path.to_owned(),
                model,
            });
        }
    };
    Ok(SfmCamera {
        size: size.map(|side| side.clamp(0.0, 1e6) as u32),
        focal,
        principal: principal.unwrap_or([0.0; 2]),
        lens,
    })
}
