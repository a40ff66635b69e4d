//! nerfstudio (and instant-ngp): `transforms.json`.
//!
//! A frame has the matrix of world from camera, with the axes of OpenGL (x right, y up, looking along -z).
//! `applied_transform` and `applied_scale` moved the world away from the one that was calibrated, where the mesh is; both
//! are undone. Intrinsics stand in the frame, or once for all.

use super::json::{number, read_json};
use super::source::{FoundPhoto, PhotoFolders, camera_of};
use crate::photos::error::PhotoError;
use crate::photos::lens::{CameraLens, LensModel};
use crate::photos::scene::{PhotoScene, SceneFormat};
use glam::{DMat3, DMat4, DVec3, DVec4};
use serde_json::Value;
use std::path::Path;

/// A matrix of three or four rows of four numbers.
fn matrix(value: &Value) -> Option<DMat4> {
    let rows = value
        .as_array()
        .filter(|rows| matches!(rows.len(), 3 | 4))?;
    let mut result = [DVec4::ZERO, DVec4::ZERO, DVec4::ZERO, DVec4::W];
    for (row, value) in result.iter_mut().zip(rows) {
        *row = DVec4::from(super::json::numbers::<4>(value)?);
    }
    let [a, b, c, d] = result;
    Some(DMat4::from_cols(a, b, c, d).transpose())
}

pub(super) fn read(path: &Path, folder: Option<&Path>) -> Result<PhotoScene, PhotoError> {
    let json = read_json(path)?;
    let Some(frames) = json.get("frames").and_then(Value::as_array) else {
        return Err(PhotoError::format(
            path,
            "the file",
            "it has no list of frames",
        ));
    };
    let applied = json
        .get("applied_transform")
        .and_then(matrix)
        .unwrap_or(DMat4::IDENTITY);
    let scale = json.get("applied_scale").and_then(number).unwrap_or(1.0);
    if applied.determinant().abs() < 1e-12 || scale.is_nan() || scale.abs() < 1e-12 {
        let cause = "applied_transform or applied_scale cannot be undone";
        return Err(PhotoError::format(path, "the file", cause));
    }
    let undo = applied.inverse();
    let folders = PhotoFolders::new(path, folder);
    let mut photos = Vec::new();
    for (index, frame) in frames.iter().enumerate() {
        let failed = |cause: &str| PhotoError::format(path, format!("frame {index}"), cause);
        let of = |key: &str| frame.get(key).or_else(|| json.get(key)).and_then(number);
        let world_from_camera = frame.get("transform_matrix").and_then(matrix);
        let mut world_from_camera = world_from_camera
            .ok_or_else(|| failed("its transform_matrix is no matrix of 4 x 4"))?;
        world_from_camera.w_axis = (world_from_camera.w_axis.truncate() / scale).extend(1.0);
        let world_from_camera = undo * world_from_camera;
        let mut axes = DMat3::from_mat4(world_from_camera);
        // A transform that scales would scale the axes.
        for axis in [&mut axes.x_axis, &mut axes.y_axis, &mut axes.z_axis] {
            *axis = axis.normalize_or_zero();
        }
        let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let mut camera = camera_of(flip * axes.transpose(), DVec3::ZERO);
        camera.center = world_from_camera.w_axis.truncate();
        let side = |key: &str| of(key).unwrap_or(0.0).clamp(0.0, 1e6) as u32;
        (camera.width, camera.height) = (side("w"), side("h"));
        camera.lens = lens(path, &json, frame)?;
        let Some(file) = frame.get("file_path").and_then(Value::as_str) else {
            return Err(failed("it has no file_path"));
        };
        let mut photo = FoundPhoto::new(file, camera);
        photo.mask = frame
            .get("mask_path")
            .and_then(Value::as_str)
            .map(str::to_owned);
        let mut photo = photo.locate(&folders);
        let camera = &mut photo.camera;
        let [w, h] = [camera.width, camera.height].map(f64::from);
        let of_angle = |key: &str, side: f64| of(key).map(|angle| 0.5 * side / (0.5 * angle).tan());
        let fx = of("fl_x").or_else(|| of_angle("camera_angle_x", w));
        let fy = of("fl_y").or_else(|| of_angle("camera_angle_y", h)).or(fx);
        let (Some(fx), Some(fy)) = (fx, fy) else {
            return Err(failed("it has neither fl_x nor camera_angle_x"));
        };
        camera.focal = [fx, fy];
        camera.principal = [of("cx").unwrap_or(0.5 * w), of("cy").unwrap_or(0.5 * h)];
        photos.push(photo);
    }
    Ok(PhotoScene {
        format: SceneFormat::Nerfstudio,
        path: path.to_owned(),
        photos,
        points: Vec::new(),
        remarks: Vec::new(),
    })
}

fn lens(path: &Path, json: &Value, frame: &Value) -> Result<CameraLens, PhotoError> {
    let of = |key: &str| frame.get(key).or_else(|| json.get(key));
    let k = |key: &str| of(key).and_then(number).unwrap_or(0.0);
    let model = of("camera_model")
        .and_then(Value::as_str)
        .unwrap_or("OPENCV");
    match model {
        "OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" => {
            Ok(CameraLens::new(
                LensModel::Brown,
                &[k("k1"), k("k2"), k("p1"), k("p2"), k("k3"), k("k4")],
            ))
        }
        "OPENCV_FISHEYE" => Ok(CameraLens::new(
            LensModel::Fisheye,
            &[k("k1"), k("k2"), k("k3"), k("k4")],
        )),
        _ => Err(PhotoError::Lens {
            path: path.to_owned(),
            model: model.to_owned(),
        }),
    }
}
