//! Recordings of input: JSON lines, one an event, with the number of the step in which it was handled.
//!
//! A step handles the events that have come and then draws, if anything has changed. Nothing else decides what is
//! drawn: time passes and models arrive as events as well. So the same steps give the same pictures.

use super::event::ViewerEvent;
use crate::printable::{MOST_CHARS, printable};
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Why a recording cannot be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The file cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A line is not what it should be.
    #[error("{path}, line {line}: {cause}")]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        cause: String,
    },
}

/// The first line.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct RecordHead {
    surfel_input: u32,
}

/// Version of the format.
const VERSION: u32 = 1;

/// Most steps between two lines: a damaged number must not become hours of nothing.
const LARGEST_GAP: u64 = 1_000_000;

/// An event with its step and its time in seconds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordEntry {
    /// Number of the step.
    pub step: u64,
    /// Seconds since the window opened.
    pub time: f64,
    /// What happened.
    pub event: ViewerEvent,
}

/// Writes a recording.
pub struct EventRecorder {
    path: PathBuf,
    out: Box<dyn Write>,
}

impl std::fmt::Debug for EventRecorder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}

impl EventRecorder {
    /// Begins a recording; a file that is there is replaced.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn create(path: &Path) -> Result<Self, RecordError> {
        let file = std::fs::File::create(path).map_err(|source| RecordError::File {
            path: path.to_owned(),
            source,
        })?;
        let mut recorder = Self {
            path: path.to_owned(),
            out: Box::new(std::io::BufWriter::new(file)),
        };
        recorder.line(&RecordHead {
            surfel_input: VERSION,
        })?;
        Ok(recorder)
    }

    fn line(&mut self, value: &impl Serialize) -> Result<(), RecordError> {
        let outcome = serde_json::to_string(value)
            .map_err(std::io::Error::from)
            .and_then(|text| writeln!(self.out, "{text}"));
        outcome.map_err(|source| RecordError::File {
            path: self.path.clone(),
            source,
        })
    }

    /// Adds the events of a step.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn add(&mut self, entries: &[RecordEntry]) -> Result<(), RecordError> {
        entries.iter().try_for_each(|entry| self.line(entry))
    }

    /// Writes what is still held back.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn finish(&mut self) -> Result<(), RecordError> {
        self.out.flush().map_err(|source| RecordError::File {
            path: self.path.clone(),
            source,
        })
    }
}

/// Reads a recording.
///
/// # Errors
/// When the file cannot be read, is no recording, or a line is damaged.
pub fn read(path: &Path) -> Result<Vec<RecordEntry>, RecordError> {
    let text = std::fs::read_to_string(path).map_err(|source| RecordError::File {
        path: path.to_owned(),
        source,
    })?;
    let fail = |line: usize, cause: String| RecordError::Line {
        path: path.to_owned(),
        line,
        cause,
    };
    let mut lines = text.lines().enumerate();
    let head = lines.next().map_or("", |(_, line)| line);
    match serde_json::from_str::<RecordHead>(head) {
        Ok(RecordHead {
            surfel_input: VERSION,
        }) => {}
        Ok(head) => {
            return Err(fail(
                1,
                format!(
                    "a recording of version {}; this program reads {VERSION}",
                    head.surfel_input
                ),
            ));
        }
        Err(_) => {
            return Err(fail(
                1,
                format!("no recording of input; expected {{\"surfel_input\":{VERSION}}}"),
            ));
        }
    }
    let mut entries: Vec<RecordEntry> = Vec::new();
    for (index, line) in lines {
        let number = index + 1;
        if line.trim().is_empty() {
            continue;
        }
        let entry: RecordEntry = serde_json::from_str(line)
            .map_err(|error| fail(number, printable(&error.to_string(), MOST_CHARS)))?;
        let before = entries.last().map_or(0, |e| e.step);
        if entry.step < before || entry.step - before > LARGEST_GAP {
            return Err(fail(
                number,
                format!("step {} after step {before}", entry.step),
            ));
        }
        if !entry.time.is_finite() {
            return Err(fail(number, "the time is no number".into()));
        }
        entries.push(entry);
    }
    Ok(entries)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    #[test]
    fn what_was_recorded_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("input.jsonl");
        let entries: Vec<RecordEntry> = (0..5)
            .map(|i| RecordEntry {
                step: i / 2,
                time: 0.25 * i as f64,
                event: ViewerEvent::Cursor([i as f64, 0.1]),
            })
            .collect();
        let mut recorder = EventRecorder::create(&path).unwrap();
        recorder.add(&entries[..2]).unwrap();
        recorder.add(&entries[2..]).unwrap();
        recorder.finish().unwrap();
        assert_eq!(read(&path).unwrap(), entries);
    }

    #[test]
    fn damage_is_told_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("input.jsonl");
        let event = r#"{"step":3,"time":0.0,"event":"cursor_gone"}"#;
        for (text, line, part) in [
            (String::new(), 1, "no recording"),
            ("{\"step\":1}".into(), 1, "no recording"),
            ("{\"surfel_input\":9}".into(), 1, "version 9"),
            (
                format!("{{\"surfel_input\":1}}\n{event}\n{{\"step\":4"),
                3,
                "EOF",
            ),
            (
                format!(
                    "{{\"surfel_input\":1}}\n{event}\n\n{}",
                    event.replace('3', "2")
                ),
                4,
                "after step 3",
            ),
            (
                format!("{{\"surfel_input\":1}}\n{}", event.replace('3', "99999999")),
                2,
                "after step 0",
            ),
            (
                format!(
                    "{{\"surfel_input\":1}}\n{}",
                    event.replace("\"cursor_gone\"", "{\"jump\":1}")
                ),
                2,
                "jump",
            ),
        ] {
            std::fs::write(&path, &text).unwrap();
            let error = read(&path).unwrap_err().to_string();
            assert!(
                error.contains(&format!("line {line}:")) && error.contains(part),
                "{text:?}: {error}"
            );
        }
        let missing = read(&folder.path().join("none.jsonl")).unwrap_err();
        assert!(missing.to_string().contains("none.jsonl"));
    }
}
