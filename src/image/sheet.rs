//! Contact sheets: labeled pictures in a grid.

use super::Image;
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle, iso_8859_1::FONT_9X15};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::text::{Baseline, Text};

const FONT: &MonoFont = &FONT_9X15;
const SHEET_COLOR: Rgb888 = Rgb888::new(22, 24, 29);
const FRAME_COLOR: Rgb888 = Rgb888::new(58, 63, 74);
const LABEL_COLOR: Rgb888 = Rgb888::new(214, 219, 227);
/// Around the sheet and between cells, pixels.
const GAP: u32 = 16;
/// Between a picture and its label.
const LABEL_GAP: u32 = 7;
/// Sheets are kept below this by shrinking the pictures, where that is possible.
const LARGEST_SIDE: u32 = 4096;
/// Cells are at least this wide, so that small pictures have room for their labels.
const LEAST_CELL_WIDTH: u32 = 12 * 9;

/// Lays pictures out in rows of `columns` (0 counts as 1), each above its label, centered in cells of equal
/// size on a dark ground. All are shrunk by the same whole factor (box filter) when the sheet would pass 4096
/// pixels. A label that is too long ends in an ellipsis; characters beyond Latin-1 show as "?". Fully covered.
/// No pictures give an empty sheet of the margins alone.
pub fn contact_sheet(pictures: &[(String, Image)], columns: usize) -> Image {
    let columns = columns.clamp(1, pictures.len().max(1)) as u32;
    let rows = (pictures.len() as u32).div_ceil(columns);
    let widest = pictures.iter().map(|(_, p)| p.width).max().unwrap_or(0);
    let tallest = pictures.iter().map(|(_, p)| p.height).max().unwrap_or(0);
    let label_height = LABEL_GAP + FONT.character_size.height;
    let side = |cells: u32, cell: u32| GAP + cells * (cell + GAP);
    let cell = |factor: u32| {
        (
            widest.div_ceil(factor).max(LEAST_CELL_WIDTH),
            tallest.div_ceil(factor) + label_height,
        )
    };
    let fits = |factor: u32| {
        let (width, height) = cell(factor);
        side(columns, width) <= LARGEST_SIDE && side(rows, height) <= LARGEST_SIDE
    };
    // A sheet of very many pictures may not fit at any size; then they stay recognizable instead.
    let factor = (1..=16).find(|&f| fits(f)).unwrap_or(4);
    let (cell_width, cell_height) = cell(factor);
    let mut sheet = Image::filled(
        side(columns, cell_width),
        side(rows, cell_height),
        opaque(SHEET_COLOR),
    );
    for (i, (label, picture)) in (0u32..).zip(pictures) {
        let left = GAP + i % columns * (cell_width + GAP);
        let top = GAP + i / columns * (cell_height + GAP);
        let small = picture.downscaled(factor);
        let inset = (cell_width - small.width) / 2;
        let bottom = top + cell_height - label_height;
        paste(&mut sheet, &small, left + inset, bottom - small.height);
        let shown = shortened(label, (cell_width / FONT.character_size.width) as usize);
        let label_width = shown.chars().count() as u32 * FONT.character_size.width;
        let at = Point::new(
            (left + (cell_width - label_width.min(cell_width)) / 2) as i32,
            (bottom + LABEL_GAP) as i32,
        );
        let style = MonoTextStyle::new(FONT, LABEL_COLOR);
        // Drawing into memory has no error to give (`TextCanvas::Error` has no values).
        let Ok(_) =
            Text::with_baseline(&shown, at, style, Baseline::Top).draw(&mut TextCanvas(&mut sheet));
    }
    sheet
}

/// Writes Latin-1 text over a picture, from its upper left corner; what falls outside is left out.
pub(super) fn draw_text(image: &mut Image, text: &str, [x, y]: [i32; 2], color: Rgb888) {
    let style = MonoTextStyle::new(FONT, color);
    let at = Point::new(x, y);
    // Drawing into memory has no error to give (`TextCanvas::Error` has no values).
    let Ok(_) = Text::with_baseline(text, at, style, Baseline::Top).draw(&mut TextCanvas(image));
}

fn opaque(color: Rgb888) -> [u8; 4] {
    [color.r(), color.g(), color.b(), 255]
}

/// The label in at most `room` characters of one line.
fn shortened(label: &str, room: usize) -> String {
    let line: String = label
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    if line.chars().count() <= room {
        return line;
    }
    let kept: String = line.chars().take(room.saturating_sub(3)).collect();
    kept.trim_end().to_owned() + "..."
}

/// Puts a picture on the sheet, opaque, with a frame of one pixel around it.
fn paste(sheet: &mut Image, picture: &Image, left: u32, top: u32) {
    let sheet_width = sheet.width as usize;
    for y in top - 1..=top + picture.height {
        for x in left - 1..=left + picture.width {
            sheet.color[y as usize * sheet_width + x as usize] = opaque(FRAME_COLOR);
        }
    }
    for (i, &[r, g, b, _]) in picture.color.iter().enumerate() {
        let (x, y) = (i % picture.width as usize, i / picture.width as usize);
        sheet.color[(top as usize + y) * sheet_width + left as usize + x] = [r, g, b, 255];
    }
}

/// Lets text be drawn on a picture; what falls outside is left out.
struct TextCanvas<'a>(&'a mut Image);

impl OriginDimensions for TextCanvas<'_> {
    fn size(&self) -> Size {
        Size::new(self.0.width, self.0.height)
    }
}

impl DrawTarget for TextCanvas<'_> {
    type Color = Rgb888;
    type Error = std::convert::Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Self::Error> {
        for Pixel(at, color) in pixels {
            let (Ok(x), Ok(y)) = (u32::try_from(at.x), u32::try_from(at.y)) else {
                continue;
            };
            if x < self.0.width && y < self.0.height {
                self.0.color[y as usize * self.0.width as usize + x as usize] = opaque(color);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(sheet: &Image, color: Rgb888) -> usize {
        sheet.color.iter().filter(|c| **c == opaque(color)).count()
    }

    #[test]
    fn pictures_lie_in_a_grid_above_their_labels() {
        let red = Image::filled(200, 100, [255, 0, 0, 0]);
        let green = Image::filled(120, 100, [0, 255, 0, 255]);
        let sheet = contact_sheet(
            &[
                ("a".into(), red.clone()),
                ("b".into(), green),
                ("c".into(), red),
            ],
            2,
        );
        assert_eq!(
            (sheet.width, sheet.height),
            (16 + 2 * 216, 16 + 2 * (100 + 22 + 16))
        );
        assert_eq!(
            sheet
                .color
                .iter()
                .filter(|c| **c == [255, 0, 0, 255])
                .count(),
            40_000
        );
        assert_eq!(
            sheet
                .color
                .iter()
                .filter(|c| **c == [0, 255, 0, 255])
                .count(),
            12_000
        );
        assert_eq!(
            sheet.color[16 * sheet.width as usize + 16],
            [255, 0, 0, 255]
        );
        // The narrow one is centered in its cell.
        assert_eq!(
            sheet.color[16 * sheet.width as usize + 232 + 40],
            [0, 255, 0, 255]
        );
        assert_eq!(
            sheet.color[16 * sheet.width as usize + 232 + 38],
            opaque(SHEET_COLOR)
        );
        assert!(sheet.color.iter().all(|c| c[3] == 255));
    }

    #[test]
    fn labels_are_drawn_below_and_differ() {
        let picture = Image::filled(200, 50, [0; 4]);
        let plain = contact_sheet(&[(String::new(), picture.clone())], 1);
        assert_eq!(count(&plain, LABEL_COLOR), 0);
        let one = contact_sheet(&[("splats, 3 px".into(), picture.clone())], 1);
        let two = contact_sheet(&[("splats, 4 px".into(), picture)], 1);
        assert!(count(&one, LABEL_COLOR) > 60);
        assert_ne!(one, two);
        let rows: Vec<usize> = (0..one.color.len())
            .filter(|&i| one.color[i] == opaque(LABEL_COLOR))
            .map(|i| i / one.width as usize)
            .collect();
        assert!(
            rows.iter().all(|r| (16 + 50 + 7..16 + 50 + 22).contains(r)),
            "{rows:?}"
        );
    }

    #[test]
    fn sheets_stay_below_the_largest_side_and_odd_input_is_fine() {
        let large = Image::filled(3000, 2000, [128, 64, 32, 255]);
        let sheet = contact_sheet(&vec![("a label".into(), large); 4], 2);
        assert!(sheet.width <= LARGEST_SIDE && sheet.height <= LARGEST_SIDE);
        assert_eq!(sheet.width, 16 + 2 * 1516);
        assert!(sheet.color.contains(&[128, 64, 32, 255]));

        let empty = contact_sheet(&[], 3);
        assert_eq!((empty.width, empty.height), (16 + 108 + 16, 16));
        let long = "a very long label that cannot fit, with ünïcode and\na second line";
        let nothing = contact_sheet(&[(long.into(), Image::default())], 0);
        assert_eq!(nothing.width, 140);
        assert_eq!(shortened(long, 12), "a very lo...");
        assert_eq!(shortened("a\nb", 12), "a b");
    }
}
