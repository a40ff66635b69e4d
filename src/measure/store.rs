//! What was measured on a device, kept in the user's cache folder: one JSON file for each key.
//!
//! Every file repeats its key, so that a reader sees when it is of another device, program or model. What is damaged
//! counts as not there, and is measured again.

use crate::image::Error;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::Debug;
use std::path::{Path, PathBuf};

/// The program's folder in the user's cache, or what `SURFEL_CACHE` names; `None` where the system has no such place.
pub fn folder() -> Option<PathBuf> {
    match std::env::var_os("SURFEL_CACHE") {
        Some(folder) if !folder.is_empty() => Some(PathBuf::from(folder)),
        _ => dirs::cache_dir().map(|f| f.join("surfel")),
    }
}

/// The file of a kind of measurement for a key: `KIND-HASH.json`. The hash is FNV-1a of all parts of the key, because
/// names of devices are no names of files.
pub fn path(folder: &Path, kind: &str, key: &impl Debug) -> PathBuf {
    let text = format!("{key:?}");
    let hash = text.bytes().fold(0xcbf2_9ce4_8422_2325u64, |h, b| {
        (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
    });
    folder.join(format!("{kind}-{hash:016x}.json"))
}

/// Reads a file; `None` where there is none or it is damaged, which the log says.
pub fn read<T: DeserializeOwned>(path: &Path) -> Option<T> {
    let text = std::fs::read_to_string(path).ok()?;
    match serde_json::from_str(&text) {
        Ok(found) => Some(found),
        Err(error) => {
            tracing::warn!("{}: ignored: {error}", path.display());
            None
        }
    }
}

/// Writes a file beside its place and renames it; makes its folder if it is not there.
///
/// # Errors
/// [`Error::Write`] when the folder cannot be made or the file not be written.
pub fn write(path: &Path, value: &impl Serialize) -> Result<(), Error> {
    let fail = |source| Error::Write {
        path: path.to_owned(),
        source,
    };
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(fail)?;
    }
    let text = serde_json::to_string_pretty(value).map_err(|e| fail(std::io::Error::other(e)))?;
    crate::image::write(path, |file| {
        std::io::Write::write_all(file, text.as_bytes())
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read_and_what_is_damaged_is_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("new");
        let file = path(&folder, "costs", &("device", 1));
        assert_ne!(file, path(&folder, "costs", &("device", 2)));
        assert_eq!(read::<Vec<u32>>(&file), None);
        write(&file, &vec![1u32, 2]).unwrap();
        assert_eq!(read::<Vec<u32>>(&file), Some(vec![1, 2]));
        std::fs::write(&file, "[1, 2").unwrap();
        assert_eq!(read::<Vec<u32>>(&file), None);
        // No folder can be made below a file.
        let inside = file.join("below.json");
        assert!(matches!(write(&inside, &1), Err(Error::Write { .. })));
    }
}
