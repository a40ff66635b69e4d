//! Mean and tail of an error over many pixels.

/// An error over the pixels where it is defined; all zero for none.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct SampleSpread {
    /// How many values there were.
    pub count: u64,
    /// Mean.
    pub mean: f64,
    /// 99th percentile (nearest rank).
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

impl SampleSpread {
    /// Of values that are not NaN; infinite ones make the mean infinite.
    pub fn of(mut values: Vec<f64>) -> Self {
        values.retain(|v| !v.is_nan());
        let n = values.len();
        if n == 0 {
            return Self::default();
        }
        values.sort_by(f64::total_cmp);
        Self {
            count: n as u64,
            mean: values.iter().sum::<f64>() / n as f64,
            p99: values[((0.99 * n as f64).ceil() as usize).clamp(1, n) - 1],
            max: values[n - 1],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_percent_of_the_values_is_above_the_percentile() {
        let d = SampleSpread::of((1..=200).rev().map(f64::from).chain([f64::NAN]).collect());
        assert_eq!((d.count, d.mean, d.p99, d.max), (200, 100.5, 198.0, 200.0));
        assert_eq!(SampleSpread::of(Vec::new()), SampleSpread::default());
        assert_eq!(
            SampleSpread::of(vec![1.0, f64::INFINITY]).mean,
            f64::INFINITY
        );
    }
}
