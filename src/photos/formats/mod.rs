//! Readers of scenes of photographs, and which of them a path is for.

mod alicevision;
mod bundler;
mod colmap;
mod colmap_binary;
mod colmap_text;
mod fit;
mod json;
mod nerfstudio;
mod nvm;
mod openmvs;
mod realitycapture;
mod source;
#[cfg(test)]
mod tests;

use crate::photos::error::PhotoError;
use crate::photos::scene::{PhotoScene, SceneFormat};
use crate::printable::{MOST_CHARS, printable};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Place and format of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneLocation {
    /// The format.
    pub format: SceneFormat,
    /// The file, or the folder of a format of several files.
    pub path: PathBuf,
}

/// Files of a folder that are tried, best first.
const CANDIDATES: &[&str] = &[
    ".",
    "sparse/0",
    "sparse",
    "colmap/sparse/0",
    "dense/sparse",
    "bundle.out",
    "bundle/bundle.out",
    "transforms.json",
    "cameras.sfm",
    "sfm.sfm",
    "sfm.json",
];

/// Endings of files that are tried after them.
const ENDINGS: &[&str] = &["mvs", "nvm", "out", "sfm", "csv"];

/// The scene at a path: a file of a known format, or a folder that holds one.
///
/// # Errors
/// [`PhotoError::NoScene`] with what was found instead.
pub fn locate_scene(path: &Path) -> Result<SceneLocation, PhotoError> {
    let none = |cause: &str| PhotoError::NoScene {
        path: path.to_owned(),
        cause: cause.to_owned(),
    };
    if path.is_file() {
        return location_of_file(path).ok_or_else(|| none("the file is of none of the formats"));
    }
    if !path.is_dir() {
        return Err(none("there is nothing of that name"));
    }
    for candidate in CANDIDATES {
        let inside = path.join(candidate);
        if let Some(found) = location_of_folder(&inside).or_else(|| location_of_file(&inside)) {
            return Ok(found);
        }
    }
    let mut files: Vec<PathBuf> = std::fs::read_dir(path)
        .map_err(|e| none(&e.to_string()))?
        .filter_map(|entry| entry.ok().map(|entry| entry.path()))
        .collect();
    files.sort();
    let has_ending = |file: &Path, ending: &str| {
        file.extension()
            .is_some_and(|e| e.eq_ignore_ascii_case(ending))
    };
    for ending in ENDINGS {
        let found = (files.iter())
            .filter(|file| has_ending(file, ending))
            .find_map(|file| location_of_file(file));
        if let Some(found) = found {
            return Ok(found);
        }
    }
    if files.iter().any(|file| has_ending(file, "xmp")) {
        return Ok(SceneLocation {
            format: SceneFormat::RealityCaptureXmp,
            path: path.to_owned(),
        });
    }
    Err(none("the folder holds no file of these"))
}

fn location_of_folder(folder: &Path) -> Option<SceneLocation> {
    let has = |ending: &str| {
        ["cameras", "images"]
            .iter()
            .all(|name| folder.join(format!("{name}.{ending}")).is_file())
    };
    let format = if has("bin") {
        SceneFormat::ColmapBinary
    } else if has("txt") {
        SceneFormat::ColmapText
    } else {
        return None;
    };
    Some(SceneLocation {
        format,
        path: folder.to_owned(),
    })
}

/// Decides by the first bytes; a file of COLMAP stands for its folder.
fn location_of_file(path: &Path) -> Option<SceneLocation> {
    let mut start = Vec::new();
    let mut file = File::open(path).ok()?;
    (&mut file).take(64 << 10).read_to_end(&mut start).ok()?;
    let text = String::from_utf8_lossy(start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&start));
    let name = path.file_name()?.to_string_lossy().to_lowercase();
    let here = |format| {
        Some(SceneLocation {
            format,
            path: path.to_owned(),
        })
    };
    if start.starts_with(openmvs::MAGIC) || name.ends_with(".mvs") {
        return here(SceneFormat::OpenMvs);
    }
    if text.starts_with(bundler::MAGIC) {
        return here(SceneFormat::Bundler);
    }
    if text.starts_with(nvm::MAGIC) {
        return here(SceneFormat::VisualSfm);
    }
    if text.to_lowercase().starts_with(realitycapture::TABLE_MAGIC) {
        return here(SceneFormat::RealityCaptureCsv);
    }
    if text.trim_start().starts_with('{') {
        let is_of = |key: &str| text.contains(&format!("\"{key}\""));
        if is_of("frames") || is_of("transform_matrix") || name == "transforms.json" {
            return here(SceneFormat::Nerfstudio);
        }
        if is_of("views") || is_of("intrinsics") || name.ends_with(".sfm") {
            return here(SceneFormat::AliceVision);
        }
    }
    let of_colmap = ["cameras", "images", "points3d"];
    if of_colmap
        .iter()
        .any(|part| name == format!("{part}.txt") || name == format!("{part}.bin"))
    {
        return location_of_folder(path.parent()?);
    }
    None
}

/// Reads the scene at a path; photographs are also looked for in `photos`.
///
/// Cameras that are not registered or not usable are left out with a remark, and so are photographs whose stored size does
/// not fit their calibration.
///
/// # Errors
/// The fault in the file, with its place, or [`PhotoError::NoCamera`].
pub fn read_scene(path: &Path, photos: Option<&Path>) -> Result<PhotoScene, PhotoError> {
    let location = locate_scene(path)?;
    let path = location.path.as_path();
    let mut scene = match location.format {
        SceneFormat::Bundler => bundler::read(path, photos),
        SceneFormat::ColmapText => colmap_text::read(path, photos),
        SceneFormat::ColmapBinary => colmap_binary::read(path, photos),
        SceneFormat::OpenMvs => openmvs::read(path, photos),
        SceneFormat::VisualSfm => nvm::read(path, photos),
        SceneFormat::AliceVision => alicevision::read(path, photos),
        SceneFormat::RealityCaptureCsv => realitycapture::read_table(path, photos),
        SceneFormat::RealityCaptureXmp => realitycapture::read_folder(path, photos),
        SceneFormat::Nerfstudio => nerfstudio::read(path, photos),
    }?;
    fit::fit_to_files(&mut scene)?;
    for remark in &mut scene.remarks {
        *remark = printable(remark, MOST_CHARS);
    }
    Ok(scene)
}
