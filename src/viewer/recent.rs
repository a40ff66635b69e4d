//! Files that were shown, to be opened again from the panel.

use std::path::{Path, PathBuf};

/// How many are kept.
const MOST: usize = 10;

/// Files that were shown, the last one first.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RecentFiles {
    files: Vec<PathBuf>,
}

impl RecentFiles {
    /// Files of a list, which somebody may have written: without doubles, and not too many.
    pub fn new(files: &[PathBuf]) -> Self {
        let mut kept = Self::default();
        for file in files.iter().rev() {
            kept.put(file.clone());
        }
        kept
    }

    /// Notes a file that is shown. What is no file, such as standard input and generated models, is not noted.
    pub fn add(&mut self, path: &Path) {
        if let Ok(whole) = path.canonicalize()
            && whole.is_file()
        {
            self.put(whole);
        }
    }

    fn put(&mut self, path: PathBuf) {
        self.files.retain(|other| *other != path);
        self.files.insert(0, path);
        self.files.truncate(MOST);
    }

    /// The files.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    #[test]
    fn the_last_one_is_first_and_each_is_there_once() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().canonicalize().unwrap();
        let paths: Vec<PathBuf> = (0..MOST + 2).map(|i| folder.join(format!("{i}"))).collect();
        let mut recent = RecentFiles::default();
        for path in &paths {
            std::fs::write(path, "x").unwrap();
            recent.add(path);
        }
        recent.add(&paths[3]);
        recent.add(&folder.join(".").join("3"));
        for other in ["-", "generate:sphere", "http://host/a.surfel", "gone.ply"] {
            recent.add(Path::new(other));
        }
        recent.add(&folder);
        assert_eq!(recent.files().len(), MOST);
        assert_eq!(
            recent.files()[..2],
            [paths[3].clone(), paths[MOST + 1].clone()]
        );
        // What the settings file holds comes back as it was.
        assert_eq!(RecentFiles::new(recent.files()), recent);
        let doubled = [&paths[0], &paths[1], &paths[0]].map(Clone::clone);
        assert_eq!(RecentFiles::new(&doubled).files(), &paths[..2]);
    }
}
