//! Marks over a picture: a bar that tells how long things are, and the axes of the world.
//!
//! They are lines and texts in pixels, so that a window can show the same with means of its own.

use super::sheet::draw_text;
use super::{FloatImage, Image};
use crate::math::camera::View;
use embedded_graphics::pixelcolor::Rgb888;
use glam::{DVec3, Vec3};

/// Part of the picture's width that the bar has at most.
const LONGEST_BAR: f64 = 0.25;
/// From the marks to the edges of the picture, and the length of an axis that lies in the picture; pixels.
const MARGIN_PX: f32 = 16.0;
const AXIS_PX: f32 = 36.0;
/// Height and width of a character, pixels.
pub(super) const CHARACTER_PX: [f32; 2] = [9.0, 15.0];
/// Shorter side of a picture whose marks have these sizes; larger ones have larger marks.
const USUAL_SIDE_PX: u32 = 600;

/// Colors of the axes x, y and z.
pub const AXIS_COLORS: [[u8; 3]; 3] = [[240, 90, 80], [110, 200, 90], [100, 150, 255]];
const BAR_COLOR: [u8; 3] = [245, 245, 245];
const OUTLINE_COLOR: [u8; 3] = [20, 20, 20];

/// Which marks there are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct MarkChoice {
    /// The bar.
    pub scale_bar: bool,
    /// The axes.
    pub axes: bool,
}

/// A straight line of a mark.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkLine {
    /// Ends of the line, pixels from the upper left corner.
    pub ends: [[f32; 2]; 2],
    /// Red, green and blue.
    pub color: [u8; 3],
}

/// A word of a mark.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkText {
    /// Middle of the text, pixels from the upper left corner.
    pub middle: [f32; 2],
    /// What it says.
    pub text: String,
    /// Red, green and blue.
    pub color: [u8; 3],
}

/// Marks of a picture, the farthest first.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PictureMarks {
    /// Lines.
    pub lines: Vec<MarkLine>,
    /// Texts.
    pub texts: Vec<MarkText>,
    /// How many times larger they are than in a small picture.
    pub size: u32,
}

/// The length of a bar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BarLength {
    /// Units of the model: 1, 2 or 5 times a power of ten.
    pub units: f64,
    /// Pixels.
    pub px: f64,
}

impl BarLength {
    /// The longest round length of at most a quarter of the picture's width, at the distance of a point of model space; `None`
    /// where the view does not see that distance, or the length is no number.
    pub fn new(view: &View, at: Vec3) -> Option<Self> {
        let scale = f64::from(view.scale[0].abs()) * f64::from(view.width) / 2.0;
        let distance = -f64::from(view.view_from_model.transform_point3(at).z);
        let px_of_unit = f64::from(view.model_scale)
            * match view.is_perspective {
                true => scale / distance,
                false => scale,
            };
        let longest = LONGEST_BAR * f64::from(view.width) / px_of_unit;
        if !(longest.is_normal() && longest > 0.0 && px_of_unit > 0.0) {
            return None;
        }
        let power = 10f64.powf(longest.log10().floor());
        let first = [5.0, 2.0, 1.0, 0.5].into_iter();
        // Rounded logarithms may be one too high.
        let units = first.map(|n| n * power).find(|&units| units <= longest)?;
        Some(Self {
            units,
            px: units * px_of_unit,
        })
    }

    /// The length in words, with the unit of the model where that is known.
    pub fn words(&self, unit: Option<&str>) -> String {
        let number = match self.units {
            units if (1e-4..1e6).contains(&units) => {
                let decimals = (-units.log10().floor()).max(0.0) as usize;
                format!("{units:.decimals$}")
            }
            units => format!("{units:.0e}"),
        };
        match unit {
            Some(unit) => format!("{number} {unit}"),
            None => number,
        }
    }
}

impl PictureMarks {
    /// Marks of a view. The bar has its length where a point of the world, relative to model space, lies.
    pub fn new(view: &View, choice: MarkChoice, center: Vec3, unit: Option<&str>) -> Self {
        let size = Self::size_of(view.width, view.height);
        let mut marks = Self {
            size,
            ..Self::default()
        };
        if choice.scale_bar
            && let Some(bar) = BarLength::new(view, center)
        {
            marks.add_bar(view, &bar, &bar.words(unit));
        }
        if choice.axes {
            marks.add_axes(view);
        }
        marks
    }

    /// Finds how many times larger marks of a picture are than those of a small one.
    pub(super) fn size_of(width: u32, height: u32) -> u32 {
        (width.min(height) / USUAL_SIDE_PX).max(1)
    }

    fn add_bar(&mut self, view: &View, bar: &BarLength, words: &str) {
        let size = self.size as f32;
        let right = view.width as f32 - MARGIN_PX * size;
        let left = right - bar.px as f32;
        let y = view.height as f32 - MARGIN_PX * size;
        let tick = 4.0 * size;
        for ends in [
            [[left, y], [right, y]],
            [[left, y - tick], [left, y + tick]],
            [[right, y - tick], [right, y + tick]],
        ] {
            let color = BAR_COLOR;
            self.lines.push(MarkLine { ends, color });
        }
        let half = 0.5 * CHARACTER_PX[0] * size * words.chars().count() as f32;
        self.texts.push(MarkText {
            // Within the picture, however short the bar is.
            middle: [
                (0.5 * (left + right)).min(view.width as f32 - half - 2.0),
                y - size * (0.5 * CHARACTER_PX[1] + 5.0),
            ],
            text: words.to_owned(),
            color: BAR_COLOR,
        });
    }

    fn add_axes(&mut self, view: &View) {
        let size = self.size as f32;
        let reach = MARGIN_PX + AXIS_PX;
        let origin = [reach * size, view.height as f32 - reach * size];
        let mirrored = view.scale.map(f32::signum);
        let mut axes: Vec<(Vec3, usize)> = [DVec3::X, DVec3::Y, DVec3::Z]
            .iter()
            .zip(0..)
            .map(|(axis, index)| {
                let turned = view.view_from_model.transform_vector3(axis.as_vec3());
                (turned / view.model_scale, index)
            })
            .collect();
        axes.sort_by(|(a, _), (b, _)| a.z.total_cmp(&b.z));
        for (axis, index) in axes {
            let to = [axis.x * mirrored[0], -axis.y * mirrored[1]];
            let at = |length: f32| [0, 1].map(|i| origin[i] + length * size * to[i]);
            let color = AXIS_COLORS[index];
            self.lines.push(MarkLine {
                ends: [origin, at(AXIS_PX)],
                color,
            });
            self.texts.push(MarkText {
                middle: at(AXIS_PX + 9.0),
                text: ["x", "y", "z"][index].to_owned(),
                color,
            });
        }
    }

    /// Draws them over a picture, with dark outlines; marks are opaque.
    pub fn draw_over(&self, image: &mut FloatImage) {
        if self.lines.is_empty() && self.texts.is_empty() {
            return;
        }
        let over = self.drawn(image.width, image.height);
        for (color, mark) in image.color.iter_mut().zip(&over.color) {
            if mark[3] > 0 {
                *color = mark.map(|byte| f32::from(byte) / 255.0);
            }
        }
    }

    /// The same over a picture of bytes.
    pub fn draw_over_bytes(&self, image: &mut Image) {
        if self.lines.is_empty() && self.texts.is_empty() {
            return;
        }
        let over = self.drawn(image.width, image.height);
        for (color, mark) in image.color.iter_mut().zip(&over.color) {
            if mark[3] > 0 {
                *color = *mark;
            }
        }
    }

    /// A picture of this size of nothing but them.
    fn drawn(&self, width: u32, height: u32) -> Image {
        // In pixels of their own, each of which is a square of the picture's.
        let size = self.size.max(1);
        let mut small = Image::filled(width.div_ceil(size), height.div_ceil(size), [0; 4]);
        let own = |at: [f32; 2]| at.map(|v| v / size as f32);
        for is_outline in [true, false] {
            for line in &self.lines {
                let (radius, color) = match is_outline {
                    true => (2.2, OUTLINE_COLOR),
                    false => (0.9, line.color),
                };
                draw_line(&mut small, line.ends.map(own), radius, color);
            }
        }
        for text in &self.texts {
            let [x, y] = own(text.middle);
            let width = CHARACTER_PX[0] * text.text.chars().count() as f32;
            let left = (x - 0.5 * width).round() as i32;
            let top = (y - 0.5 * CHARACTER_PX[1]).round() as i32;
            let rgb = |[r, g, b]: [u8; 3]| Rgb888::new(r, g, b);
            for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
                let at = [left + dx, top + dy];
                draw_text(&mut small, &text.text, at, rgb(OUTLINE_COLOR));
            }
            draw_text(&mut small, &text.text, [left, top], rgb(text.color));
        }
        if size == 1 {
            return small;
        }
        let mut large = Image::filled(width, height, [0; 4]);
        for (at, color) in large.color.iter_mut().enumerate() {
            let (x, y) = (at as u32 % width / size, at as u32 / width / size);
            *color = small.color[(y * small.width + x) as usize];
        }
        large
    }
}

/// Colors the pixels whose centers are within a distance of a line.
fn draw_line(image: &mut Image, [from, to]: [[f32; 2]; 2], radius: f32, [r, g, b]: [u8; 3]) {
    let range = |axis: usize, side: u32| {
        let (low, high) = (from[axis].min(to[axis]), from[axis].max(to[axis]));
        let low = (low - radius - 1.0).clamp(0.0, side as f32) as u32;
        low..(high + radius + 1.0).clamp(0.0, side as f32) as u32
    };
    let along = [to[0] - from[0], to[1] - from[1]];
    let squared = along[0] * along[0] + along[1] * along[1];
    for y in range(1, image.height) {
        for x in range(0, image.width) {
            let at = [x as f32 + 0.5 - from[0], y as f32 + 0.5 - from[1]];
            let part = match squared > 0.0 {
                true => ((at[0] * along[0] + at[1] * along[1]) / squared).clamp(0.0, 1.0),
                false => 0.0,
            };
            let off = (at[0] - part * along[0]).hypot(at[1] - part * along[1]);
            if off <= radius {
                image.color[(y * image.width + x) as usize] = [r, g, b, 255];
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::math::camera::Camera;

    fn view(size: (u32, u32), radius: f64, fill: f64) -> View {
        let camera = Camera::orbit(size, DVec3::ZERO, radius, 0.0, 0.0, fill);
        camera.view(DVec3::ZERO).unwrap()
    }

    #[test]
    fn bars_are_round_and_as_long_as_they_say() {
        for exponent in -40..40 {
            let radius = 10f64.powf(0.21 * f64::from(exponent));
            let view = view((640, 480), radius, 1.0);
            let bar = BarLength::new(&view, Vec3::ZERO).unwrap();
            let mantissa = bar.units / 10f64.powf((bar.units * 1.000_001).log10().floor());
            let is_round = [1.0, 2.0, 5.0].iter().any(|n| (mantissa - n).abs() < 1e-6);
            assert!(is_round, "{}", bar.units);
            // The next longer would be 2 or 2.5 times as long.
            assert!(bar.px <= 160.001 && bar.px > 160.0 / 2.51, "{bar:?}");
            // Two points that far apart, at that distance, lie that many pixels apart.
            let clip = view.clip_from_view() * view.view_from_model;
            let right = view.view_from_model.inverse().transform_vector3(Vec3::X);
            let at = |p: Vec3| 320.0 * f64::from(clip.project_point3(p).x);
            let apart = at(right * bar.units as f32) - at(Vec3::ZERO);
            assert!((apart - bar.px).abs() < 1e-3 * bar.px, "{apart}, {bar:?}");
        }
    }

    #[test]
    fn lengths_are_written_as_people_write_them() {
        let words = |units, unit| BarLength { units, px: 1.0 }.words(unit);
        assert_eq!(words(0.02, None), "0.02");
        assert_eq!(words(500.0, Some("m")), "500 m");
        assert_eq!(words(1.0, Some("m")), "1 m");
        assert_eq!(words(2e7, None), "2e7");
        assert_eq!(words(5e-6, None), "5e-6");
    }

    #[test]
    fn axes_point_where_the_world_does_and_marks_cover_what_they_say() {
        let view = view((200, 200), 1.0, 1.0);
        let all = MarkChoice {
            scale_bar: true,
            axes: true,
        };
        let marks = PictureMarks::new(&view, all, Vec3::ZERO, None);
        let axis = |name: &str| {
            let text = marks.texts.iter().find(|t| t.text == name).unwrap();
            [text.middle[0] - 52.0, text.middle[1] - 148.0]
        };
        // From azimuth 0 and elevation 0 one axis points to the viewer, one to the right, one up.
        let long = |v: [f32; 2]| v[0].hypot(v[1]);
        let mut lengths = ["x", "y", "z"].map(|name| long(axis(name)));
        lengths.sort_by(f32::total_cmp);
        assert!(
            lengths[0] < 1e-3 && (lengths[1] - 45.0).abs() < 1e-3,
            "{lengths:?}"
        );
        let mut image = Image::filled(200, 200, [10, 20, 30, 0]).to_float();
        marks.draw_over(&mut image);
        let bar = BarLength::new(&view, Vec3::ZERO).unwrap();
        let row = &image.color[184 * 200..185 * 200];
        let white = |c: &&[f32; 4]| c[0] > 0.9 && c[1] > 0.9 && c[3] == 1.0;
        let count = row.iter().filter(white).count() as f64;
        assert!((count - bar.px).abs() <= 2.0, "{count}, {bar:?}");
        assert_eq!(
            image.color[0],
            [10.0 / 255.0, 20.0 / 255.0, 30.0 / 255.0, 0.0]
        );
        let none = PictureMarks::new(&view, MarkChoice::default(), Vec3::ZERO, None);
        assert!(none.lines.is_empty() && none.texts.is_empty());
    }
}
