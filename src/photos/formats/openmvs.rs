//! OpenMVS: `.mvs` archives that begin with `MVSI`, versions 1 to 7.
//!
//! Integer coordinates are centers of pixels, so half a pixel is added here. A camera without a size has its matrix in units
//! of the photograph's larger side. Cameras stand on platforms, whose poses they share. Boost archives have the same ending
//! and another content: they are refused.

use super::source::{ByteReader, FoundPhoto, PhotoFolders, camera_of, read_bytes, rows};
use crate::photos::error::PhotoError;
use crate::photos::scene::{PhotoScene, PointView, SceneFormat, SparsePoint};
use glam::{DMat3, DVec3};
use std::path::Path;

/// First bytes of the file.
pub(super) const MAGIC: &[u8] = b"MVSI";

/// Newest version that is read.
const NEWEST: u32 = 7;

/// Pose that an image which is not registered has.
const NO_POSE: u32 = u32::MAX;

struct PlatformCamera {
    size: [u32; 2],
    matrix: [f64; 9],
    rotation: DMat3,
    center: DVec3,
}

struct CameraPlatform {
    cameras: Vec<PlatformCamera>,
    poses: Vec<(DMat3, DVec3)>,
}

pub(super) fn read(path: &Path, folder: Option<&Path>) -> Result<PhotoScene, PhotoError> {
    let bytes = read_bytes(path)?;
    let mut reader = ByteReader::new(path, &bytes);
    if reader.array::<4>("the first bytes")? != *MAGIC {
        return Err(reader.error(
            "it does not begin with MVSI; an .mvs file of another kind (a Boost archive) must be exported by InterfaceCOLMAP or another interface of OpenMVS",
        ));
    }
    let version = reader.u32("the version")?;
    if version == 0 || version > NEWEST {
        return Err(reader.error(format!(
            "version {version} of MVSI is not known; 1 to {NEWEST} are"
        )));
    }
    reader.take(4, "the header")?;
    let mut platforms = Vec::new();
    for _ in 0..reader.count(24, "platforms")? {
        platforms.push(read_platform(&mut reader, version)?);
    }
    let mut remarks = Vec::new();
    let folders = PhotoFolders::new(path, folder);
    let mut photos = Vec::new();
    let mut photo_of = Vec::new();
    let mut unregistered = Vec::new();
    let images = reader.count(20, "images")?;
    for _ in 0..images {
        let image = read_image(&mut reader, version)?;
        if image.pose == NO_POSE {
            unregistered.push(image.name);
            photo_of.push(None);
            continue;
        }
        let found = (platforms.get(image.platform as usize)).and_then(|platform| {
            let camera = platform.cameras.get(image.camera as usize)?;
            Some((camera, platform.poses.get(image.pose as usize)?))
        });
        let Some((of_platform, (rotation, center))) = found else {
            return Err(reader.error(format!(
                "photograph {} names a platform, camera or pose that is not there",
                image.name
            )));
        };
        let rotation_of_camera = of_platform.rotation * *rotation;
        let mut camera = camera_of(rotation_of_camera, DVec3::ZERO);
        camera.center = *center + rotation.transpose() * of_platform.center;
        [camera.width, camera.height] = of_platform.size;
        let [fx, _, cx, _, fy, cy, ..] = of_platform.matrix;
        camera.focal = [fx, fy];
        let is_normalized = of_platform.size.contains(&0);
        // A normalized matrix is multiplied by the size before half a pixel could be added.
        let half = if is_normalized { 0.0 } else { 0.5 };
        camera.principal = [cx + half, cy + half];
        let mut photo = FoundPhoto::new(image.name, camera);
        photo.mask = image.mask;
        photo.is_normalized = is_normalized;
        photo_of.push(Some(photos.len() as u32));
        let mut photo = photo.locate(&folders);
        if is_normalized {
            photo.camera.principal = photo.camera.principal.map(|c| c + 0.5);
        }
        photos.push(photo);
    }
    if !unregistered.is_empty() {
        remarks.push(format!(
            "{} of {images} photographs are not registered and are left out: {}",
            unregistered.len(),
            unregistered.join(", ")
        ));
    }
    let points = read_points(&mut reader, &photo_of)?;
    Ok(PhotoScene {
        format: SceneFormat::OpenMvs,
        path: path.to_owned(),
        photos,
        points,
        remarks,
    })
}

fn text(reader: &mut ByteReader<'_>, what: &str) -> Result<String, PhotoError> {
    let length = reader.count(1, what)?;
    let bytes = reader.take(length, what)?;
    Ok(String::from_utf8_lossy(bytes).into_owned())
}

fn read_platform(reader: &mut ByteReader<'_>, version: u32) -> Result<CameraPlatform, PhotoError> {
    text(reader, "bytes of a platform's name")?;
    let mut cameras = Vec::new();
    for _ in 0..reader.count(176, "cameras")? {
        text(reader, "bytes of a camera's name")?;
        if version > 3 {
            text(reader, "bytes of a band's name")?;
        }
        let size = [reader.u32("the width")?, reader.u32("the height")?];
        cameras.push(PlatformCamera {
            size,
            matrix: reader.f64s("a matrix")?,
            rotation: rows(reader.f64s("a rotation")?),
            center: DVec3::from(reader.f64s::<3>("a position")?),
        });
    }
    let mut poses = Vec::new();
    for _ in 0..reader.count(96, "poses")? {
        let rotation = rows(reader.f64s("a rotation")?);
        poses.push((rotation, DVec3::from(reader.f64s::<3>("a position")?)));
    }
    Ok(CameraPlatform { cameras, poses })
}

struct ArchiveImage {
    name: String,
    mask: Option<String>,
    platform: u32,
    camera: u32,
    pose: u32,
}

fn read_image(reader: &mut ByteReader<'_>, version: u32) -> Result<ArchiveImage, PhotoError> {
    let name = text(reader, "bytes of a photograph's name")?;
    let mask = match version {
        5.. => Some(text(reader, "bytes of a mask's name")?).filter(|name| !name.is_empty()),
        _ => None,
    };
    let [platform, camera, pose] = [
        reader.u32("the platform of a photograph")?,
        reader.u32("the camera of a photograph")?,
        reader.u32("the pose of a photograph")?,
    ];
    if version > 2 {
        reader.take(4, "the number of a photograph")?;
    }
    if version > 6 {
        reader.take(12, "depths of a photograph")?;
        // Of each neighbor: number, points, scale, angle, area, score.
        let scores = reader.count(24, "scores of views")?;
        reader.take(24 * scores, "scores of views")?;
    }
    Ok(ArchiveImage {
        name,
        mask,
        platform,
        camera,
        pose,
    })
}

fn read_points(
    reader: &mut ByteReader<'_>,
    photo_of: &[Option<u32>],
) -> Result<Vec<SparsePoint>, PhotoError> {
    let mut points = Vec::new();
    for _ in 0..reader.count(20, "points")? {
        let mut position = [0.0; 3];
        for value in &mut position {
            *value = f64::from(reader.f32("a point")?);
        }
        let mut views = Vec::new();
        for _ in 0..reader.count(8, "views of a point")? {
            let image = reader.u32("the photograph of a view")?;
            reader.f32("the confidence of a view")?;
            match photo_of.get(image as usize) {
                None => return Err(reader.error(format!("there is no photograph {image}"))),
                Some(None) => {}
                Some(Some(photo)) => views.push(PointView {
                    photo: *photo,
                    pixel: [f32::NAN; 2],
                }),
            }
        }
        points.push(SparsePoint {
            position: DVec3::from(position),
            color: [0; 3],
            views,
        });
    }
    let normals = reader.count(12, "normals of points")?;
    reader.take(12 * normals, "normals of points")?;
    let colors = reader.count(3, "colors of points")?;
    if colors == points.len() as u64 {
        for point in &mut points {
            // Stored blue first.
            let [b, g, r] = reader.array("the color of a point")?;
            point.color = [r, g, b];
        }
    } else if colors > 0 {
        return Err(reader.error(format!(
            "there are {colors} colors for {} points",
            points.len()
        )));
    }
    Ok(points)
}
