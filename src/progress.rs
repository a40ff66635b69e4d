//! How long work tells how far it is, and learns that it should stop.

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
}

/// Reports nothing and never cancels.
#[derive(Debug, Clone, Copy, Default)]
pub struct SilentProgress;

impl Progress for SilentProgress {
    fn stage(&self, _name: &str, _total: u64) {}
    fn advance(&self, _amount: u64) {}
}
