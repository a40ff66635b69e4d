//! Bundler: `bundle.out` v0.3 with a list of photographs.
//!
//! Cameras look along -z with y up, so rows 2 and 3 of rotation and translation change sign here. The principal point is the
//! middle of the photograph, whose size is not in the file. A focal length of 0 marks a camera that is not registered.

use super::source::{FoundPhoto, PhotoFolders, WordReader, camera_of, read_text, rows};
use crate::photos::error::PhotoError;
use crate::photos::lens::{CameraLens, LensModel};
use crate::photos::scene::{PhotoScene, PointView, SceneFormat, ScenePhoto, SparsePoint};
use glam::{DMat3, DVec3};
use std::path::{Path, PathBuf};

/// First line of the file.
pub(super) const MAGIC: &str = "# Bundle file";

/// Names that the list of photographs goes by.
const LISTS: &[&str] = &[
    "list.txt",
    "list_tmp.txt",
    "images.txt",
    "pictures.txt",
    "bundle.out.list.txt",
];

/// The list that belongs to a bundle file.
fn list_of(path: &Path) -> Option<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let with_ending = PathBuf::from(format!("{}.list.txt", path.display()));
    let beside = LISTS.iter().map(|name| folder.join(name));
    let above = LISTS.iter().map(|name| folder.join("..").join(name));
    std::iter::once(with_ending)
        .chain(beside)
        .chain(above)
        .find(|list| list.is_file())
}

pub(super) fn read(path: &Path, folder: Option<&Path>) -> Result<PhotoScene, PhotoError> {
    let text = read_text(path)?;
    let list = list_of(path).ok_or_else(|| {
        PhotoError::format(
            path,
            "list of photographs",
            "there is no list.txt beside it; write one with the name of a photograph on each line, in the order of the cameras",
        )
    })?;
    let names: Vec<String> = read_text(&list)?
        .lines()
        .filter_map(|line| line.split_whitespace().next())
        .map(str::to_owned)
        .collect();
    let mut words = WordReader::new(path, &text);
    if !words
        .line_text()
        .is_some_and(|line| line.starts_with(MAGIC))
    {
        return Err(words.error("the first line is not \"# Bundle file v0.3\""));
    }
    let cameras = words.count("the number of cameras")?;
    let points = words.count("the number of points")?;
    let mut remarks = Vec::new();
    let mut photos = Vec::new();
    let mut unregistered = Vec::new();
    // Index of the photograph of each camera.
    let mut photo_of = Vec::new();
    let folders = PhotoFolders::new(path, folder);
    for index in 0..cameras {
        let [f, k1, k2] = words.numbers("focal length and distortion of a camera")?;
        let r = rows(words.numbers("a rotation")?);
        let t = DVec3::from(words.numbers::<3>("a translation")?);
        let name = usize::try_from(index).ok().and_then(|i| names.get(i));
        let Some(name) = name else {
            return Err(words.error(format!(
                "camera {index} has no photograph: {} lists {}",
                list.display(),
                names.len()
            )));
        };
        if f == 0.0 {
            unregistered.push(name.clone());
            photo_of.push(None);
            continue;
        }
        let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let mut camera = camera_of(flip * r, flip * t);
        camera.focal = [f; 2];
        camera.lens = CameraLens::new(LensModel::Brown, &[k1, k2]);
        let mut found = FoundPhoto::new(name.as_str(), camera);
        found.is_centered = true;
        photo_of.push(Some(photos.len() as u32));
        photos.push(found.locate(&folders));
    }
    if !unregistered.is_empty() {
        remarks.push(format!(
            "{} of {cameras} cameras are not registered (focal length 0) and are left out: {}",
            unregistered.len(),
            unregistered.join(", ")
        ));
    }
    let mut sparse = Vec::new();
    for _ in 0..points {
        sparse.push(read_point(&mut words, &photo_of, &photos)?);
    }
    Ok(PhotoScene {
        format: SceneFormat::Bundler,
        path: path.to_owned(),
        photos,
        points: sparse,
        remarks,
    })
}

fn read_point(
    words: &mut WordReader<'_>,
    photo_of: &[Option<u32>],
    photos: &[ScenePhoto],
) -> Result<SparsePoint, PhotoError> {
    let position = DVec3::from(words.numbers::<3>("a point")?);
    let color = words
        .numbers::<3>("the color of a point")?
        .map(|c| c.clamp(0.0, 255.0) as u8);
    let mut views = Vec::new();
    for _ in 0..words.count("the number of views of a point")? {
        let camera = words.count("the camera of a view")?;
        let [_, x, y] = words.numbers("key and place of a view")?;
        let photo = usize::try_from(camera).ok().and_then(|i| photo_of.get(i));
        match photo {
            None => return Err(words.error(format!("there is no camera {camera}"))),
            Some(None) => {}
            Some(Some(photo)) => {
                let size = &photos[*photo as usize].camera;
                let pixel = [
                    0.5 * f64::from(size.width) + x,
                    0.5 * f64::from(size.height) - y,
                ];
                views.push(PointView {
                    photo: *photo,
                    pixel: pixel.map(|v| v as f32),
                });
            }
        }
    }
    Ok(SparsePoint {
        position,
        color,
        views,
    })
}
