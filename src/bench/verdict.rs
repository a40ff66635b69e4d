//! What a figure has to reach, and whether it does.

/// A bound on a figure, in the figure's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BenchTarget {
    /// At most this.
    AtMost(f64),
    /// At least this.
    AtLeast(f64),
}

impl BenchTarget {
    /// Tells whether a value keeps it; NaN never does.
    pub fn is_met(self, value: f64) -> bool {
        match self {
            Self::AtMost(bound) => value <= bound,
            Self::AtLeast(bound) => value >= bound,
        }
    }

    /// By which factor a value is on the good side: above 1 it is better than the bound, below 1 it misses it, NaN where
    /// the quotient is none.
    pub fn margin(self, value: f64) -> f64 {
        let factor = match self {
            Self::AtMost(bound) => bound / value,
            Self::AtLeast(bound) => value / bound,
        };
        if factor.is_finite() && factor >= 0.0 {
            factor
        } else {
            f64::NAN
        }
    }
}

impl std::fmt::Display for BenchTarget {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::AtMost(bound) => write!(f, "at most {bound}"),
            Self::AtLeast(bound) => write!(f, "at least {bound}"),
        }
    }
}

/// What came of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BenchVerdict {
    /// The figure has no target.
    None,
    /// The figure keeps its target.
    Pass,
    /// The figure misses its target.
    Miss,
    /// The figure was not measured, or something that it needs is not there.
    Absent,
}

impl BenchVerdict {
    /// Of a value and what it has to reach. A value that is NaN is absent, whatever its target.
    pub fn of(value: f64, target: Option<BenchTarget>) -> Self {
        match target {
            _ if value.is_nan() => Self::Absent,
            None => Self::None,
            Some(target) if target.is_met(value) => Self::Pass,
            Some(_) => Self::Miss,
        }
    }

    /// The word in tables and files.
    pub fn word(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Pass => "pass",
            Self::Miss => "MISS",
            Self::Absent => "absent",
        }
    }
}

/// How many figures with a target came to what.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct VerdictTally {
    /// Kept.
    pub passed: usize,
    /// Missed.
    pub missed: usize,
    /// Not measured.
    pub absent: usize,
}

impl VerdictTally {
    /// Counts verdicts of figures with a target.
    pub fn of(verdicts: impl IntoIterator<Item = BenchVerdict>) -> Self {
        let mut tally = Self::default();
        for verdict in verdicts {
            match verdict {
                BenchVerdict::None => {}
                BenchVerdict::Pass => tally.passed += 1,
                BenchVerdict::Miss => tally.missed += 1,
                BenchVerdict::Absent => tally.absent += 1,
            }
        }
        tally
    }
}

/// A way to draw: what it costs and how far it is off.
#[derive(Debug, Clone, PartialEq)]
pub struct ThresholdOffer {
    /// Name of the figure.
    pub name: String,
    /// A frame, milliseconds.
    pub frame_ms: f64,
    /// Mean FLIP over the picture.
    pub flip: f64,
    /// PSNR over object pixels, decibels.
    pub psnr_db: f64,
}

/// Share by which a mean FLIP may be above another and still count as equal: two rasterizers that sample the same places
/// differ by about as much, in pixels on edges.
pub const EQUAL_FLIP: f64 = 0.02;

/// The fastest of the offers whose mean FLIP is at most that of `rival`, within [`EQUAL_FLIP`]; `None` where none is so
/// close to the reference.
pub fn at_equal_flip<'o>(
    offers: &'o [ThresholdOffer],
    rival: &ThresholdOffer,
) -> Option<&'o ThresholdOffer> {
    offers
        .iter()
        .filter(|o| o.flip <= rival.flip * (1.0 + EQUAL_FLIP))
        .min_by(|a, b| a.frame_ms.total_cmp(&b.frame_ms))
}

/// The fastest of the offers with at least this PSNR over object pixels.
pub fn at_psnr(offers: &[ThresholdOffer], least_db: f64) -> Option<&ThresholdOffer> {
    offers
        .iter()
        .filter(|o| o.psnr_db >= least_db)
        .min_by(|a, b| a.frame_ms.total_cmp(&b.frame_ms))
}

/// The most accurate of the offers by mean FLIP.
pub fn most_accurate(offers: &[ThresholdOffer]) -> Option<&ThresholdOffer> {
    offers.iter().min_by(|a, b| a.flip.total_cmp(&b.flip))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    #[test]
    fn a_bound_is_kept_missed_or_absent() {
        let of = |value, target| BenchVerdict::of(value, Some(target));
        assert_eq!(of(0.2, BenchTarget::AtMost(0.2)), BenchVerdict::Pass);
        assert_eq!(of(0.21, BenchTarget::AtMost(0.2)), BenchVerdict::Miss);
        assert_eq!(of(40.0, BenchTarget::AtLeast(40.0)), BenchVerdict::Pass);
        assert_eq!(of(39.9, BenchTarget::AtLeast(40.0)), BenchVerdict::Miss);
        assert_eq!(
            of(f64::INFINITY, BenchTarget::AtMost(1.0)),
            BenchVerdict::Miss
        );
        assert_eq!(
            of(f64::NAN, BenchTarget::AtLeast(0.0)),
            BenchVerdict::Absent
        );
        assert_eq!(BenchVerdict::of(1.0, None), BenchVerdict::None);
        assert_eq!(BenchVerdict::of(f64::NAN, None), BenchVerdict::Absent);
        let words = [
            BenchVerdict::Pass,
            BenchVerdict::Miss,
            BenchVerdict::Absent,
            BenchVerdict::None,
        ]
        .map(BenchVerdict::word);
        assert_eq!(words, ["pass", "MISS", "absent", ""]);
    }

    #[test]
    fn a_margin_is_above_one_on_the_good_side() {
        assert_eq!(BenchTarget::AtLeast(40.0).margin(10.0), 0.25);
        assert_eq!(BenchTarget::AtLeast(40.0).margin(80.0), 2.0);
        assert_eq!(BenchTarget::AtMost(0.2).margin(0.4), 0.5);
        assert_eq!(BenchTarget::AtMost(0.2).margin(0.1), 2.0);
        assert!(BenchTarget::AtMost(0.2).margin(0.0).is_nan());
        assert!(BenchTarget::AtLeast(1.0).margin(f64::NAN).is_nan());
    }

    #[test]
    fn a_tally_counts_what_has_a_target() {
        use BenchVerdict::{Absent, Miss, None, Pass};
        let tally = VerdictTally::of([Pass, None, Miss, Miss, Absent, Pass, Pass]);
        assert_eq!((tally.passed, tally.missed, tally.absent), (3, 2, 1));
    }

    fn offer(name: &str, frame_ms: f64, flip: f64, psnr_db: f64) -> ThresholdOffer {
        ThresholdOffer {
            name: name.into(),
            frame_ms,
            flip,
            psnr_db,
        }
    }

    #[test]
    fn equal_footing_is_the_fastest_that_is_as_close() {
        let offers = [
            offer("coarse", 5.0, 0.05, 18.0),
            offer("fine", 20.0, 0.0119, 30.0),
            offer("finer", 30.0, 0.009, 36.0),
        ];
        let rays = offer("rays", 60.0, 0.0118, 26.0);
        assert_eq!(at_equal_flip(&offers, &rays).unwrap().name, "fine");
        let better = offer("rays", 60.0, 0.01, 26.0);
        assert_eq!(at_equal_flip(&offers, &better).unwrap().name, "finer");
        let best = offer("rays", 60.0, 0.001, 26.0);
        assert_eq!(at_equal_flip(&offers, &best), None);
        assert_eq!(most_accurate(&offers).unwrap().name, "finer");
        assert_eq!(at_psnr(&offers, 29.0).unwrap().name, "fine");
        assert_eq!(at_psnr(&offers, 40.0), None);
        assert_eq!(most_accurate(&[]), None);
    }
}
