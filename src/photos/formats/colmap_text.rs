//! COLMAP's model as text: `cameras.txt`, `images.txt` and, where it is there, `points3D.txt`.

use super::colmap::{ColmapCamera, ColmapFiles, ColmapImage, ColmapPoint};
use super::source::{read_text, shown};
use crate::photos::error::PhotoError;
use crate::photos::scene::{PhotoScene, SceneFormat};
use std::path::Path;

/// Reads the model in a folder.
pub(super) fn read(folder: &Path, photos: Option<&Path>) -> Result<PhotoScene, PhotoError> {
    let mut files = ColmapFiles::default();
    let path = folder.join("cameras.txt");
    for (number, line) in lines(&read_text(&path)?) {
        let mut row = TextRow::new(&path, number, line);
        let id = row.value("the number of a camera")?;
        let model = row.word("the model of a camera")?.to_owned();
        let size = [row.value("the width")?, row.value("the height")?];
        let mut values = Vec::new();
        while let Some(word) = row.words.next() {
            values.push(row.parse::<f64>(word, "a parameter of a camera")?);
        }
        let camera = ColmapCamera::new(&path, &model, size, &values)?;
        files.cameras.insert(id, camera);
    }
    let path = folder.join("images.txt");
    let text = read_text(&path)?;
    // Two lines an image. The second is empty where no feature was found, so empty lines count.
    let mut rows = (1..)
        .zip(text.lines())
        .filter(|(_, line)| !line.starts_with('#'));
    while let Some((number, line)) = rows.next() {
        if line.trim().is_empty() {
            continue;
        }
        let mut image = read_image(&path, number, line)?;
        if let Some((number, line)) = rows.next() {
            let mut row = TextRow::new(&path, number, line);
            while let Some(word) = row.words.next() {
                let x = row.parse(word, "a feature")?;
                image.features.push([x, row.value("a feature")?]);
                row.word("the point of a feature")?;
            }
        }
        files.images.push(image);
    }
    let points = folder.join("points3D.txt");
    if points.is_file() {
        for (number, line) in lines(&read_text(&points)?) {
            files.points.push(read_point(&points, number, line)?);
        }
    }
    files.into_scene(SceneFormat::ColmapText, &path, photos)
}

/// Lines that hold something, with their numbers.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    (1..)
        .zip(text.lines().map(str::trim))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

fn read_image(path: &Path, number: usize, line: &str) -> Result<ColmapImage, PhotoError> {
    let mut row = TextRow::new(path, number, line);
    let id = row.value("the number of an image")?;
    let mut pose = [0.0; 7];
    for value in &mut pose {
        *value = row.value("the pose of an image")?;
    }
    let camera = row.value("the camera of an image")?;
    // Names may have spaces.
    let name = row.words.collect::<Vec<_>>().join(" ");
    let [w, x, y, z, tx, ty, tz] = pose;
    Ok(ColmapImage {
        id,
        quaternion: [w, x, y, z],
        translation: [tx, ty, tz],
        camera,
        name,
        features: Vec::new(),
    })
}

fn read_point(path: &Path, number: usize, line: &str) -> Result<ColmapPoint, PhotoError> {
    let mut row = TextRow::new(path, number, line);
    let _: u64 = row.value("the number of a point")?;
    let mut position = [0.0; 3];
    for value in &mut position {
        *value = row.value("the position of a point")?;
    }
    let mut color = [0; 3];
    for value in &mut color {
        *value = row.value("the color of a point")?;
    }
    let _: f64 = row.value("the error of a point")?;
    let mut track = Vec::new();
    while let Some(word) = row.words.next() {
        let image = row.parse(word, "a view of a point")?;
        track.push([image, row.value("the feature of a view")?]);
    }
    Ok(ColmapPoint {
        position,
        color,
        track,
    })
}

/// Words of one line.
struct TextRow<'a> {
    path: &'a Path,
    number: usize,
    words: std::str::SplitWhitespace<'a>,
}

impl<'a> TextRow<'a> {
    fn new(path: &'a Path, number: usize, line: &'a str) -> Self {
        Self {
            path,
            number,
            words: line.split_whitespace(),
        }
    }

    fn word(&mut self, what: &str) -> Result<&'a str, PhotoError> {
        self.words.next().ok_or_else(|| {
            PhotoError::at_line(
                self.path,
                self.number,
                format!("the line ends where {what} is expected"),
            )
        })
    }

    fn value<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, PhotoError> {
        let word = self.word(what)?;
        self.parse(word, what)
    }

    fn parse<T: std::str::FromStr>(&self, word: &str, what: &str) -> Result<T, PhotoError> {
        word.parse().map_err(|_| {
            PhotoError::at_line(
                self.path,
                self.number,
                format!("{} is not {what}", shown(word)),
            )
        })
    }
}
