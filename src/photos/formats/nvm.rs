//! VisualSFM: `NVM_V3`.
//!
//! Camera: name, focal length, quaternion w x y z (world to camera), center, radial term, 0. The radial term is in units of
//! the focal length and on the side of the measurement. The principal point is the middle of the photograph, whose size is
//! not in the file. Spaces in names are stored as quotes. Only the first model of a file is read.

use super::source::{FoundPhoto, PhotoFolders, WordReader, camera_of, read_text, rotation};
use crate::photos::error::PhotoError;
use crate::photos::lens::{CameraLens, LensModel};
use crate::photos::scene::{PhotoScene, PointView, SceneFormat, ScenePhoto, SparsePoint};
use glam::DVec3;
use std::path::Path;

/// First word of the file.
pub(super) const MAGIC: &str = "NVM_V3";

pub(super) fn read(path: &Path, folder: Option<&Path>) -> Result<PhotoScene, PhotoError> {
    let text = read_text(path)?;
    let mut words = WordReader::new(path, &text);
    let first = words.line_text().unwrap_or("");
    if !first.starts_with(MAGIC) {
        return Err(words.error("the first line is not NVM_V3"));
    }
    // `FixedK fx cx fy cy r` may follow the name.
    let fixed: Vec<f64> = match first.split_once("FixedK") {
        Some((_, values)) => values
            .split_whitespace()
            .filter_map(|w| w.parse().ok())
            .collect(),
        None => Vec::new(),
    };
    let count = words.count("the number of cameras")?;
    words.line_text();
    let folders = PhotoFolders::new(path, folder);
    let mut photos = Vec::new();
    for _ in 0..count {
        let line = loop {
            match words.line_text() {
                Some("") => {}
                Some(line) => break line,
                None => return Err(words.error("the file ends where a camera is expected")),
            }
        };
        let mut photo = read_camera(line, &words, &fixed)?.locate(&folders);
        photo.name = photo.name.replace('"', " ");
        photos.push(photo);
    }
    let points = match words.word() {
        None => Vec::new(),
        Some(word) => {
            let count: u64 =
                (word.parse()).map_err(|_| words.error("the number of points is expected"))?;
            read_points(&mut words, count, &photos)?
        }
    };
    let mut remarks = Vec::new();
    if words.count("more").is_ok_and(|more| more > 0) {
        remarks.push("the file holds more than one model; the first is read".to_owned());
    }
    Ok(PhotoScene {
        format: SceneFormat::VisualSfm,
        path: path.to_owned(),
        photos,
        points,
        remarks,
    })
}

fn read_camera(
    line: &str,
    words: &WordReader<'_>,
    fixed: &[f64],
) -> Result<FoundPhoto, PhotoError> {
    let all: Vec<&str> = line.split_whitespace().collect();
    let Some(split) = all.len().checked_sub(10).filter(|split| *split > 0) else {
        return Err(words.error("a camera has a name and ten numbers"));
    };
    let mut values = [0.0; 10];
    for (value, word) in values.iter_mut().zip(&all[split..]) {
        *value =
            (word.parse()).map_err(|_| words.error(format!("{word} is no number of a camera")))?;
    }
    let [f, w, x, y, z, cx, cy, cz, radial, _] = values;
    let rotation = rotation([w, x, y, z])
        .ok_or_else(|| words.error("the quaternion of a camera has no length"))?;
    let mut camera = camera_of(rotation, DVec3::ZERO);
    camera.center = DVec3::new(cx, cy, cz);
    camera.focal = [f; 2];
    camera.lens = CameraLens::new(LensModel::MeasuredRadial, &[radial]);
    let mut photo = FoundPhoto::new(all[..split].join(" "), camera);
    photo.is_centered = true;
    if let [fx, cx, fy, cy, r] = *fixed {
        photo.camera.focal = [fx, fy];
        photo.camera.principal = [cx, cy];
        photo.camera.lens = CameraLens::new(LensModel::MeasuredRadial, &[r]);
        photo.is_centered = false;
    }
    Ok(photo)
}

fn read_points(
    words: &mut WordReader<'_>,
    count: u64,
    photos: &[ScenePhoto],
) -> Result<Vec<SparsePoint>, PhotoError> {
    let mut points = Vec::new();
    for _ in 0..count {
        let position = DVec3::from(words.numbers::<3>("a point")?);
        let color = words
            .numbers::<3>("the color of a point")?
            .map(|c| c.clamp(0.0, 255.0) as u8);
        let mut views = Vec::new();
        for _ in 0..words.count("the number of views of a point")? {
            let photo = words.count("the photograph of a view")?;
            let [_, x, y] = words.numbers("feature and place of a view")?;
            if photo >= photos.len() as u64 {
                return Err(words.error(format!("there is no photograph {photo}")));
            }
            views.push(PointView {
                photo: photo as u32,
                pixel: [x as f32, y as f32],
            });
        }
        points.push(SparsePoint {
            position,
            color,
            views,
        });
    }
    // The program measures from the middle of the photograph, others that write the format from its corner.
    let is_centered = points
        .iter()
        .any(|p| p.views.iter().any(|v| v.pixel[0] < 0.0 || v.pixel[1] < 0.0));
    if is_centered {
        for view in points.iter_mut().flat_map(|p| &mut p.views) {
            let camera = &photos[view.photo as usize].camera;
            view.pixel[0] += camera.width as f32 / 2.0;
            view.pixel[1] += camera.height as f32 / 2.0;
        }
    }
    Ok(points)
}
