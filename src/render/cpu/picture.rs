//! The picture that frames are drawn into: the words of its pixels and what of it is not background.

/// Pixels of a whole picture: red in the lowest byte, coverage in the highest.
#[derive(Debug)]
pub struct PixelWords<'a> {
    /// Row by row, from the top left.
    pub words: &'a mut [u32],
    /// From a row to the next, words.
    pub pitch: usize,
}

/// What a picture holds beside its words, so that the next frame clears no more than it must.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawnArea {
    /// Where anything may be but the background: left, top, and one past right and bottom, pixels.
    rect_px: [u32; 4],
    background: u32,
}

impl DrawnArea {
    /// A picture of this width and height, pixels, of which nothing is known.
    pub fn unknown(width: u32, height: u32) -> Self {
        Self {
            rect_px: [0, 0, width, height],
            background: 0,
        }
    }

    /// Readies a picture of this size for a frame that draws in a rectangle and is `background` elsewhere. Words of the
    /// rectangle are not touched.
    pub(crate) fn begin(
        &mut self,
        pixels: &mut PixelWords<'_>,
        [width, height]: [u32; 2],
        rect_px: [u32; 4],
        background: u32,
    ) {
        let old = match self.background == background {
            true => self.rect_px,
            false => [0, 0, width, height],
        };
        (self.rect_px, self.background) = (rect_px, background);
        clear_beside(pixels, old, rect_px, background);
    }
}

impl PixelWords<'_> {
    /// Words from the first pixel of a rectangle on.
    pub(crate) fn from(&mut self, rect_px: [u32; 4]) -> &mut [u32] {
        let [left, top, ..] = rect_px.map(|v| v as usize);
        let first = (top * self.pitch + left).min(self.words.len());
        &mut self.words[first..]
    }
}

/// Fills what lies in the old rectangle of a picture and not in the new one.
fn clear_beside(pixels: &mut PixelWords<'_>, old: [u32; 4], new: [u32; 4], value: u32) {
    let [left, top, right, bottom] = old.map(|v| v as usize);
    let [new_left, new_top, new_right, new_bottom] = new.map(|v| v as usize);
    for y in top..bottom {
        let row = &mut pixels.words[y * pixels.pitch..];
        if (new_top..new_bottom).contains(&y) && new_left < new_right {
            row[left..new_left.clamp(left, right)].fill(value);
            row[new_right.clamp(left, right)..right].fill(value);
        } else {
            row[left..right].fill(value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_beside_the_new_rectangle_is_cleared() {
        const PITCH: usize = 11;
        const ROWS: u32 = 7;
        let sides = [0, 2, 3, 5, 8];
        let spans: Vec<[u32; 2]> = (sides.iter())
            .flat_map(|&a| sides.iter().map(move |&b| [a, b]))
            .filter(|[a, b]| a <= b)
            .collect();
        for [left, right] in &spans {
            for [new_left, new_right] in &spans {
                for ([top, bottom], [new_top, new_bottom]) in [
                    ([0, ROWS], [2, 5]),
                    ([2, 5], [0, ROWS]),
                    ([1, 4], [3, 6]),
                    ([3, 6], [1, 4]),
                    ([0, 3], [3, 3]),
                ] {
                    let mut words = vec![9; PITCH * ROWS as usize];
                    let old = [*left, top, *right, bottom];
                    let new = [*new_left, new_top, *new_right, new_bottom];
                    let mut pixels = PixelWords {
                        words: &mut words,
                        pitch: PITCH,
                    };
                    clear_beside(&mut pixels, old, new, 4);
                    for (i, word) in words.iter().enumerate() {
                        let (x, y) = ((i % PITCH) as u32, (i / PITCH) as u32);
                        let is_in = |[left, top, right, bottom]: [u32; 4]| {
                            (left..right).contains(&x) && (top..bottom).contains(&y)
                        };
                        let wanted = if is_in(old) && !is_in(new) { 4 } else { 9 };
                        assert_eq!(*word, wanted, "{old:?} {new:?} {x} {y}");
                    }
                }
            }
        }
    }
}
