//! COLMAP's model in binary: `cameras.bin`, `images.bin` and, where it is there, `points3D.bin`; little-endian.

use super::colmap::{ColmapCamera, ColmapFiles, ColmapImage, ColmapPoint, model_of};
use super::source::{ByteReader, read_bytes};
use crate::photos::error::PhotoError;
use crate::photos::scene::{PhotoScene, SceneFormat};
use std::path::Path;

/// Reads the model in a folder.
pub(super) fn read(folder: &Path, photos: Option<&Path>) -> Result<PhotoScene, PhotoError> {
    let mut files = ColmapFiles::default();
    let path = folder.join("cameras.bin");
    let bytes = read_bytes(&path)?;
    let mut reader = ByteReader::new(&path, &bytes);
    for _ in 0..reader.count(24, "cameras")? {
        let id = reader.u32("a camera")?;
        let number = reader.u32("the model of a camera")?;
        let Some((model, count)) = model_of(number) else {
            return Err(PhotoError::Lens {
                path,
                model: format!("number {number}"),
            });
        };
        let size = [
            wide(&mut reader, "the width")?,
            wide(&mut reader, "the height")?,
        ];
        let mut values = Vec::new();
        for _ in 0..count {
            values.push(reader.f64("a parameter of a camera")?);
        }
        let camera = ColmapCamera::new(&path, model, size, &values)?;
        files.cameras.insert(u64::from(id), camera);
    }
    let path = folder.join("images.bin");
    let bytes = read_bytes(&path)?;
    let mut reader = ByteReader::new(&path, &bytes);
    for _ in 0..reader.count(73, "images")? {
        files.images.push(read_image(&mut reader)?);
    }
    let points = folder.join("points3D.bin");
    if points.is_file() {
        let bytes = read_bytes(&points)?;
        let mut reader = ByteReader::new(&points, &bytes);
        for _ in 0..reader.count(51, "points")? {
            files.points.push(read_point(&mut reader)?);
        }
    }
    files.into_scene(SceneFormat::ColmapBinary, &path, photos)
}

/// A size, stored in 64 bits.
fn wide(reader: &mut ByteReader<'_>, what: &str) -> Result<u32, PhotoError> {
    let value = u64::from_le_bytes(reader.array(what)?);
    u32::try_from(value).map_err(|_| reader.error(format!("{what} of a camera is {value} pixels")))
}

fn read_image(reader: &mut ByteReader<'_>) -> Result<ColmapImage, PhotoError> {
    let id = reader.u32("an image")?;
    let quaternion = reader.f64s("a quaternion")?;
    let translation = reader.f64s("a translation")?;
    let camera = reader.u32("the camera of an image")?;
    let mut name = Vec::new();
    loop {
        let [byte] = reader.array("the name of an image")?;
        if byte == 0 {
            break;
        }
        name.push(byte);
    }
    let mut features = Vec::new();
    for _ in 0..reader.count(24, "features")? {
        features.push(reader.f64s::<2>("a feature")?.map(|v| v as f32));
        reader.take(8, "the point of a feature")?;
    }
    Ok(ColmapImage {
        id: u64::from(id),
        quaternion,
        translation,
        camera: u64::from(camera),
        name: String::from_utf8_lossy(&name).into_owned(),
        features,
    })
}

fn read_point(reader: &mut ByteReader<'_>) -> Result<ColmapPoint, PhotoError> {
    reader.take(8, "the number of a point")?;
    let position = reader.f64s("a point")?;
    let color = reader.array("the color of a point")?;
    reader.take(8, "the error of a point")?;
    let mut track = Vec::new();
    for _ in 0..reader.count(8, "views of a point")? {
        let image = u64::from(reader.u32("a view")?);
        track.push([image, u64::from(reader.u32("the feature of a view")?)]);
    }
    Ok(ColmapPoint {
        position,
        color,
        track,
    })
}
