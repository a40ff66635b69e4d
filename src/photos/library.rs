//! Photographs in memory: small ones first, whole ones on demand, within a budget of bytes.

use crate::photos::decode::{DECODE_BYTES, decode_photo, decode_thumbnail};
use crate::photos::error::PhotoError;
use crate::photos::pyramid::PhotoPyramid;
use crate::photos::scene::ScenePhoto;
use std::sync::Arc;

/// Whole photographs of a scene, the least used of which are dropped above a budget.
#[derive(Debug)]
pub struct PhotoLibrary {
    /// Bytes that the pyramids may take together; one is always kept.
    budget_bytes: u64,
    /// The pyramid of each photograph that is in memory, and when it was used last.
    held: Vec<Option<(Arc<PhotoPyramid>, u64)>>,
    clock: u64,
}

impl PhotoLibrary {
    /// An empty library for so many photographs.
    pub fn new(photos: usize, budget_bytes: u64) -> Self {
        Self {
            budget_bytes,
            held: vec![None; photos],
            clock: 0,
        }
    }

    /// The photograph at `index` of its scene with its mipmaps, at most `longest_side` pixels long (a power of two of its
    /// size smaller); decoded where it is not in memory.
    ///
    /// # Errors
    /// [`PhotoError::Usage`] where its file is not there, or as [`decode_photo`].
    pub fn whole(
        &mut self,
        index: usize,
        photo: &ScenePhoto,
        longest_side: u32,
    ) -> Result<Arc<PhotoPyramid>, PhotoError> {
        self.clock += 1;
        if let Some(Some((pyramid, used))) = self.held.get_mut(index) {
            *used = self.clock;
            return Ok(Arc::clone(pyramid));
        }
        let pyramid = Arc::new(load_photo(photo, longest_side)?);
        if index >= self.held.len() {
            self.held.resize(index + 1, None);
        }
        self.held[index] = Some((Arc::clone(&pyramid), self.clock));
        self.drop_least_used(index);
        Ok(pyramid)
    }

    /// Bytes of all photographs in memory.
    pub fn bytes(&self) -> u64 {
        self.held
            .iter()
            .flatten()
            .map(|(pyramid, _)| pyramid.bytes())
            .sum()
    }

    fn drop_least_used(&mut self, keep: usize) {
        while self.bytes() > self.budget_bytes {
            let others = self.held.iter().enumerate().filter(|(i, _)| *i != keep);
            let oldest = others
                .filter_map(|(i, held)| held.as_ref().map(|(_, used)| (*used, i)))
                .min();
            let Some((_, index)) = oldest else { return };
            self.held[index] = None;
        }
    }
}

/// The file of a photograph.
///
/// # Errors
/// [`PhotoError::Usage`] where it was not found.
fn file_of(photo: &ScenePhoto) -> Result<&std::path::Path, PhotoError> {
    let missing = || {
        PhotoError::Usage(format!(
            "the photograph {} is not there; name the folder with the photographs",
            photo.name
        ))
    };
    photo.file.as_deref().ok_or_else(missing)
}

/// Decodes a photograph whole and makes its mipmaps; levels longer than `longest_side` are left out.
///
/// # Errors
/// [`PhotoError::Usage`] where its file is not there, or as [`decode_photo`].
pub fn load_photo(photo: &ScenePhoto, longest_side: u32) -> Result<PhotoPyramid, PhotoError> {
    let size = [photo.camera.width, photo.camera.height];
    let mut pixels = decode_photo(file_of(photo)?, size, DECODE_BYTES)?;
    while pixels.width.max(pixels.height) > longest_side.max(1) {
        pixels = pixels.halved();
    }
    Ok(PhotoPyramid::new(pixels))
}

/// Decodes a small picture of a photograph and makes its mipmaps.
///
/// # Errors
/// [`PhotoError::Usage`] where its file is not there, or as [`decode_thumbnail`].
pub fn load_thumbnail(photo: &ScenePhoto) -> Result<PhotoPyramid, PhotoError> {
    let size = [photo.camera.width, photo.camera.height];
    Ok(PhotoPyramid::new(decode_thumbnail(
        file_of(photo)?,
        size,
        DECODE_BYTES,
    )?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photos::lens::CameraLens;
    use crate::photos::scene::CalibratedCamera;
    use glam::{DMat3, DVec3};

    fn photo(folder: &std::path::Path, name: &str) -> ScenePhoto {
        let file = folder.join(name);
        ::image::RgbImage::new(64, 32).save(&file).unwrap();
        ScenePhoto {
            name: name.into(),
            file: Some(file),
            mask: None,
            camera: CalibratedCamera {
                width: 64,
                height: 32,
                focal: [50.0; 2],
                principal: [32.0, 16.0],
                lens: CameraLens::default(),
                rotation: DMat3::IDENTITY,
                center: DVec3::ZERO,
            },
        }
    }

    #[test]
    fn the_least_used_is_dropped_above_the_budget() {
        let folder = tempfile::tempdir().unwrap();
        let photos = ["a.png", "b.png", "c.png"].map(|name| photo(folder.path(), name));
        let one = load_photo(&photos[0], 64).unwrap().bytes();
        let mut library = PhotoLibrary::new(3, 2 * one);
        for index in [0, 1, 0, 2] {
            library.whole(index, &photos[index], 64).unwrap();
            assert!(library.bytes() <= 2 * one);
        }
        let is_held: Vec<bool> = library.held.iter().map(Option::is_some).collect();
        assert_eq!(is_held, [true, false, true]);
        // Nothing is decoded again while it is held.
        std::fs::remove_file(folder.path().join("a.png")).unwrap();
        assert!(library.whole(0, &photos[0], 64).is_ok());
        // One is kept, whatever the budget.
        let mut tiny = PhotoLibrary::new(3, 1);
        tiny.whole(1, &photos[1], 64).unwrap();
        assert_eq!(tiny.bytes(), one);
    }

    #[test]
    fn large_levels_are_left_out_and_missing_files_named() {
        let folder = tempfile::tempdir().unwrap();
        let mut photo = photo(folder.path(), "a.png");
        assert_eq!(load_photo(&photo, 20).unwrap().size(), [16, 8]);
        assert_eq!(load_thumbnail(&photo).unwrap().size(), [8, 4]);
        photo.file = None;
        let message = load_photo(&photo, 20).unwrap_err().to_string();
        assert!(message.contains("a.png is not there"), "{message}");
    }
}
