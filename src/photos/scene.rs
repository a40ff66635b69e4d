//! Calibrated photographs and sparse points, as plain structures in double precision.
//!
//! Every reader brings its file into this one convention: a camera looks along +z with x right and y down, a point p of the
//! world is R (p - C) in camera space, and pixel (i, j) covers [i, i + 1) x [j, j + 1), so that its center is at one half.
//! Photographs are as they are stored; what EXIF says about their orientation does not matter to a calibrated one.

use crate::math::up_axis::UpAxis;
pub use crate::projective::camera::CalibratedCamera;
use glam::{DMat3, DVec3};
use std::path::PathBuf;

/// Weight of the mean up direction of cameras beside the sides of pictures that should be level.
const UP_PRIOR: f64 = 1e-3;

/// Cosine of the angle to an axis below which that is up.
const NEAR_AXIS: f64 = 0.996;

/// Length of the mean of unit vectors below which they have no direction in common.
const LEAST_COMMON: f64 = 0.5;

/// Format of a scene of photographs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SceneFormat {
    /// Bundler: `bundle.out` and a list of photographs.
    Bundler,
    /// COLMAP, text.
    ColmapText,
    /// COLMAP, binary.
    ColmapBinary,
    /// OpenMVS, `MVSI`.
    OpenMvs,
    /// VisualSFM, `NVM_V3`.
    VisualSfm,
    /// AliceVision and Meshroom, JSON.
    AliceVision,
    /// RealityCapture, comma-separated values.
    RealityCaptureCsv,
    /// RealityCapture, an XMP file beside each photograph.
    RealityCaptureXmp,
    /// nerfstudio, `transforms.json`.
    Nerfstudio,
}

impl SceneFormat {
    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bundler => "Bundler",
            Self::ColmapText => "COLMAP text",
            Self::ColmapBinary => "COLMAP binary",
            Self::OpenMvs => "OpenMVS",
            Self::VisualSfm => "VisualSFM",
            Self::AliceVision => "AliceVision",
            Self::RealityCaptureCsv => "RealityCapture CSV",
            Self::RealityCaptureXmp => "RealityCapture XMP",
            Self::Nerfstudio => "nerfstudio",
        }
    }
}

/// A photograph of a scene with its camera.
#[derive(Debug, Clone, PartialEq)]
pub struct ScenePhoto {
    /// Name as the scene's file has it.
    pub name: String,
    /// The photograph, where it was found.
    pub file: Option<PathBuf>,
    /// Mask of the photograph, where there is one: black is not used.
    pub mask: Option<PathBuf>,
    /// Camera of the photograph.
    pub camera: CalibratedCamera,
}

/// Place where a photograph was found to show a sparse point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointView {
    /// Index of the photograph.
    pub photo: u32,
    /// The measured pixel, in the convention of [`CalibratedCamera`]; NaN where the file does not have it.
    pub pixel: [f32; 2],
}

/// A point of a sparse reconstruction.
#[derive(Debug, Clone, PartialEq)]
pub struct SparsePoint {
    /// Position in world space.
    pub position: DVec3,
    /// Red, green, blue as the file has them.
    pub color: [u8; 3],
    /// Photographs that show it.
    pub views: Vec<PointView>,
}

/// Photographs with their cameras, and the points that calibrated them.
#[derive(Debug, Clone, PartialEq)]
pub struct PhotoScene {
    /// Format of the file.
    pub format: SceneFormat,
    /// The file.
    pub path: PathBuf,
    /// Photographs whose cameras are registered, in the order of the file.
    pub photos: Vec<ScenePhoto>,
    /// Sparse points; may be empty.
    pub points: Vec<SparsePoint>,
    /// Sentences on all that was left out or guessed.
    pub remarks: Vec<String>,
}

impl PhotoScene {
    /// The photograph that a user means: by its name, the end of its name, or its number from 0.
    pub fn find(&self, wanted: &str) -> Option<usize> {
        let by = |test: &dyn Fn(&str) -> bool| self.photos.iter().position(|p| test(&p.name));
        by(&|name| name == wanted)
            .or_else(|| by(&|name| file_name(name) == wanted))
            .or_else(|| by(&|name| stem(name) == wanted))
            .or_else(|| {
                let index: usize = wanted.parse().ok()?;
                (index < self.photos.len()).then_some(index)
            })
    }

    /// Direction that is up for the photographs.
    pub fn up(&self) -> Option<UpAxis> {
        common_up(self.photos.iter().map(|photo| photo.camera))
    }

    /// Middle and spread of the sparse points, or of the cameras where there are no points: the median of each coordinate,
    /// and the median distance from that.
    pub fn extent(&self) -> (DVec3, f64) {
        let positions: Vec<DVec3> = if self.points.is_empty() {
            self.photos.iter().map(|p| p.camera.center).collect()
        } else {
            self.points.iter().map(|p| p.position).collect()
        };
        let median = |values: &mut Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(0.0)
        };
        let axis = |i: usize| median(&mut positions.iter().map(|p| p[i]).collect());
        let middle = DVec3::new(axis(0), axis(1), axis(2));
        let spread = median(&mut positions.iter().map(|p| p.distance(middle)).collect());
        (middle, spread)
    }
}

/// The direction that is up for cameras, which people hold level but tilt: the one that the horizontals of all pictures are
/// level to, and among those nearest the mean of what is up in pictures. An axis of the world where one is within five degrees.
/// `None` where pictures have no up in common.
pub fn common_up(cameras: impl Iterator<Item = CalibratedCamera>) -> Option<UpAxis> {
    let (mut sides, mut ups, mut count) = (DMat3::ZERO, DVec3::ZERO, 0.0);
    for camera in cameras {
        let [right, up] = [DVec3::X, DVec3::NEG_Y].map(|own| camera.rotation.transpose() * own);
        sides += DMat3::from_cols(right * right.x, right * right.y, right * right.z);
        ups += up;
        count += 1.0;
    }
    if ups.length() < LEAST_COMMON * count || count == 0.0 {
        return None;
    }
    // Least squares: the sum of (up . right)^2 / n + p |up - mean|^2.
    let system = sides * (1.0 / count) + UP_PRIOR * DMat3::IDENTITY;
    let up = (system.inverse() * ups).try_normalize()?;
    let axes = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
    let near = axes.into_iter().find(|axis| axis.dot(up) > NEAR_AXIS);
    UpAxis::along(near.unwrap_or(up))
}

/// The last part of a name with either slash.
pub(crate) fn file_name(name: &str) -> &str {
    name.rsplit(['/', '\\']).next().unwrap_or(name)
}

/// The last part of a name without its ending.
pub(crate) fn stem(name: &str) -> &str {
    let name = file_name(name);
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may panic")]
    use super::*;
    use crate::projective::lens::CameraLens;

    fn camera() -> CalibratedCamera {
        CalibratedCamera {
            width: 100,
            height: 80,
            focal: [90.0, 90.0],
            principal: [48.0, 41.0],
            lens: CameraLens::default(),
            rotation: DMat3::from_rotation_y(0.3) * DMat3::from_rotation_x(-0.2),
            center: DVec3::new(1.0, -2.0, 0.5),
        }
    }

    #[test]
    fn photographs_are_found_by_name_and_number() {
        let photo = |name: &str| ScenePhoto {
            name: name.into(),
            file: None,
            mask: None,
            camera: camera(),
        };
        let scene = PhotoScene {
            format: SceneFormat::Bundler,
            path: PathBuf::new(),
            photos: vec![photo("a/x1.jpg"), photo("a\\1.jpg")],
            points: vec![],
            remarks: vec![],
        };
        assert_eq!(scene.find("a/x1.jpg"), Some(0));
        assert_eq!(scene.find("x1.jpg"), Some(0));
        // A name goes before a number.
        assert_eq!(scene.find("1"), Some(1));
        assert_eq!(scene.find("0"), Some(0));
        assert_eq!(scene.find("2"), None);
    }
    /// Cameras level about `up`, `yaw` apart and tilted by `pitch`, radians.
    fn level_cameras(up: DVec3, yaw: f64, pitch: f64) -> Vec<CalibratedCamera> {
        let side = up.any_orthonormal_vector();
        let of = |step: i32| {
            let turn = glam::DQuat::from_axis_angle(up, yaw * f64::from(step));
            let (right, level) = (turn * side, turn * up.cross(side));
            let forward = level * pitch.cos() + up * pitch.sin();
            let down = forward.cross(right);
            CalibratedCamera {
                rotation: DMat3::from_cols(right, down, forward).transpose(),
                ..camera()
            }
        };
        (-3..=3).map(of).collect()
    }

    #[test]
    fn up_is_what_level_cameras_have_in_common_however_they_are_tilted() {
        let up = DVec3::new(0.3, -0.5, -0.8).normalize();
        for (yaw, pitch) in [(0.2, 0.0), (0.2, -0.5), (0.9, 0.4), (0.0, 0.0)] {
            let found = common_up(level_cameras(up, yaw, pitch).into_iter()).unwrap();
            let apart = found.direction().angle_between(up);
            assert!(apart < 0.01, "{yaw} {pitch}: {apart}");
            assert!(matches!(found, UpAxis::Along(_)));
        }
        // Within five degrees of an axis it is that.
        let nearly = DVec3::new(0.03, 0.02, -1.0).normalize();
        let found = common_up(level_cameras(nearly, 0.2, -0.3).into_iter());
        assert_eq!(found, Some(UpAxis::Along(DVec3::NEG_Z)));
        let found = common_up(level_cameras(DVec3::Z, 0.2, -0.3).into_iter());
        assert_eq!(found, Some(UpAxis::Z));
        // Cameras that look down, there and back, and none.
        let mut down = level_cameras(DVec3::Z, 0.0, -1.5);
        down.truncate(1);
        down.extend(level_cameras(DVec3::Z, std::f64::consts::PI, -1.5).get(2));
        assert_eq!(common_up(down.into_iter()), None);
        assert_eq!(common_up(std::iter::empty()), None);
    }
}
