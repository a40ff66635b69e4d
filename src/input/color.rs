//! Colors whose range a file does not say: it follows from the values.
//!
//! Floats mean 0 to 1 until one is above it, integers 0 to 255; then comes the next range, 0 to 255 or 0 to 65535. What
//! was read before is converted: it was small.

use super::ReadWarning;

/// The ranges that writers use, by their largest value.
const RANGES: [f64; 4] = [1.0, 255.0, 65535.0, 4_294_967_295.0];

/// The range of one channel, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ColorRange {
    /// The largest value.
    pub(super) largest: f64,
    /// Whether the values are always of this range.
    is_fixed: bool,
    /// A value is no integer.
    has_fraction: bool,
    /// The ranges that nobody wonders about.
    expected: [f64; 2],
}

impl ColorRange {
    /// Floats: 0 to 1 until a value says more.
    pub(super) const FLOAT: ColorRange = ColorRange {
        largest: 1.0,
        is_fixed: false,
        has_fraction: false,
        expected: [1.0; 2],
    };
    /// Numbers of a text format that has both 0 to 1 and 0 to 255.
    pub(super) const EITHER: ColorRange = ColorRange {
        expected: [1.0, 255.0],
        ..ColorRange::FLOAT
    };
    /// Integers: 0 to 255 until a value says more.
    pub(super) const INTEGER: ColorRange = ColorRange {
        largest: 255.0,
        expected: [255.0; 2],
        ..ColorRange::FLOAT
    };
    /// Integers of 16 bits, likewise.
    pub(super) const WORD: ColorRange = ColorRange {
        expected: [65535.0; 2],
        ..ColorRange::INTEGER
    };
    /// Bytes.
    pub(super) const BYTE: ColorRange = ColorRange {
        is_fixed: true,
        ..ColorRange::INTEGER
    };

    fn is_expected(&self) -> bool {
        self.is_fixed || self.expected.contains(&self.largest)
    }

    /// Takes note of a value.
    #[inline]
    pub(super) fn see(&mut self, value: f64) {
        if value <= 1.0 {
            self.has_fraction |= value > 0.0 && value < 1.0;
        } else if value > self.largest {
            self.widen(value);
        }
    }

    /// Takes note of a whole set of values: the largest that is finite, and whether one below 1 is a fraction.
    pub(super) fn see_all(&mut self, largest: f64, has_fraction: bool) {
        self.has_fraction |= has_fraction;
        self.see(largest);
    }

    #[cold]
    fn widen(&mut self, value: f64) {
        if self.is_fixed || !value.is_finite() {
            return;
        }
        self.has_fraction |= value.fract() != 0.0;
        // Fractions around 1 are bright, not 1 of 255; and rounding goes over an end.
        let is_over = |largest: f64| {
            if largest > 1.0 {
                value > largest * 1.004
            } else {
                value > 2.0 || (value > 1.0 && !self.has_fraction)
            }
        };
        for range in RANGES {
            if range >= self.largest && is_over(self.largest) {
                self.largest = range;
            }
        }
    }

    /// The byte of a value in this range; values outside are clamped, NaN is 0.
    #[inline]
    pub(super) fn byte(self, value: f64) -> u8 {
        color_from_unit(value / self.largest)
    }
}

/// A color from numbers of 0 to 1; values outside are clamped, NaN is 0.
pub(super) fn color_from_unit(value: f64) -> u8 {
    // The cast saturates and takes NaN to zero.
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// Colors read one after the other.
#[derive(Debug, Clone)]
pub(super) struct ColorSink {
    pub(super) colors: Vec<[u8; 4]>,
    pub(super) ranges: [ColorRange; 3],
}

impl ColorSink {
    /// Colors of three channels of these ranges; those that are equal now widen together.
    pub(super) fn new(ranges: [ColorRange; 3]) -> Self {
        Self {
            colors: Vec::new(),
            ranges,
        }
    }

    /// Adds a color.
    #[inline]
    pub(super) fn push(&mut self, color: [f64; 3]) {
        let color = self.convert(color);
        self.colors.push(color);
    }

    /// The bytes of a color; those before are converted where it shows another range.
    #[inline]
    pub(super) fn convert(&mut self, color: [f64; 3]) -> [u8; 4] {
        let before = self.ranges;
        for (range, value) in self.ranges.iter_mut().zip(color) {
            range.see(value);
        }
        if (0..3).any(|channel| self.ranges[channel].largest != before[channel].largest) {
            self.widen(before);
        }
        let byte = |channel: usize| self.ranges[channel].byte(color[channel]);
        [byte(0), byte(1), byte(2), 255]
    }

    #[cold]
    fn widen(&mut self, before: [ColorRange; 3]) {
        unite(&mut self.ranges, before);
        for channel in 0..3 {
            let ratio = before[channel].largest / self.ranges[channel].largest;
            if ratio < 1.0 {
                for color in &mut self.colors {
                    color[channel] = (f64::from(color[channel]) * ratio).round() as u8;
                }
            }
        }
    }

    /// The remark about a range that the type does not tell.
    pub(super) fn remark(&self) -> Option<ReadWarning> {
        if self.colors.is_empty() {
            return None;
        }
        let odd = self.ranges.iter().filter(|range| !range.is_expected());
        odd.map(|range| range.largest as u32)
            .max()
            .map(|largest| ReadWarning::ColorRange { largest })
    }
}

/// Gives channels that had one range the largest of theirs.
pub(super) fn unite(ranges: &mut [ColorRange; 3], before: [ColorRange; 3]) {
    for channel in 0..3 {
        for other in 0..3 {
            if before[channel].largest == before[other].largest
                && !before[channel].is_fixed
                && !before[other].is_fixed
                && ranges[other].largest > ranges[channel].largest
            {
                ranges[channel].largest = ranges[other].largest;
            }
        }
    }
}

/// The sRGB byte of linear light, 1 is white (IEC 61966-2-1).
pub(super) fn encoded_byte(linear: f64) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    };
    (encoded * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colors(ranges: [ColorRange; 3], values: &[[f64; 3]]) -> Vec<[u8; 4]> {
        let mut sink = ColorSink::new(ranges);
        values.iter().for_each(|&color| sink.push(color));
        sink.colors
    }

    #[test]
    fn values_tell_the_range() {
        let float = [ColorRange::FLOAT; 3];
        assert_eq!(colors(float, &[[1.0, 0.5, 0.0]]), [[255, 128, 0, 255]]);
        assert_eq!(
            colors(float, &[[1.0, 0.0, 1.0], [2.0, 255.0, 0.0]]),
            [[1, 0, 1, 255], [2, 255, 0, 255]]
        );
        assert_eq!(
            colors(float, &[[200.0, 0.0, 1.0], [0.0, 65535.0, 257.0]]),
            [[1, 0, 0, 255], [0, 255, 1, 255]]
        );
        // A little over is rounding, or light.
        assert_eq!(
            colors(float, &[[0.5, 1.000_1, 1.7]]),
            [[128, 255, 255, 255]]
        );
        assert_eq!(
            colors(float, &[[0.5, f64::INFINITY, f64::NAN], [-3.0, 1.0, 0.0]]),
            [[128, 255, 0, 255], [0, 255, 0, 255]]
        );
        assert_eq!(colors(float, &[[1.0, 2.0, 0.0]]), [[1, 2, 0, 255]]);
        let integer = [ColorRange::INTEGER; 3];
        assert_eq!(colors(integer, &[[1.0, 255.0, 0.0]]), [[1, 255, 0, 255]]);
        assert_eq!(
            colors(integer, &[[65535.0, 257.0, 0.0]]),
            [[255, 1, 0, 255]]
        );
        assert_eq!(
            colors([ColorRange::BYTE; 3], &[[7.0, 300.0, 0.0]]),
            [[7, 255, 0, 255]]
        );
    }

    #[test]
    fn channels_of_several_types_have_their_own_ranges() {
        let ranges = [ColorRange::BYTE, ColorRange::INTEGER, ColorRange::FLOAT];
        assert_eq!(
            colors(ranges, &[[200.0, 32896.0, 0.5], [200.0, 32896.0, 0.5]]),
            [[200, 128, 128, 255]; 2]
        );
        let remark = |range: ColorRange, value: f64| {
            let mut sink = ColorSink::new([ColorRange::BYTE, range, range]);
            sink.push([7.0, value, value]);
            sink.remark()
        };
        let read_to = |largest| Some(ReadWarning::ColorRange { largest });
        assert_eq!(remark(ColorRange::FLOAT, 0.5), None);
        assert_eq!(remark(ColorRange::FLOAT, 90.0), read_to(255));
        assert_eq!(remark(ColorRange::EITHER, 90.0), None);
        assert_eq!(remark(ColorRange::EITHER, 900.0), read_to(65535));
        assert_eq!(remark(ColorRange::INTEGER, 90.0), None);
        assert_eq!(remark(ColorRange::INTEGER, 900.0), read_to(65535));
        assert_eq!(remark(ColorRange::WORD, 900.0), None);
        assert_eq!(remark(ColorRange::WORD, 90.0), read_to(255));
        assert_eq!(ColorSink::new([ColorRange::WORD; 3]).remark(), None);
    }

    #[test]
    fn a_set_of_values_says_the_same_as_one_by_one() {
        for values in [
            &[0.1, 0.9][..],
            &[3.0, 0.5],
            &[2.0, 1.0],
            &[1.5, 0.2],
            &[900.0],
        ] {
            let mut one_by_one = ColorRange::FLOAT;
            values.iter().for_each(|&value| one_by_one.see(value));
            let mut whole = ColorRange::FLOAT;
            whole.see_all(
                values.iter().copied().fold(0.0, f64::max),
                values.iter().any(|&value| value > 0.0 && value < 1.0),
            );
            assert_eq!(whole.largest, one_by_one.largest, "{values:?}");
        }
    }

    #[test]
    fn unit_colors_clamp_and_round() {
        let cases = [
            (0.0, 0),
            (1.0, 255),
            (0.5, 128),
            (-3.0, 0),
            (7.0, 255),
            (f64::NAN, 0),
            (f64::INFINITY, 255),
        ];
        assert_eq!(
            cases.map(|(value, _)| color_from_unit(value)),
            cases.map(|(_, byte)| byte)
        );
    }
}
