//! Parts that both forms of a COLMAP model share: camera models by name and number, poses, points.
//!
//! World to camera is q (w x y z), t; x right, y down, z forward; the center of the top left pixel is at (0.5, 0.5).

use super::source::{FoundPhoto, PhotoFolders, camera_of, rotation};
use crate::photos::error::PhotoError;
use crate::photos::lens::{CameraLens, LensModel};
use crate::photos::scene::{PhotoScene, PointView, SceneFormat, SparsePoint};
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::Path;

/// Names of the models by their numbers in binary files, with how many parameters each has.
const MODELS: &[(&str, usize)] = &[
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
];

/// Name and number of parameters of a model's number.
pub(super) fn model_of(number: u32) -> Option<(&'static str, usize)> {
    MODELS.get(number as usize).copied()
}

/// Intrinsics of a camera.
#[derive(Debug, Clone)]
pub(super) struct ColmapCamera {
    width: u32,
    height: u32,
    focal: [f64; 2],
    principal: [f64; 2],
    lens: CameraLens,
}

impl ColmapCamera {
    /// A camera of a named model. `path` is for errors.
    pub(super) fn new(
        path: &Path,
        model: &str,
        size: [u32; 2],
        values: &[f64],
    ) -> Result<Self, PhotoError> {
        let count = MODELS.iter().find(|m| m.0 == model).map(|m| m.1);
        let unknown = || PhotoError::Lens {
            path: path.to_owned(),
            model: model.to_owned(),
        };
        if values.len() != count.ok_or_else(unknown)? {
            return Err(PhotoError::format(
                path,
                format!("a camera of model {model}"),
                format!(
                    "it has {} parameters instead of {}",
                    values.len(),
                    count.unwrap_or(0)
                ),
            ));
        }
        // One focal length or two come first, then the principal point, then the lens.
        let (focals, lens) = match model {
            "SIMPLE_PINHOLE" | "PINHOLE" => (values.len() - 2, LensModel::Pinhole),
            "SIMPLE_RADIAL" | "RADIAL" => (1, LensModel::Brown),
            "OPENCV" => (2, LensModel::Brown),
            "FULL_OPENCV" => (2, LensModel::Rational),
            "OPENCV_FISHEYE" => (2, LensModel::Fisheye),
            "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE" => (1, LensModel::Fisheye),
            _ => return Err(unknown()),
        };
        let rest = &values[focals..];
        Ok(Self {
            width: size[0],
            height: size[1],
            focal: [values[0], values[focals - 1]],
            principal: [rest[0], rest[1]],
            lens: CameraLens::new(lens, &rest[2..]),
        })
    }
}

/// An image of the model.
#[derive(Debug, Clone)]
pub(super) struct ColmapImage {
    pub(super) id: u64,
    pub(super) quaternion: [f64; 4],
    pub(super) translation: [f64; 3],
    pub(super) camera: u64,
    pub(super) name: String,
    /// Places of the features, pixels.
    pub(super) features: Vec<[f32; 2]>,
}

/// A point of the model: its track is pairs of an image and a feature of it.
#[derive(Debug, Clone)]
pub(super) struct ColmapPoint {
    pub(super) position: [f64; 3],
    pub(super) color: [u8; 3],
    pub(super) track: Vec<[u64; 2]>,
}

/// A model as its three files have it.
#[derive(Debug, Clone, Default)]
pub(super) struct ColmapFiles {
    pub(super) cameras: BTreeMap<u64, ColmapCamera>,
    pub(super) images: Vec<ColmapImage>,
    pub(super) points: Vec<ColmapPoint>,
}

impl ColmapFiles {
    /// The scene; `path` is the file of images.
    pub(super) fn into_scene(
        self,
        format: SceneFormat,
        path: &Path,
        folder: Option<&Path>,
    ) -> Result<PhotoScene, PhotoError> {
        let folders = PhotoFolders::new(path, folder);
        let mut photos = Vec::new();
        let mut photo_of = BTreeMap::new();
        let mut features = Vec::new();
        for image in self.images {
            let place = || format!("image {}", image.id);
            let Some(intrinsics) = self.cameras.get(&image.camera) else {
                let cause = format!("its camera {} is not in the file of cameras", image.camera);
                return Err(PhotoError::format(path, place(), cause));
            };
            let Some(rotation) = rotation(image.quaternion) else {
                return Err(PhotoError::format(
                    path,
                    place(),
                    "its quaternion has no length",
                ));
            };
            let mut camera = camera_of(rotation, DVec3::from(image.translation));
            (camera.width, camera.height) = (intrinsics.width, intrinsics.height);
            (camera.focal, camera.principal) = (intrinsics.focal, intrinsics.principal);
            camera.lens = intrinsics.lens;
            photo_of.insert(image.id, photos.len());
            photos.push(FoundPhoto::new(image.name, camera).locate(&folders));
            features.push(image.features);
        }
        let points = self.points.into_iter().map(|point| SparsePoint {
            position: DVec3::from(point.position),
            color: point.color,
            views: (point.track.iter())
                .filter_map(|[image, feature]| {
                    let photo = *photo_of.get(image)?;
                    let place = usize::try_from(*feature).ok()?;
                    Some(PointView {
                        photo: photo as u32,
                        pixel: features[photo].get(place).copied().unwrap_or([f32::NAN; 2]),
                    })
                })
                .collect(),
        });
        Ok(PhotoScene {
            format,
            path: path.to_owned(),
            points: points.collect(),
            photos,
            remarks: Vec::new(),
        })
    }
}
