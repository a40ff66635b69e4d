//! Times and counts of many frames: distributions, the last frames of a window, the profile of a run with its report
//! and its trace.

pub mod frames;
pub mod profile;
pub mod report;
pub mod trace;

/// Median and spread of a sample.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct Distribution {
    /// Middle value (mean of the two middle ones for an even count).
    pub median: f64,
    /// 5th percentile (nearest rank).
    pub p5: f64,
    /// 95th percentile (nearest rank).
    pub p95: f64,
}

impl Distribution {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_ranks() {
        let values: Vec<f64> = (1..=100).map(f64::from).collect();
        let d = Distribution::of(&values);
        assert_eq!((d.median, d.p5, d.p95), (50.5, 5.0, 95.0));
        assert_eq!(Distribution::of(&[3.0]).median, 3.0);
        assert_eq!(Distribution::of(&[f64::NAN]), Distribution::default());
    }
}
