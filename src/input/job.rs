//! What every reader carries: the name for messages, the options, the progress, the warnings so far.

use std::path::{Path, PathBuf};

use super::coordinate_records::CoordinateRecords;
use super::part::{PartFault, PartInventory};
use super::text::{line_of, shown};
use super::{Error, FilePlace, ReadOptions, ReadWarning};
use crate::mesh::attributes::PointAttributes;
use crate::mesh::faces::FaceRepairs;
use crate::mesh::scanners::ScannerPlaces;
use crate::printable::{MOST_CHARS, printable};
use crate::progress::Progress;

/// Bytes between two looks at the progress: often enough to cancel at once, rare enough to cost nothing.
const STEP: usize = 4 << 20;

/// One file being read.
pub(super) struct ReadJob<'a> {
    /// The file as messages name it.
    pub(super) path: &'a Path,
    /// Where files that the model names are looked for; `None` when the model has no place of its own.
    pub(super) folder: Option<&'a Path>,
    pub(super) options: &'a ReadOptions,
    pub(super) progress: &'a dyn Progress,
    pub(super) warnings: Vec<ReadWarning>,
    pub(super) inventory: PartInventory,
    /// What the points carry beside position, normal and color, in the order of the positions.
    pub(super) attributes: PointAttributes,
    /// Places of the scanners of the points, in the order of the positions.
    pub(super) scanners: ScannerPlaces,
    /// Coordinate system of a LAS file.
    pub(super) coordinate_records: CoordinateRecords,
    reported: usize,
}

impl<'a> ReadJob<'a> {
    pub(super) fn new(
        path: &'a Path,
        folder: Option<&'a Path>,
        options: &'a ReadOptions,
        progress: &'a dyn Progress,
    ) -> Self {
        Self {
            path,
            folder,
            options,
            progress,
            warnings: Vec::new(),
            inventory: PartInventory::default(),
            attributes: PointAttributes::default(),
            scanners: ScannerPlaces::default(),
            coordinate_records: CoordinateRecords::default(),
            reported: 0,
        }
    }

    fn owned_path(&self) -> PathBuf {
        self.path.to_owned()
    }

    /// Tells that a reader has reached `at`, an offset that never falls; `Err(Cancelled)` when it should stop.
    #[inline]
    pub(super) fn reach(&mut self, at: usize) -> Result<(), Error> {
        if at.saturating_sub(self.reported) < STEP {
            Ok(())
        } else {
            self.report(at)
        }
    }

    /// Tells progress that was made elsewhere up to `at`, whatever the distance.
    #[cold]
    pub(super) fn report(&mut self, at: usize) -> Result<(), Error> {
        self.progress
            .advance(at.saturating_sub(self.reported) as u64);
        self.reported = self.reported.max(at);
        if self.progress.is_cancelled() {
            Err(Error::Cancelled)
        } else {
            Ok(())
        }
    }

    /// Takes note that all up to `at` was told to the progress by somebody else.
    pub(super) fn skip_to(&mut self, at: usize) {
        self.reported = self.reported.max(at);
    }

    pub(super) fn warn(&mut self, warning: ReadWarning) {
        self.warnings.push(warning);
    }

    /// Warns only when `count` is not zero.
    pub(super) fn warn_count(&mut self, count: u64, warning: impl FnOnce(u64) -> ReadWarning) {
        if count > 0 {
            self.warnings.push(warning(count));
        }
    }

    /// Counts a fault of something that decides no shape.
    #[cold]
    pub(super) fn fault(&mut self, fault: PartFault, data: &[u8], at: usize) {
        self.inventory.fault(fault, 1, || at_line(data, at));
    }

    /// Says what was done about faces.
    pub(super) fn warn_repairs(&mut self, repairs: FaceRepairs) {
        self.warn_count(repairs.opposed, |count| ReadWarning::FacesOpposed { count });
        self.warn_count(repairs.turned, |count| ReadWarning::FacesTurned { count });
    }

    pub(super) fn empty(&self, what: &'static str) -> Error {
        Error::Empty {
            path: self.owned_path(),
            what,
        }
    }

    pub(super) fn unread(&self, format: &'static str) -> Error {
        Error::UnreadFormat {
            path: self.owned_path(),
            format,
        }
    }

    pub(super) fn too_large(&self, what: &'static str, found: u64, limit: u64) -> Error {
        Error::TooLarge {
            path: self.owned_path(),
            what,
            found,
            limit,
        }
    }

    pub(super) fn syntax(&self, place: FilePlace, reason: impl Into<String>) -> Error {
        Error::Syntax {
            path: self.owned_path(),
            place,
            reason: printable(&reason.into(), MOST_CHARS),
        }
    }

    pub(super) fn number(&self, place: FilePlace, word: &[u8], wanted: &'static str) -> Error {
        Error::Number {
            path: self.owned_path(),
            place,
            token: shown(word),
            wanted,
        }
    }

    pub(super) fn truncated(&self, place: FilePlace, missing: impl Into<String>) -> Error {
        Error::Truncated {
            path: self.owned_path(),
            place,
            missing: printable(&missing.into(), MOST_CHARS),
        }
    }

    pub(super) fn index(
        &self,
        place: FilePlace,
        what: &'static str,
        index: i64,
        count: u64,
        first: u32,
    ) -> Error {
        Error::Index {
            path: self.owned_path(),
            place,
            what,
            index,
            count,
            first,
        }
    }

    /// Refuses a vertex count that 32-bit indices or the limits cannot hold.
    pub(super) fn check_vertices(&self, count: u64) -> Result<(), Error> {
        let limit = self.options.limits.vertices.min(u64::from(u32::MAX));
        if count > limit {
            Err(self.too_large("vertices", count, limit))
        } else {
            Ok(())
        }
    }
}

/// The place of a byte in a text file.
pub(super) fn at_line(data: &[u8], at: usize) -> FilePlace {
    FilePlace::Line(line_of(data, at))
}
