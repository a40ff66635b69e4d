//! Times and counts of many frames, and how far a picture is from its reference.
//!
//! [`crate::image::compare`] has the differences of colors; here are those of coverage ([`coverage()`]), outline
//! ([`silhouette()`]), depth and normals ([`depth_error`], [`normal_error`]), those that people see ([`flip`],
//! [`ssim`]), and the place where pictures differ most ([`worst_tile`]). [`profile`] is what a run of frames cost, with
//! its report and its trace; [`patches`] sets the cut by error beside that by size; [`temporal`] is how steady pictures are while time passes, and [`motion`] makes them.

mod coverage;
pub mod frames;
pub mod motion;
pub mod patches;
mod perceived;
pub mod profile;
pub mod report;
mod silhouette;
mod spread;
pub mod store;
mod surface;
pub mod temporal;
mod tile;
pub mod trace;

pub use coverage::{CoverageErrors, CoverageMask, coverage};
pub use perceived::{FlipErrors, PIXELS_PER_DEGREE, flip, ssim};
pub use silhouette::silhouette;
pub(crate) use silhouette::squared_distances;
pub use spread::SampleSpread;
pub use surface::{depth_error, normal_error};
pub use tile::{PictureTile, crop, worst_tile};

/// The commit that this program was built from, as files of figures name it: 12 hexadecimal digits, or what
/// `SURFEL_COMMIT` was set to at build time. Empty in builds for
/// development, and where neither git nor that told.
pub const COMMIT: &str = env!("SURFEL_COMMIT");

/// Median and spread of a sample.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct ValueDistribution {
    /// Middle value (mean of the two middle ones for an even count).
    pub median: f64,
    /// 5th percentile (nearest rank).
    pub p5: f64,
    /// 95th percentile (nearest rank).
    pub p95: f64,
}

impl ValueDistribution {
    /// Of the finite values of a sample; zeros for none.
    pub fn of(values: &[f64]) -> Self {
        let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        if sorted.is_empty() {
            return Self::default();
        }
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let rank = |p: f64| sorted[((p * n as f64).ceil() as usize).clamp(1, n) - 1];
        Self {
            median: (sorted[(n - 1) / 2] + sorted[n / 2]) / 2.0,
            p5: rank(0.05),
            p95: rank(0.95),
        }
    }
}

/// Bounds between which the median of what a sample was drawn from lies, with a probability of 95 percent (by ranks,
/// so whatever its shape); the whole range of a sample of less than 6, which is less sure, `None` of an empty one.
pub fn median_bounds(values: &[f64]) -> Option<[f64; 2]> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    // How many values lie below the median is binomial: n/2 with a standard deviation of sqrt(n)/2.
    let rank = (n as f64 / 2.0 - 0.98 * (n as f64).sqrt()).max(1.0) as usize;
    Some([*sorted.get(rank - 1)?, sorted[n - rank]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_ranks() {
        let values: Vec<f64> = (1..=100).map(f64::from).collect();
        let d = ValueDistribution::of(&values);
        assert_eq!((d.median, d.p5, d.p95), (50.5, 5.0, 95.0));
        assert_eq!(ValueDistribution::of(&[3.0]).median, 3.0);
        assert_eq!(
            ValueDistribution::of(&[f64::NAN]),
            ValueDistribution::default()
        );
    }

    #[test]
    fn bounds_of_a_median_are_ranks() {
        // The ranks of the tables of the sign test.
        let values: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(median_bounds(&values), Some([40.0, 61.0]));
        assert_eq!(median_bounds(&[2.0, 1.0, 4.0]), Some([1.0, 4.0]));
        assert_eq!(median_bounds(&[7.0]), Some([7.0, 7.0]));
        assert_eq!(median_bounds(&[f64::NAN]), None);
    }
}
