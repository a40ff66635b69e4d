//! Tools of all readers: files with a limit, words and bytes with a place for errors, and the search for photographs.

use crate::photos::error::PhotoError;
use crate::photos::lens::CameraLens;
use crate::photos::scene::{CalibratedCamera, ScenePhoto, file_name};
use glam::{DMat3, DQuat, DVec3};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Largest file of a scene, bytes.
const LARGEST_FILE: u64 = 4 << 30;

/// Reads a whole file.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, PhotoError> {
    let failed = |cause: String| PhotoError::Read {
        path: path.to_owned(),
        cause,
    };
    let file = File::open(path).map_err(|e| failed(e.to_string()))?;
    let mut bytes = Vec::new();
    file.take(LARGEST_FILE + 1)
        .read_to_end(&mut bytes)
        .map_err(|e| failed(e.to_string()))?;
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(failed("it is larger than 4 GiB".into()));
    }
    Ok(bytes)
}

/// Reads a whole text file; what is not UTF-8 becomes replacement characters.
pub(super) fn read_text(path: &Path) -> Result<String, PhotoError> {
    let bytes = read_bytes(path)?;
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    Ok(String::from_utf8_lossy(text).into_owned())
}

/// Words of a text, across lines, with the number of the line for errors.
#[derive(Debug)]
pub(super) struct WordReader<'a> {
    path: &'a Path,
    rest: &'a str,
    pub(super) line: usize,
}

impl<'a> WordReader<'a> {
    pub(super) fn new(path: &'a Path, text: &'a str) -> Self {
        Self {
            path,
            rest: text,
            line: 1,
        }
    }

    /// The rest of the current line, without what surrounds it; `None` at the end of the text.
    pub(super) fn line_text(&mut self) -> Option<&'a str> {
        if self.rest.is_empty() {
            return None;
        }
        let (line, rest) = self.rest.split_once('\n').unwrap_or((self.rest, ""));
        self.rest = rest;
        self.line += 1;
        Some(line.trim())
    }

    pub(super) fn word(&mut self) -> Option<&'a str> {
        let start = self.rest.trim_start();
        let skipped = &self.rest[..self.rest.len() - start.len()];
        self.line += skipped.bytes().filter(|b| *b == b'\n').count();
        let end = start.find(char::is_whitespace).unwrap_or(start.len());
        let (word, rest) = start.split_at(end);
        self.rest = rest;
        (!word.is_empty()).then_some(word)
    }

    pub(super) fn number(&mut self, what: &str) -> Result<f64, PhotoError> {
        let Some(word) = self.word() else {
            return Err(self.error(format!("the file ends where {what} is expected")));
        };
        word.parse()
            .map_err(|_| self.error(format!("{} is no number; {what} is expected", shown(word))))
    }

    pub(super) fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N], PhotoError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.number(what)?;
        }
        Ok(values)
    }

    pub(super) fn count(&mut self, what: &str) -> Result<u64, PhotoError> {
        let Some(word) = self.word() else {
            return Err(self.error(format!("the file ends where {what} is expected")));
        };
        word.parse()
            .map_err(|_| self.error(format!("{} is no count; {what} is expected", shown(word))))
    }

    pub(super) fn error(&self, cause: impl Into<String>) -> PhotoError {
        PhotoError::at_line(self.path, self.line, cause)
    }
}

/// A word for a message.
pub(super) fn shown(word: &str) -> String {
    let text: String = word.chars().take(40).filter(|c| !c.is_control()).collect();
    format!("\"{text}\"")
}

/// Little-endian numbers of a binary file.
#[derive(Debug)]
pub(super) struct ByteReader<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    pub(super) at: usize,
}

impl<'a> ByteReader<'a> {
    pub(super) fn new(path: &'a Path, bytes: &'a [u8]) -> Self {
        Self { path, bytes, at: 0 }
    }

    pub(super) fn take(&mut self, length: u64, what: &str) -> Result<&'a [u8], PhotoError> {
        let left = (self.bytes.len() - self.at) as u64;
        if length > left {
            return Err(self.error(format!(
                "{what} has {length} bytes, but {left} are left; the file is cut short or damaged"
            )));
        }
        let start = self.at;
        self.at += length as usize;
        Ok(&self.bytes[start..self.at])
    }

    pub(super) fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], PhotoError> {
        let mut value = [0; N];
        value.copy_from_slice(self.take(N as u64, what)?);
        Ok(value)
    }

    pub(super) fn u32(&mut self, what: &str) -> Result<u32, PhotoError> {
        Ok(u32::from_le_bytes(self.array(what)?))
    }

    pub(super) fn f32(&mut self, what: &str) -> Result<f32, PhotoError> {
        Ok(f32::from_le_bytes(self.array(what)?))
    }

    pub(super) fn f64(&mut self, what: &str) -> Result<f64, PhotoError> {
        Ok(f64::from_le_bytes(self.array(what)?))
    }

    pub(super) fn f64s<const N: usize>(&mut self, what: &str) -> Result<[f64; N], PhotoError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64(what)?;
        }
        Ok(values)
    }

    /// A count of things of at least `least` bytes each: more than are left is an error, so nothing is ever allocated for it.
    pub(super) fn count(&mut self, least: u64, what: &str) -> Result<u64, PhotoError> {
        let count = u64::from_le_bytes(self.array(what)?);
        let left = (self.bytes.len() - self.at) as u64;
        if count.checked_mul(least).is_none_or(|bytes| bytes > left) {
            return Err(self.error(format!(
                "there are {count} {what}, more than the {left} bytes that are left can hold; the file is cut short or damaged"
            )));
        }
        Ok(count)
    }

    pub(super) fn error(&self, cause: impl Into<String>) -> PhotoError {
        PhotoError::format(self.path, format!("byte {}", self.at), cause)
    }
}

/// The rotation of a quaternion w x y z of any length but 0.
pub(super) fn rotation([w, x, y, z]: [f64; 4]) -> Option<DMat3> {
    let length = (w * w + x * x + y * y + z * z).sqrt();
    (length > 1e-9 && length.is_finite())
        .then(|| DMat3::from_quat(DQuat::from_xyzw(x, y, z, w) * (1.0 / length)))
}

/// The matrix of nine numbers, row by row.
pub(super) fn rows(values: [f64; 9]) -> DMat3 {
    DMat3::from_cols_array(&values).transpose()
}

/// A camera of camera space from world space x -> R x + t.
pub(super) fn camera_of(rotation: DMat3, translation: DVec3) -> CalibratedCamera {
    CalibratedCamera {
        width: 0,
        height: 0,
        focal: [1.0; 2],
        principal: [0.0; 2],
        lens: CameraLens::default(),
        rotation,
        center: -(rotation.transpose() * translation),
    }
}

/// The photographs beside a scene.
#[derive(Debug, Clone)]
pub(super) struct PhotoFolders {
    folders: Vec<PathBuf>,
}

/// Names of folders that programs put photographs into.
const FOLDERS: &[&str] = &["images", "image", "photos", "undistorted", "visualize"];

impl PhotoFolders {
    /// Folders in which photographs of a scene's file are looked for: `given` first, then beside the file and up to three
    /// folders above it.
    pub(super) fn new(file: &Path, given: Option<&Path>) -> Self {
        let mut folders: Vec<PathBuf> = given.map(Path::to_owned).into_iter().collect();
        let start = file.parent().unwrap_or(Path::new(""));
        let mut above = Some(start);
        for _ in 0..4 {
            let Some(folder) = above else { break };
            folders.push(folder.to_owned());
            folders.extend(FOLDERS.iter().map(|name| folder.join(name)));
            above = folder.parent();
        }
        Self { folders }
    }

    /// The file of a name: as it stands, then below each folder, then by its last part. Names of other systems have back
    /// slashes, or folders that are not here.
    pub(super) fn find(&self, name: &str) -> Option<PathBuf> {
        let slashes = name.replace('\\', "/");
        let last = file_name(name);
        let ways = [slashes.as_str(), last];
        let is_there = |path: &PathBuf| !path.as_os_str().is_empty() && path.is_file();
        for way in ways.iter().filter(|way| !way.is_empty()) {
            for folder in &self.folders {
                let path = folder.join(way.trim_start_matches("./"));
                if is_there(&path) {
                    return Some(path);
                }
            }
        }
        // Endings differ in case, and some formats leave them out.
        for folder in &self.folders {
            for way in ways {
                for ending in ["jpg", "JPG", "jpeg", "JPEG", "png", "PNG"] {
                    let path = folder.join(way);
                    for path in [
                        path.with_extension(ending),
                        folder.join(format!("{way}.{ending}")),
                    ] {
                        if is_there(&path) {
                            return Some(path);
                        }
                    }
                }
            }
        }
        None
    }
}

/// Width and height that a photograph's file says, without decoding it.
pub(super) fn stored_size(path: &Path) -> Option<[u32; 2]> {
    let reader = ::image::ImageReader::open(path)
        .ok()?
        .with_guessed_format()
        .ok()?;
    let (width, height) = reader.into_dimensions().ok()?;
    Some([width, height])
}

/// A photograph of a scene, before its file was looked at.
#[derive(Debug, Clone)]
pub(super) struct FoundPhoto {
    pub(super) name: String,
    pub(super) mask: Option<String>,
    pub(super) camera: CalibratedCamera,
    /// The principal point is relative to the middle of the photograph.
    pub(super) is_centered: bool,
    /// Focal length and principal point are in units of the photograph's larger side.
    pub(super) is_normalized: bool,
}

impl FoundPhoto {
    pub(super) fn new(name: impl Into<String>, camera: CalibratedCamera) -> Self {
        Self {
            name: name.into(),
            mask: None,
            camera,
            is_centered: false,
            is_normalized: false,
        }
    }

    /// Finds its file, and completes the camera by the size of the photograph where the scene's file has none.
    pub(super) fn locate(self, folders: &PhotoFolders) -> ScenePhoto {
        let file = folders.find(&self.name);
        let mut camera = self.camera;
        let is_unknown = camera.width == 0 || camera.height == 0;
        let stored = file.as_deref().filter(|_| is_unknown).and_then(stored_size);
        if let Some([width, height]) = stored {
            (camera.width, camera.height) = (width, height);
        }
        let [w, h] = [camera.width, camera.height].map(f64::from);
        if self.is_normalized {
            let larger = w.max(h).max(1.0);
            camera.focal = camera.focal.map(|f| f * larger);
            camera.principal = camera.principal.map(|c| c * larger);
        }
        if self.is_centered {
            camera.principal = [camera.principal[0] + 0.5 * w, camera.principal[1] + 0.5 * h];
        }
        ScenePhoto {
            mask: self.mask.and_then(|mask| folders.find(&mask)),
            name: self.name,
            file,
            camera,
        }
    }
}
