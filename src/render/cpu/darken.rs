//! What looks share that darken a drawn picture: its pixels, and light that takes nothing from the background.

/// The picture of a rectangle, drawn.
pub(crate) struct DrawnRectangle<'a> {
    /// From the first pixel of the rectangle on: red in the lowest byte, coverage in the highest.
    pub(crate) colors: &'a mut [u32],
    /// From a row of colors to the next, pixels.
    pub(crate) pitch: usize,
    /// Reversed depths, row by row; 0 where nothing is.
    pub(crate) depths: &'a [f32],
    /// Width, pixels.
    pub(crate) width: usize,
}

impl DrawnRectangle<'_> {
    /// The same once more, for a look of several.
    pub(crate) fn again(&mut self) -> DrawnRectangle<'_> {
        DrawnRectangle {
            colors: &mut *self.colors,
            ..*self
        }
    }
}

/// A pixel with less light: red in the lowest byte, coverage in the highest. The background (0 to 255) shows through what is not
/// covered and keeps its light. Where nothing is drawn nothing changes.
#[inline(always)]
pub(super) fn darkened_word(word: u32, light: f32, background: [f32; 3], is_drawn: bool) -> u32 {
    let alpha = word >> 24;
    let open = 1.0 - alpha as f32 * (1.0 / 255.0);
    let byte = |shift: u32, background: f32| {
        let value = (word >> shift & 255) as f32;
        let behind = background * open;
        let darkened = behind + (value - behind) * light;
        (darkened.clamp(0.0, 255.0) + 0.5) as u32
    };
    let [red, green, blue] = background;
    let darkened = byte(0, red) | byte(8, green) << 8 | byte(16, blue) << 16 | alpha << 24;
    if is_drawn && alpha > 0 {
        darkened
    } else {
        word
    }
}

/// A pixel of floats with less light: see [`darkened_word`]; the background is 0 to 1.
pub(super) fn darken_value(value: &mut [f32; 4], light: f32, background: [f32; 3]) {
    let alpha = value[3];
    for (color, background) in value.iter_mut().zip(background) {
        let behind = background * (1.0 - alpha);
        *color = behind + (*color - behind) * light;
    }
}
