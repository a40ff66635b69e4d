//! How long work tells how far it is, and learns that it should stop.

use glam::DVec3;

/// Receives the progress of long work and can cancel it.
///
/// Implementations must be cheap: workers call [`advance`](Progress::advance) a few thousand times at most
/// for a whole job, from any thread.
pub trait Progress: Sync {
    /// A stage begins; `total` is its size in units of its own (bytes, triangles), 0 when unknown.
    fn stage(&self, name: &str, total: u64);
    /// `amount` more units of the current stage are done.
    fn advance(&self, amount: u64);
    /// Tells whether the work should stop as soon as it can; it then returns its `Cancelled` error.
    fn is_cancelled(&self) -> bool {
        false
    }
    /// Tells whether a coarse sample of points is wanted long before all are read.
    fn wants_sample(&self) -> bool {
        false
    }
    /// Takes such a sample, once.
    fn sample(&self, _sample: PointSample) {}
}

/// A few points of a file, from all over it.
#[derive(Debug, Clone, PartialEq)]
pub struct PointSample {
    /// Places in the coordinates of the file.
    pub places: Vec<DVec3>,
    /// Red, green, blue and 255 of each; none where the file has no colors.
    pub colors: Vec<[u8; 4]>,
}

/// Reports nothing and never cancels.
#[derive(Debug, Clone, Copy, Default)]
pub struct SilentProgress;

impl Progress for SilentProgress {
    fn stage(&self, _name: &str, _total: u64) {}
    fn advance(&self, _amount: u64) {}
}
