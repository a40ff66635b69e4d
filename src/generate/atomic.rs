//! Files that appear only when they are complete.

use super::GenerateError;
use std::{
    fs::{File, OpenOptions},
    io::{self, Write},
    path::Path,
};

/// Lets `fill` write a new file beside `path` and renames it to `path` at the end. When anything fails,
/// `path` is as it was and the new file is gone.
///
/// A link is followed, so that the file it names is replaced and not the link. What is no plain file (a
/// pipe, `/dev/null`) is written directly.
pub(crate) fn write(
    path: &Path,
    fill: impl FnOnce(&mut File) -> Result<(), GenerateError>,
) -> Result<(), GenerateError> {
    let failed = |source: io::Error| GenerateError::Write {
        path: path.to_owned(),
        source,
    };
    // An error of the stream says nothing of the file; from here on it does.
    let named = |error| match error {
        GenerateError::Stream(source) => failed(source),
        other => other,
    };

    match path.metadata() {
        Ok(found) if found.is_dir() => {
            return Err(failed(io::Error::from(io::ErrorKind::IsADirectory)));
        }
        Ok(found) if !found.is_file() => {
            let mut file = OpenOptions::new().write(true).open(path).map_err(failed)?;
            return fill(&mut file).map_err(named);
        }
        _ => {}
    }
    let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".surfel-").suffix(".part");
    // A temporary file is private by default; this one becomes the user's, under the user's mask.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder).map_err(failed)?;
    fill(file.as_file_mut()).map_err(named)?;
    file.as_file_mut().flush().map_err(failed)?;
    file.persist(&target).map_err(|error| failed(error.error))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_leaves_what_was_there() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("model.ply");
        std::fs::write(&path, "old").expect("written");
        let result = write(&path, |file| {
            file.write_all(b"half")?;
            Err(GenerateError::Cancelled)
        });
        assert!(matches!(result, Err(GenerateError::Cancelled)));
        assert_eq!(std::fs::read(&path).expect("read"), b"old");
        assert_eq!(std::fs::read_dir(&folder).expect("listed").count(), 1);

        write(&path, |file| Ok(file.write_all(b"new")?)).expect("written");
        assert_eq!(std::fs::read(&path).expect("read"), b"new");
        assert_eq!(std::fs::read_dir(&folder).expect("listed").count(), 1);
    }

    #[test]
    fn an_impossible_place_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let missing = folder.path().join("none").join("model.ply");
        for path in [missing.as_path(), folder.path()] {
            let error = write(path, |_| Ok(())).expect_err("not writable");
            let text = error.to_string();
            assert!(text.contains(&path.display().to_string()), "{text}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_and_devices_stay() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        let link = folder.path().join("link");
        std::fs::write(&file, "old").expect("written");
        std::os::unix::fs::symlink(&file, &link).expect("linked");
        write(&link, |file| Ok(file.write_all(b"new")?)).expect("written");
        assert!(link.symlink_metadata().expect("there").is_symlink());
        assert_eq!(std::fs::read(&file).expect("read"), b"new");

        write(Path::new("/dev/null"), |file| Ok(file.write_all(b"x")?)).expect("written");
        assert!(!Path::new("/dev/null").metadata().expect("there").is_file());
    }
}
