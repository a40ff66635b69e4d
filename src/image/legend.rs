//! The legend of colors over a picture, at its upper left: a bar with values, or a list of categories.

use super::marks::{CHARACTER_PX, MarkLine, MarkText, PictureMarks};
use crate::mesh::color_legend::{ColorLegend, LegendEntries};

/// Place of the legend, pixels of a small picture.
const LEFT_PX: f32 = 16.0;
const TOP_PX: f32 = 18.0;
/// Height of a bar and of a row, width of bars and patches of color.
const BAR_PX: usize = 120;
const ROW_PX: f32 = 18.0;
const WIDE_PX: f32 = 14.0;
/// Rows of a patch of color.
const PATCH_ROWS: usize = 10;
const TEXT_COLOR: [u8; 3] = [245, 245, 245];

impl PictureMarks {
    /// Adds a legend, `inset` pixels from the left edge.
    pub fn add_legend(&mut self, legend: &ColorLegend, inset: f32) {
        let left = inset + LEFT_PX * self.size as f32;
        let top = TOP_PX * self.size as f32;
        self.add_words(left, top, &legend.title);
        match &legend.entries {
            LegendEntries::Scale { colors, values, .. } => {
                let first = top + 0.8 * self.px(ROW_PX);
                let last = BAR_PX - 1;
                for row in 0..BAR_PX {
                    // The lowest value is at the bottom.
                    let at = (last - row) * colors.len().saturating_sub(1) / last;
                    if let Some(&color) = colors.get(at) {
                        self.add_row(left, first + self.px(row as f32), color);
                    }
                }
                for (value, share) in values.iter().zip([1.0, 0.5, 0.0]) {
                    let y = first + self.px(share * last as f32);
                    self.add_words(left + self.px(WIDE_PX + 8.0), y, value);
                }
            }
            LegendEntries::List(entries) => {
                for (index, (color, name)) in entries.iter().enumerate() {
                    let y = top + self.px(ROW_PX * (index + 1) as f32);
                    for row in 0..PATCH_ROWS {
                        let up = row as f32 - 0.5 * (PATCH_ROWS - 1) as f32;
                        self.add_row(left, y + self.px(up), *color);
                    }
                    self.add_words(left + self.px(WIDE_PX + 8.0), y, name);
                }
            }
        }
    }

    /// Pixels of a small picture as pixels of this one.
    fn px(&self, small: f32) -> f32 {
        small * self.size.max(1) as f32
    }

    fn add_row(&mut self, left: f32, y: f32, color: [u8; 3]) {
        let ends = [[left, y], [left + self.px(WIDE_PX), y]];
        self.lines.push(MarkLine { ends, color });
    }

    /// Adds words that begin at a place.
    fn add_words(&mut self, left: f32, y: f32, words: &str) {
        let half = 0.5 * self.px(CHARACTER_PX[0]) * words.chars().count() as f32;
        self.texts.push(MarkText {
            middle: [left + half, y],
            text: words.to_owned(),
            color: TEXT_COLOR,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;

    fn drawn(legend: &ColorLegend, size: u32) -> Image {
        let mut marks = PictureMarks {
            size,
            ..PictureMarks::default()
        };
        marks.add_legend(legend, 0.0);
        let mut image = Image::filled(300 * size, 200 * size, [0, 0, 0, 255]);
        marks.draw_over_bytes(&mut image);
        image
    }

    fn color_at(image: &Image, [x, y]: [u32; 2]) -> [u8; 3] {
        let [r, g, b, _] = image.color[(y * image.width + x) as usize];
        [r, g, b]
    }

    #[test]
    fn a_bar_goes_from_the_lowest_color_up_to_the_highest() {
        let legend = ColorLegend {
            title: "height".to_owned(),
            entries: LegendEntries::Scale {
                colors: (0..=255).map(|i| [i, 0, 255 - i]).collect(),
                values: ["1", "2", "3"].map(str::to_owned),
                range: [1.0, 3.0],
            },
        };
        for size in [1, 2] {
            let image = drawn(&legend, size);
            let top = 32;
            let red = |row: u32| color_at(&image, [22 * size, (top + row) * size])[0];
            assert!(red(2) > 240 && red(117) < 15, "{} {}", red(2), red(117));
            assert!(red(60).abs_diff(128) < 6, "{}", red(60));
        }
    }

    #[test]
    fn categories_have_patches_of_their_colors() {
        let entries = [([10, 200, 30], "2 ground"), ([200, 20, 30], "6 building")];
        let legend = ColorLegend {
            title: "class".to_owned(),
            entries: LegendEntries::List(entries.map(|(c, n)| (c, n.to_owned())).to_vec()),
        };
        let image = drawn(&legend, 1);
        assert_eq!(color_at(&image, [22, 36]), [10, 200, 30]);
        assert_eq!(color_at(&image, [22, 54]), [200, 20, 30]);
    }
}
