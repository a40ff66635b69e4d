//! Numbers for the tests: the same in every run.

use glam::DVec3;

/// A linear congruential generator, its upper bits.
#[derive(Debug)]
pub(crate) struct TestNumbers(pub(crate) u64);

impl TestNumbers {
    /// The next number of 0 to 1, without 1.
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A whole number below `end`.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.unit() * end as f64) as usize
    }

    /// A direction, evenly spread.
    pub(crate) fn direction(&mut self) -> DVec3 {
        let z = 2.0 * self.unit() - 1.0;
        let azimuth = self.unit() * std::f64::consts::TAU;
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * azimuth.cos(), r * azimuth.sin(), z)
    }

    /// A point of the unit ball, evenly spread.
    pub(crate) fn in_ball(&mut self) -> DVec3 {
        self.direction() * self.unit().cbrt()
    }
}
