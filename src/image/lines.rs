//! Lines over finished pictures, with smooth edges: measures and other marks.

use super::{FloatImage, Image, unorm8};
use crate::math::camera::View;
use crate::math::measured_line::MeasuredLine;
use glam::DVec3;

/// Measures in pictures: the line, its rim, and how wide half of it and the rim are, pixels. Places are discs.
const LINE_COLOR: [f32; 3] = [1.0, 0.85, 0.1];
const RIM_COLOR: [f32; 3] = [0.0, 0.0, 0.0];
const HALF_WIDTH: f32 = 1.0;
const DISC_RADIUS: f32 = 3.5;
const RIM: f32 = 1.0;

/// Lines and places of measures in a picture, pixels.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MarkedLines {
    /// Ends of each line.
    pub lines: Vec<[[f32; 2]; 2]>,
    /// The places.
    pub places: Vec<[f32; 2]>,
}

impl MarkedLines {
    /// What a view of a model, whose zero lies at `origin` in world space, shows of measures. Nothing is hidden by what
    /// stands before it.
    pub fn of(measures: &[MeasuredLine], view: &View, origin: DVec3) -> Self {
        let own = |place: DVec3| (place - origin).as_vec3();
        let parts = measures.iter().flat_map(MeasuredLine::parts);
        let places = measures.iter().flat_map(|line| &line.points);
        let seen = places.filter_map(|&place| {
            let place = own(DVec3::from_array(place));
            Some(view.visible_line([place, place])?[0])
        });
        Self {
            lines: parts
                .filter_map(|ends| view.visible_line(ends.map(own)))
                .collect(),
            places: seen.collect(),
        }
    }

    /// Calls `blend` with pixel, color and share of it, of the rims first.
    fn each_pixel(&self, size: [u32; 2], mut blend: impl FnMut(usize, [f32; 3], f32)) {
        for (color, more) in [(RIM_COLOR, RIM), (LINE_COLOR, 0.0)] {
            for &ends in &self.lines {
                stroke(size, ends, HALF_WIDTH + more, |at, part| {
                    blend(at, color, part)
                });
            }
            for &place in &self.places {
                let ends = [place, place];
                stroke(size, ends, DISC_RADIUS + more, |at, part| {
                    blend(at, color, part)
                });
            }
        }
    }
}

/// Calls `visit` with each pixel within `reach` pixels of a line, and how much of it that covers: falling from 1 to 0 over a
/// pixel at the edge. O(rows + pixels).
fn stroke(
    [width, height]: [u32; 2],
    [a, b]: [[f32; 2]; 2],
    reach: f32,
    mut visit: impl FnMut(usize, f32),
) {
    let edge = reach + 0.5;
    // The casts saturate: what is far outside has no rows.
    let first = (a[1].min(b[1]) - edge).floor().max(0.0) as u32;
    let last = ((a[1].max(b[1]) + edge).ceil().max(0.0) as u32).min(height);
    let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    let square = dx * dx + dy * dy;
    for row in first..last {
        let y = row as f32 + 0.5;
        // The part of the line within reach of this row.
        let along = |y: f32| {
            let share = if dy == 0.0 { 0.5 } else { (y - a[1]) / dy };
            share.clamp(0.0, 1.0)
        };
        let (from, to) = match dy {
            0.0 => (0.0, 1.0),
            _ => (along(y - edge), along(y + edge)),
        };
        let [x0, x1] = [a[0] + from * dx, a[0] + to * dx];
        let left = (x0.min(x1) - edge).floor().max(0.0) as u32;
        let right = ((x0.max(x1) + edge).ceil().max(0.0) as u32).min(width);
        for column in left..right {
            let [px, py] = [column as f32 + 0.5 - a[0], y - a[1]];
            let share = if square > 0.0 {
                ((px * dx + py * dy) / square).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let distance = (px - share * dx).hypot(py - share * dy);
            let part = (edge - distance).clamp(0.0, 1.0);
            if part > 0.0 {
                visit(row as usize * width as usize + column as usize, part);
            }
        }
    }
}

impl Image {
    /// Draws lines over the picture; they cover what they touch. Depth and normals stay.
    pub fn mark(&mut self, marks: &MarkedLines) {
        let (color, values) = (&mut self.color, &mut self.values);
        marks.each_pixel([self.width, self.height], |at, wanted, part| {
            let mixed = |old: f32, new: f32| old + (new - old) * part;
            let [r, g, b] = wanted;
            let byte = |old: u8, new: f32| unorm8(f64::from(mixed(f32::from(old) / 255.0, new)));
            let [red, green, blue, alpha] = color[at];
            color[at] = [
                byte(red, r),
                byte(green, g),
                byte(blue, b),
                byte(alpha, 1.0),
            ];
            if let Some(value) = values.get_mut(at) {
                let [red, green, blue, alpha] = *value;
                *value = [
                    mixed(red, r),
                    mixed(green, g),
                    mixed(blue, b),
                    mixed(alpha, 1.0),
                ];
            }
        });
    }
}

impl FloatImage {
    /// As [`Image::mark`].
    pub fn mark(&mut self, marks: &MarkedLines) {
        let color = &mut self.color;
        marks.each_pixel([self.width, self.height], |at, [r, g, b], part| {
            for (old, new) in color[at].iter_mut().zip([r, g, b, 1.0]) {
                *old += (new - *old) * part;
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Covered area of a stroke on a picture of 100 by 100.
    fn area(ends: [[f32; 2]; 2], reach: f32) -> f32 {
        let mut sum = 0.0;
        stroke([100, 100], ends, reach, |_, part| sum += part);
        sum
    }

    #[test]
    fn strokes_cover_the_area_of_a_capsule() {
        let capsule =
            |length: f32, reach: f32| 2.0 * reach * length + std::f32::consts::PI * reach * reach;
        for ends in [
            [[20.0, 30.0], [80.0, 30.0]],
            [[30.5, 10.0], [30.5, 70.0]],
            [[20.0, 20.0], [68.0, 56.0]],
            [[68.0, 20.0], [20.0, 56.0]],
        ] {
            for reach in [1.0, 3.5] {
                // The edge is a ramp, not the exact share of a pixel: a hundredth of the area.
                let (found, wanted) = (area(ends, reach), capsule(60.0, reach));
                assert!(
                    (found / wanted - 1.0).abs() < 0.02,
                    "{ends:?}: {found} {wanted}"
                );
            }
        }
        // A point is a disc; half of one on the border is half of one; what lies outside is nothing.
        assert!((area([[50.0; 2]; 2], 3.5) / capsule(0.0, 3.5) - 1.0).abs() < 0.03);
        assert!((area([[0.0, 50.0]; 2], 3.5) / capsule(0.0, 3.5) - 0.5).abs() < 0.02);
        assert_eq!(area([[-9e9, 4.0], [-5e9, 1e30]], 2.0), 0.0);
        // Of an endless line what lies inside.
        let found = area([[-1e6, 50.0], [1e6, 50.0]], 1.0);
        assert!((found - 200.0).abs() < 2.0, "{found}");
    }

    #[test]
    fn marks_have_their_color_and_a_rim_and_leave_the_rest() {
        let marks = MarkedLines {
            lines: vec![[[10.0, 20.5], [30.0, 20.5]]],
            places: vec![[10.5, 20.5]],
        };
        let mut image = Image::filled(40, 40, [9, 9, 9, 0]);
        image.depth = vec![3.0; 1600];
        image.mark(&marks);
        let pixel = |x: usize, y: usize| image.color[y * 40 + x];
        assert_eq!(pixel(20, 20), [255, 217, 26, 255]);
        // The rim ends in the middle of this one.
        assert_eq!(pixel(20, 22), [5, 5, 5, 128]);
        assert_eq!(pixel(20, 24), [9, 9, 9, 0]);
        assert_eq!(
            (pixel(10, 17), pixel(10, 23)),
            (pixel(20, 20), pixel(20, 20))
        );
        assert!(image.depth.iter().all(|&depth| depth == 3.0));
        let mut floats = Image::filled(40, 40, [9, 9, 9, 0]).to_float();
        floats.mark(&marks);
        let floats = floats.to_image();
        let differences = floats.color.iter().zip(&image.color);
        assert!(
            differences
                .flat_map(|(a, b)| a.iter().zip(b))
                .all(|(a, b)| a.abs_diff(*b) <= 1)
        );
    }
}
