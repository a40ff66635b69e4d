//! Files that are opened again when another program has written them.

use std::path::PathBuf;
use std::time::SystemTime;

/// Seconds between two looks at the files. A file that has changed counts once it is the same at two looks: until then it is
/// being written.
pub(super) const WATCH_INTERVAL_S: f64 = 0.5;

/// Time of the last change of a file, and its size in bytes; none where it is not there.
type FileState = Option<(SystemTime, u64)>;

/// The files that are shown, as they were when they were opened.
#[derive(Debug, Default)]
pub(super) struct FileWatch {
    files: Vec<PathBuf>,
    opened: Vec<FileState>,
    last: Vec<FileState>,
    looked_at_s: f64,
}

impl FileWatch {
    /// Looks at the files at `now_s`, seconds of any clock. Returns whether they are to be opened again: one of them is
    /// another than when these files were named first, or than when this was true last, and all are there and rest. While they
    /// are loaded nothing is to be opened; what changes then is told afterwards.
    pub(super) fn has_changed<'p>(
        &mut self,
        files: impl Iterator<Item = &'p PathBuf>,
        now_s: f64,
        is_loading: bool,
    ) -> bool {
        let files: Vec<PathBuf> = files.cloned().collect();
        if files != self.files {
            let state = states(&files);
            *self = Self {
                files,
                opened: state.clone(),
                last: state,
                looked_at_s: now_s,
            };
            return false;
        }
        if now_s - self.looked_at_s < WATCH_INTERVAL_S {
            return false;
        }
        self.looked_at_s = now_s;
        let state = states(&self.files);
        let rests = state == self.last && state.iter().all(Option::is_some);
        self.last = state;
        let has_changed = !is_loading && rests && self.last != self.opened;
        if has_changed {
            self.opened.clone_from(&self.last);
        }
        has_changed
    }
}

fn states(files: &[PathBuf]) -> Vec<FileState> {
    let state = |path: &PathBuf| {
        let facts = path.metadata().ok()?;
        Some((facts.modified().ok()?, facts.len()))
    };
    files.iter().map(state).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_counts_once_it_rests() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let files = [path.clone()];
        std::fs::write(&path, "one").unwrap();
        let mut watch = FileWatch::default();
        let mut look = |now: f64| watch.has_changed(files.iter(), now, false);
        assert!(
            !look(0.0) && !look(1.0) && !look(2.0),
            "nothing was written"
        );
        std::fs::write(&path, "longer").unwrap();
        assert!(!look(2.1), "too early to look");
        assert!(!look(3.0), "it may be being written");
        std::fs::write(&path, "longer still").unwrap();
        assert!(!look(4.0), "it is being written");
        assert!(look(5.0) && !look(6.0), "it is told once");
        std::fs::remove_file(&path).unwrap();
        assert!(!look(7.0) && !look(8.0), "there is nothing to open");
        std::fs::write(&path, "anew").unwrap();
        assert!(!look(9.0) && look(10.0), "it is back");
    }

    #[test]
    fn other_files_are_taken_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["a", "b"].map(|name| folder.path().join(name));
        for path in &paths {
            std::fs::write(path, "x").unwrap();
        }
        let mut watch = FileWatch::default();
        assert!(!watch.has_changed(paths[..1].iter(), 0.0, false));
        std::fs::write(&paths[1], "changed before it was opened").unwrap();
        let mut look = |now: f64, is_loading| watch.has_changed(paths.iter(), now, is_loading);
        assert!(!look(1.0, false) && !look(2.0, false) && !look(3.0, false));
        std::fs::write(&paths[0], "changed while it is loaded").unwrap();
        assert!(!look(4.0, true) && !look(5.0, true) && look(6.0, false));
    }
}
