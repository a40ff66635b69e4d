//! Mipmaps of a photograph, sampled as a device samples a texture.

/// Decoded pixels, three bytes each, row 0 on top.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PhotoPixels {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Row-major red, green, blue.
    pub rgb: Vec<[u8; 3]>,
}

impl PhotoPixels {
    /// A picture of one color.
    pub fn filled(width: u32, height: u32, color: [u8; 3]) -> Self {
        Self {
            width,
            height,
            rgb: vec![color; width as usize * height as usize],
        }
    }

    /// The pixel of a column and a row; those beyond the border count as the nearest inside. Must not be empty.
    pub fn at(&self, x: i64, y: i64) -> [u8; 3] {
        let x = x.clamp(0, i64::from(self.width) - 1) as usize;
        let y = y.clamp(0, i64::from(self.height) - 1) as usize;
        self.rgb[y * self.width as usize + x]
    }

    /// The picture, which must not be empty, at half the size, each pixel the mean of four; a last odd row or column is repeated.
    #[must_use]
    pub fn halved(&self) -> Self {
        let (width, height) = (
            self.width.div_ceil(2).max(1),
            self.height.div_ceil(2).max(1),
        );
        let mean = |four: [[u8; 3]; 4]| {
            let sum = |c: usize| four.iter().map(|pixel| u16::from(pixel[c])).sum::<u16>();
            [0, 1, 2].map(|c| ((sum(c) + 2) / 4) as u8)
        };
        let mut rgb = Vec::with_capacity(width as usize * height as usize);
        let row = self.width as usize;
        for rows in self.rgb.chunks(2 * row) {
            let (upper, lower) = rows.split_at(row);
            // A last row is its own neighbor.
            let lower = if lower.is_empty() { upper } else { lower };
            let pairs = upper.chunks_exact(2).zip(lower.chunks_exact(2));
            rgb.extend(pairs.map(|(above, below)| mean([above[0], above[1], below[0], below[1]])));
            if row % 2 == 1 {
                let [above, below] = [upper[row - 1], lower[row - 1]];
                rgb.push(mean([above, above, below, below]));
            }
        }
        Self { width, height, rgb }
    }
}

/// A photograph and its halves, down to one pixel.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PhotoPyramid {
    /// The levels, largest first.
    pub levels: Vec<PhotoPixels>,
}

impl PhotoPyramid {
    /// The levels of a picture; none of one without pixels.
    pub fn new(pixels: PhotoPixels) -> Self {
        let mut levels = Vec::new();
        if pixels.width == 0 || pixels.height == 0 {
            return Self { levels };
        }
        let mut next = pixels;
        while next.width > 1 || next.height > 1 {
            let half = next.halved();
            levels.push(std::mem::replace(&mut next, half));
        }
        levels.push(next);
        Self { levels }
    }

    /// Width and height of the largest level; zeros without levels.
    pub fn size(&self) -> [u32; 2] {
        self.levels
            .first()
            .map_or([0; 2], |level| [level.width, level.height])
    }

    /// Memory of all levels, bytes.
    pub fn bytes(&self) -> u64 {
        self.levels
            .iter()
            .map(|level| 3 * level.rgb.len() as u64)
            .sum()
    }

    /// The color, 0..=1, at (u, v) of 0..=1 of the picture (0 is the left or top border), between two levels: bilinear in
    /// each, clamped at the border. Black without levels.
    pub fn sample(&self, [u, v]: [f32; 2], level: f32) -> [f32; 3] {
        let Some(last) = self.levels.len().checked_sub(1) else {
            return [0.0; 3];
        };
        let level = if level > 0.0 {
            level.min(last as f32)
        } else {
            0.0
        };
        let first = level as usize;
        let part = level - first as f32;
        let fine = bilinear(&self.levels[first], [u, v]);
        if part <= 0.0 || first == last {
            return fine;
        }
        let coarse = bilinear(&self.levels[first + 1], [u, v]);
        [0, 1, 2].map(|c| fine[c] + part * (coarse[c] - fine[c]))
    }
}

fn bilinear(level: &PhotoPixels, [u, v]: [f32; 2]) -> [f32; 3] {
    let x = u * level.width as f32 - 0.5;
    let y = v * level.height as f32 - 0.5;
    let (left, top) = (x.floor(), y.floor());
    let (fx, fy) = (x - left, y - top);
    let (i, j) = (left as i64, top as i64);
    let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(di, dj)| level.at(i + di, j + dj));
    [0, 1, 2].map(|k| {
        let [a, b, c, d] = [a, b, c, d].map(|pixel| f32::from(pixel[k]));
        let above = a + fx * (b - a);
        let below = c + fx * (d - c);
        (above + fy * (below - above)) / 255.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture whose red is the column and whose green is the row.
    fn ramp(width: u32, height: u32) -> PhotoPyramid {
        let rgb = (0..height)
            .flat_map(|y| (0..width).map(move |x| [x as u8, y as u8, 0]))
            .collect();
        PhotoPyramid::new(PhotoPixels { width, height, rgb })
    }

    #[test]
    fn a_pixel_is_itself_at_its_center_and_the_mean_between() {
        let pyramid = ramp(8, 4);
        let at = |x: f32, y: f32| pyramid.sample([x / 8.0, y / 4.0], 0.0).map(|v| v * 255.0);
        assert_eq!(at(2.5, 1.5), [2.0, 1.0, 0.0]);
        assert_eq!(at(3.0, 2.0), [2.5, 1.5, 0.0]);
        // Clamped beyond the centers of the border.
        assert_eq!(at(-3.0, 9.0), [0.0, 3.0, 0.0]);
    }

    #[test]
    fn levels_are_halves_and_blend() {
        let pyramid = ramp(8, 4);
        assert_eq!(pyramid.levels.len(), 4);
        assert_eq!(pyramid.bytes(), 3 * (32 + 8 + 2 + 1));
        let at = |level: f32| pyramid.sample([4.0 / 8.0, 0.25], level)[0] * 255.0;
        assert_eq!(at(0.0), 3.5);
        // Columns of level 1: 1, 3, 5, 7 after rounding.
        assert_eq!(at(1.0), 4.0);
        assert!((at(0.5) - 3.75).abs() < 1e-5);
        assert_eq!(at(99.0), at(3.0));
        assert_eq!(at(f32::NAN), at(0.0));
    }

    #[test]
    fn a_picture_without_pixels_is_black() {
        let nothing = PhotoPyramid::new(PhotoPixels::default());
        assert_eq!(
            (nothing.size(), nothing.sample([0.5; 2], 1.0)),
            ([0; 2], [0.0; 3])
        );
    }
}
