//! A background that changes from top to bottom: put behind a picture that was drawn before the color of the top.
//!
//! With B the color of the top, D what the bottom has more, t from 0 at the upper edge to 1 at the lower, and a the covered part of
//! a pixel, its color gains `(1 - a) (D t + d)`. The d of at most half a level dithers: it is that of ordered dithering
//! (Bayer, "An Optimum Method for Two-Level Rendition of Continuous-Tone Pictures", ICC 1973) with a pattern of 8 x 8 pixels, so
//! that no bands are seen and nothing is random.

use crate::image::{Image, unorm8};
use crate::render::Settings;

/// Change of a background from top to bottom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BackgroundGradient {
    /// Change from the top to the bottom: red, green, blue.
    pub(crate) change: [f32; 3],
}

impl BackgroundGradient {
    /// Gradient of settings; `None` where the background is of one color.
    pub(crate) fn of(settings: &Settings) -> Option<Self> {
        let (top, bottom) = (settings.background, settings.background_bottom?);
        Some(Self {
            change: [0, 1, 2].map(|c| bottom[c] - top[c]),
        })
    }

    /// Gain of a pixel that nothing covers, in a picture of this height.
    fn gain(&self, [x, y]: [usize; 2], height: usize) -> [f32; 3] {
        let down = (y as f32 + 0.5) / height as f32;
        self.change.map(|change| change * down + dither(x, y))
    }

    /// Puts it behind a picture: its bytes, and its values where it has any.
    pub(crate) fn put_behind(&self, image: &mut Image) {
        let (width, height) = (image.width as usize, image.height as usize);
        for at in 0..image.color.len() {
            let place = [at % width, at / width];
            image.color[at] = self.behind_pixel(image.color[at], place, height);
        }
        self.put_behind_values(&mut image.values, [width, height]);
    }

    /// Puts it behind the words of a picture: red in the lowest byte, coverage in the highest.
    pub(crate) fn put_behind_words(
        &self,
        words: &mut [u32],
        pitch: usize,
        [width, height]: [usize; 2],
    ) {
        for (y, row) in words.chunks_mut(pitch.max(1)).take(height).enumerate() {
            for (x, word) in row[..width].iter_mut().enumerate() {
                if *word >> 24 != 255 {
                    *word =
                        u32::from_le_bytes(self.behind_pixel(word.to_le_bytes(), [x, y], height));
                }
            }
        }
    }

    /// Puts it behind a picture of floats.
    pub(crate) fn put_behind_values(&self, values: &mut [[f32; 4]], [width, height]: [usize; 2]) {
        for (at, value) in values.iter_mut().enumerate() {
            let gain = self.gain([at % width, at / width], height);
            let open = 1.0 - value[3];
            for (color, gain) in value.iter_mut().zip(gain) {
                *color += open * gain;
            }
        }
    }

    fn behind_pixel(&self, pixel: [u8; 4], place: [usize; 2], height: usize) -> [u8; 4] {
        let [red, green, blue, alpha] = pixel;
        let open = 1.0 - f32::from(alpha) / 255.0;
        let gain = self.gain(place, height);
        let with = |color: u8, gain: f32| unorm8(f64::from(f32::from(color) / 255.0 + open * gain));
        [
            with(red, gain[0]),
            with(green, gain[1]),
            with(blue, gain[2]),
            alpha,
        ]
    }
}

/// Less than half a level up or down: the value of the pattern of 8 x 8 at a pixel.
fn dither(x: usize, y: usize) -> f32 {
    let d = x ^ y;
    let place =
        (d & 1) << 5 | (y & 1) << 4 | (d & 2) << 2 | (y & 2) << 1 | (d & 4) >> 1 | (y & 4) >> 2;
    ((place as f32 + 0.5) / 64.0 - 0.5) / 255.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_of_the_pattern_has_a_value_of_its_own() {
        let mut places: Vec<u32> = (0..64)
            .map(|i| (64.0 * (255.0 * dither(i % 8, i / 8) + 0.5)) as u32)
            .collect();
        places.sort_unstable();
        assert_eq!(places, (0..64).collect::<Vec<_>>());
    }

    #[test]
    fn means_over_the_pattern_are_the_gradient_and_what_is_covered_stays() {
        let gradient = BackgroundGradient {
            change: [0.1, -0.1, 0.03],
        };
        let (width, height) = (64, 64);
        let mut image = Image::filled(width, height, [51, 102, 20, 0]);
        image.color[70] = [9, 8, 7, 255];
        gradient.put_behind(&mut image);
        assert_eq!(image.color[70], [9, 8, 7, 255]);
        for block in 1..8 {
            let mut sum = [0.0; 3];
            for y in 8 * block..8 * block + 8 {
                for x in 0..64 {
                    for (c, sum) in sum.iter_mut().enumerate() {
                        *sum += f64::from(image.color[(y * width + x) as usize][c]) / 512.0;
                    }
                }
            }
            let down = (8.0 * f64::from(block) + 4.0) / 64.0;
            for (c, (start, change)) in [(51.0, 0.1), (102.0, -0.1), (20.0, 0.03)]
                .iter()
                .enumerate()
            {
                let wanted = start + 255.0 * change * down;
                assert!(
                    (sum[c] - wanted).abs() < 0.1,
                    "{block}, {c}: {}, {wanted}",
                    sum[c]
                );
            }
        }
    }
}
