//! Pass times, and the test that they can be believed.

/// Time of one pass on the device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassTime {
    /// Name of the pass.
    pub name: &'static str,
    /// Milliseconds between the timestamps around it.
    pub ms: f64,
}
