//! Logarithmic axes.

/// A logarithmic axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlotAxis {
    /// Logarithms to base 10 of both ends.
    log: [f64; 2],
    /// Values of 0 are there; they lie at the lower end.
    pub(super) has_zero: bool,
}

impl PlotAxis {
    /// An axis that has room for all positive values, and at least a factor of 2; 0 counts as below them, the others
    /// not at all.
    pub(super) fn around(values: impl Iterator<Item = f64>) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut has_zero = false;
        for value in values.filter(|v| v.is_finite()) {
            if value > 0.0 {
                low = low.min(value.log10());
                high = high.max(value.log10());
            } else {
                has_zero = true;
            }
        }
        if low > high {
            (low, high) = (-1.0, 0.0);
        }
        let least = 2f64.log10();
        let missing = (least - (high - low)).max(0.0);
        let margin = (high - low) * 0.06 + missing / 2.0;
        // Zeros lie apart from the smallest value.
        let below = if has_zero { margin + 0.15 } else { margin };
        Self {
            log: [low - below, high + margin],
            has_zero,
        }
    }

    /// Where a value lies: 0 at the lower end, 1 at the upper; values beyond them at the ends.
    pub(super) fn place(&self, value: f64) -> f64 {
        if value > 0.0 {
            ((value.log10() - self.log[0]) / (self.log[1] - self.log[0])).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    /// Values with a line each, and whether they have a label too.
    pub(super) fn ticks(&self) -> Vec<(f64, bool)> {
        let span = self.log[1] - self.log[0];
        let labeled: &[u32] = if span > 2.6 {
            &[1]
        } else if span > 1.2 {
            &[1, 3]
        } else if span > 0.7 {
            &[1, 2, 5]
        } else {
            &[1, 2, 3, 4, 5, 6, 8]
        };
        let mut ticks = Vec::new();
        for decade in self.log[0].floor() as i32..=self.log[1].floor() as i32 {
            for step in 1..10u32 {
                let value = f64::from(step) * 10f64.powi(decade);
                if (self.log[0]..=self.log[1]).contains(&value.log10()) {
                    ticks.push((value, labeled.contains(&step)));
                }
            }
        }
        ticks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_lie_in_order_within_the_axis_and_some_ticks_are_labeled() {
        for values in [
            vec![3.0],
            vec![1.0, 1.1],
            vec![0.02, 0.5, 900.0],
            vec![0.0, 4.0, 5.0],
            vec![0.0],
            vec![],
            vec![f64::NAN, f64::INFINITY, 2.0],
        ] {
            let axis = PlotAxis::around(values.iter().copied());
            let places: Vec<f64> = values
                .iter()
                .filter(|v| v.is_finite())
                .map(|v| axis.place(*v))
                .collect();
            assert!(places.iter().all(|p| (0.0..=1.0).contains(p)));
            assert!(places.windows(2).all(|p| p[0] < p[1]), "{places:?}");
            let labels = axis.ticks().iter().filter(|t| t.1).count();
            assert!((1..=9).contains(&labels), "{values:?}: {labels}");
        }
        let axis = PlotAxis::around([1.0, 100.0].into_iter());
        assert!((axis.place(10.0) - 0.5).abs() < 1e-12);
    }
}
