//! Calibration against what is stored: sizes of photographs, and cameras that cannot be used.

use super::source::stored_size;
use crate::photos::error::PhotoError;
use crate::photos::scene::{PhotoScene, ScenePhoto, SparsePoint};

/// Relation of the stored photograph to the calibrated one.
enum StoredFit {
    Equal,
    /// Scaled: the camera is scaled with it.
    Scaled,
    /// Turned by EXIF after calibration: decoding turns it back.
    Transposed,
    /// Cropped or of another photograph.
    Other,
}

fn fit_of(calibrated: [u32; 2], stored: [u32; 2]) -> StoredFit {
    let [w, h] = calibrated.map(f64::from);
    let [sw, sh] = stored.map(f64::from);
    // Scaling rounds each side to whole pixels.
    let is_scaled = (sw / w * h - sh).abs() <= 1.0 + sh / h;
    if calibrated == stored {
        StoredFit::Equal
    } else if [stored[1], stored[0]] == calibrated {
        StoredFit::Transposed
    } else if is_scaled {
        StoredFit::Scaled
    } else {
        StoredFit::Other
    }
}

/// Scales cameras to photographs that were scaled after calibration, and leaves out what cannot be used. Indices of the views
/// of points follow.
pub(super) fn fit_to_files(scene: &mut PhotoScene) -> Result<(), PhotoError> {
    let all = scene.photos.len();
    let mut kept = Vec::new();
    let mut new_index = Vec::with_capacity(all);
    let mut scale = Vec::with_capacity(all);
    let (mut missing, mut last_cause) = (Vec::new(), String::from("none is registered"));
    for mut photo in std::mem::take(&mut scene.photos) {
        let before = [photo.camera.width, photo.camera.height];
        match usable(&mut photo, &mut scene.remarks) {
            Ok(()) => {
                let after = [photo.camera.width, photo.camera.height];
                // A photograph that is not there may have no size.
                scale.push([0, 1].map(|i| after[i].max(1) as f32 / before[i].max(1) as f32));
                new_index.push(Some(kept.len() as u32));
                if photo.file.is_none() {
                    missing.push(photo.name.clone());
                }
                kept.push(photo);
            }
            Err(cause) => {
                new_index.push(None);
                scale.push([1.0; 2]);
                scene
                    .remarks
                    .push(format!("{} is left out: {cause}", photo.name));
                last_cause = cause;
            }
        }
    }
    if kept.is_empty() {
        return Err(PhotoError::NoCamera {
            path: scene.path.clone(),
            cause: last_cause,
        });
    }
    if !missing.is_empty() {
        scene.remarks.push(format!(
            "{} of {} photographs are not there: {}{}",
            missing.len(),
            kept.len(),
            missing[..missing.len().min(4)].join(", "),
            if missing.len() > 4 { ", ..." } else { "" }
        ));
    }
    scene.photos = kept;
    for point in &mut scene.points {
        point.views.retain_mut(|view| {
            let old = view.photo as usize;
            let Some(Some(index)) = new_index.get(old) else {
                return false;
            };
            view.photo = *index;
            view.pixel = [0, 1].map(|i| view.pixel[i] * scale[old][i]);
            true
        });
    }
    let before = scene.points.len();
    // As far as cameras may be: distances beyond have no square.
    let is_near = |point: &SparsePoint| {
        let place = point.position;
        place.is_finite() && place.abs().max_element() < 1e12
    };
    scene.points.retain(is_near);
    if scene.points.len() < before {
        let lost = before - scene.points.len();
        scene.remarks.push(format!(
            "{lost} sparse points have no finite position and are left out"
        ));
    }
    Ok(())
}

/// Fits a camera to its file, or says why it cannot be used.
fn usable(photo: &mut ScenePhoto, remarks: &mut Vec<String>) -> Result<(), String> {
    if !photo.camera.is_usable() {
        return Err(
            "its camera has a number that is not finite, no positive focal length, or no rotation"
                .into(),
        );
    }
    let Some(stored) = photo.file.as_deref().and_then(stored_size) else {
        if let Some(file) = photo.file.take() {
            remarks.push(format!(
                "{}: neither a JPEG nor a PNG file; it is taken as not there",
                file.display()
            ));
        }
        return Ok(());
    };
    let calibrated = [photo.camera.width, photo.camera.height];
    match fit_of(calibrated, stored) {
        StoredFit::Equal | StoredFit::Transposed => Ok(()),
        StoredFit::Scaled => {
            photo.camera = photo.camera.scaled(stored[0], stored[1]);
            if !photo.camera.is_usable() {
                return Err("its camera, scaled to its file, is no longer usable".into());
            }
            remarks.push(format!(
                "{} was calibrated at {} x {} pixels and has {} x {}: its camera is scaled",
                photo.name, calibrated[0], calibrated[1], stored[0], stored[1]
            ));
            Ok(())
        }
        StoredFit::Other => Err(format!(
            "it has {} x {} pixels but was calibrated at {} x {}, which no scale explains",
            stored[0], stored[1], calibrated[0], calibrated[1]
        )),
    }
}
