//! Rulers along a picture of a section: distances below it, heights to its left.

use super::marks::{MarkLine, MarkText, PictureMarks};
use crate::math::section_line::{SectionFrame, SectionLine, SectionMargins};

/// Least distance of two ticks, pixels of a small picture.
const TICK_PX: f64 = 70.0;
/// Most ticks of a ruler, whatever the numbers are.
const MOST_TICKS: usize = 1000;
const COLOR: [u8; 3] = [245, 245, 245];

/// Margins that hold the rulers of a picture of this size, and how many times larger they are than in a small one.
pub fn ruler_margins(size: [u32; 2]) -> (SectionMargins, u32) {
    let factor = PictureMarks::size_of(size[0], size[1]);
    let margins = SectionMargins {
        left: 72 * factor,
        right: 20 * factor,
        top: 20 * factor,
        bottom: 36 * factor,
    };
    (margins, factor)
}

/// The least of 1, 2 and 5 times a power of ten that is at least `units`, and the digits behind its point.
fn round_step(units: f64) -> Option<(f64, usize)> {
    if !(units.is_normal() && units > 0.0) {
        return None;
    }
    let power = units.log10().floor();
    let base = 10f64.powf(power);
    let steps = [1.0, 2.0, 5.0, 10.0].into_iter();
    let step = steps.map(|n| n * base).find(|&step| step >= units)?;
    // The cast saturates.
    Some((step, (-step.log10() - 1e-9).ceil().max(0.0) as usize))
}

impl PictureMarks {
    /// Rulers of a section.
    pub fn of_section(line: &SectionLine, frame: &SectionFrame) -> Self {
        let (_, size) = ruler_margins(frame.size);
        let mut marks = Self {
            size,
            ..Self::default()
        };
        let large = f64::from(size);
        let unit = line.units_of_pixel(frame);
        let [low, high] = frame.heights;
        let [left, bottom] = line.pixel_of(frame, 0.0, low).map(f64::from);
        let [right, top] = line.pixel_of(frame, line.length(), high).map(f64::from);
        // A little beside the section, so that it stays in sight.
        let (left, bottom) = (left - 4.0 * large, bottom + 4.0 * large);
        marks.add_line([left, bottom], [right, bottom]);
        marks.add_line([left, bottom], [left, top]);
        let tick = 5.0 * large;
        for (distance, text) in ticks([0.0, line.length()], TICK_PX * large * unit) {
            let x = f64::from(line.pixel_of(frame, distance, low)[0]);
            marks.add_line([x, bottom], [x, bottom + tick]);
            marks.add_text([x, bottom + tick + 11.0 * large], text);
        }
        for (height, text) in ticks(
            [low, high],
            0.5 * TICK_PX * large * unit / frame.exaggeration,
        ) {
            let y = f64::from(line.pixel_of(frame, 0.0, height)[1]);
            marks.add_line([left - tick, y], [left, y]);
            let half = 4.5 * large * text.len() as f64;
            marks.add_text([left - tick - 4.0 * large - half, y], text);
        }
        marks
    }

    fn add_line(&mut self, from: [f64; 2], to: [f64; 2]) {
        let ends = [from, to].map(|end| end.map(|v| v as f32));
        let color = COLOR;
        self.lines.push(MarkLine { ends, color });
    }

    fn add_text(&mut self, middle: [f64; 2], text: String) {
        self.texts.push(MarkText {
            middle: middle.map(|v| v as f32),
            text,
            color: COLOR,
        });
    }
}

/// Round values in a range, at least so far apart, with their texts.
fn ticks([low, high]: [f64; 2], apart: f64) -> Vec<(f64, String)> {
    let Some((step, digits)) = round_step(apart) else {
        return Vec::new();
    };
    let first = (low / step - 1e-9).ceil();
    (0..MOST_TICKS)
        .map(|index| (first + index as f64) * step)
        .take_while(|&value| value <= high + 1e-9 * step)
        // Adding zero makes a zero of a negative one.
        .map(|value| (value, format!("{:.digits$}", value + 0.0)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::up_axis::UpAxis;
    use glam::DVec3;

    #[test]
    fn ticks_are_round_and_not_too_near() {
        let texts = |range, apart| {
            let ticks = ticks(range, apart);
            ticks.into_iter().map(|tick| tick.1).collect::<Vec<_>>()
        };
        assert_eq!(texts([0.0, 10.0], 3.0), ["0", "5", "10"]);
        assert_eq!(texts([-0.05, 0.1], 0.03), ["-0.05", "0.00", "0.05", "0.10"]);
        assert_eq!(
            texts([1999.0, 2400.0], 100.0),
            ["2000", "2100", "2200", "2300", "2400"]
        );
        assert!(texts([0.0, 1.0], 0.0).is_empty() && texts([0.0, 1.0], f64::NAN).is_empty());
    }

    /// A tick stands at the pixel where the camera shows what it names.
    #[test]
    fn rulers_stand_where_the_section_is() {
        let size = [700, 300];
        let (margins, _) = ruler_margins(size);
        let line = SectionLine::new([DVec3::ZERO, DVec3::X * 100.0], 1.0, UpAxis::Z).unwrap();
        let frame = SectionFrame {
            size,
            margins,
            heights: [5.0, 25.0],
            exaggeration: 1.0,
        };
        let marks = PictureMarks::of_section(&line, &frame);
        let middle = |name: &str| {
            let text = marks.texts.iter().find(|text| text.text == name);
            text.unwrap().middle
        };
        let view = line.camera(&frame, 0.0).view(DVec3::ZERO).unwrap();
        let seen = |x: f32, z: f32| view.project(glam::Vec3::new(x, 0.0, z));
        assert!((middle("60")[0] - seen(60.0, 5.0).0).abs() < 0.01);
        assert!((middle("20")[1] - seen(0.0, 20.0).1).abs() < 0.01 || middle("20")[1] > 250.0);
        let heights = marks.texts.iter().filter(|text| text.middle[0] < 60.0);
        let heights: Vec<&str> = heights.map(|text| text.text.as_str()).collect();
        assert_eq!(heights, ["10", "20"]);
    }
}
