//! The pixels around the cursor in which a surface is looked for.

/// Distance around a pixel that is looked at, pixels.
const RADIUS_PX: u32 = 6;

/// Pixels of the largest such area.
pub(crate) const MOST_PROBE_PIXELS: u64 = (2 * RADIUS_PX as u64 + 1).pow(2);

/// Pixels within 6 columns and rows of one, as far as they lie in the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ProbeArea {
    /// The one in the middle, from the left and top of the area.
    middle: [u32; 2],
    /// Left, top, width and height, pixels of the picture.
    part: [u32; 4],
}

impl ProbeArea {
    /// The area around pixel `[x, y]` of a picture of a size that contains it.
    pub(crate) fn around([x, y]: [u32; 2], [width, height]: [u32; 2]) -> Self {
        let (left, top) = (x.saturating_sub(RADIUS_PX), y.saturating_sub(RADIUS_PX));
        let right = (x + RADIUS_PX + 1).min(width);
        let bottom = (y + RADIUS_PX + 1).min(height);
        Self {
            middle: [x - left, y - top],
            part: [left, top, right - left, bottom - top],
        }
    }

    /// Left, top, width and height, pixels.
    pub(crate) fn part(&self) -> [u32; 4] {
        self.part
    }

    /// Finds the reversed depth of the covered pixel nearest to the middle, at most 6 pixels away, of the depths of the area,
    /// row by row.
    pub(crate) fn nearest_covered(&self, depths: &[f32]) -> Option<f32> {
        let [_, _, width, height] = self.part;
        let [x, y] = self.middle;
        let square = |i: u32| (i % width).abs_diff(x).pow(2) + (i / width).abs_diff(y).pow(2);
        (0..width * height)
            .filter(|&i| depths[i as usize] > 0.0)
            .map(|i| (square(i), i))
            .filter(|(square, _)| *square <= RADIUS_PX * RADIUS_PX)
            .min()
            .map(|(_, i)| depths[i as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_covered_pixel_within_reach_is_taken() {
        let (width, height) = (13, 9);
        let found = |depths: &[f32], x, y| {
            let area = ProbeArea {
                middle: [x, y],
                part: [0, 0, width, height],
            };
            area.nearest_covered(depths)
        };
        let mut depths = vec![0.0; width as usize * height as usize];
        assert_eq!(found(&depths, 6, 4), None);
        depths[0] = 0.9;
        assert_eq!(found(&depths, 6, 4), None, "7.2 pixels away");
        assert_eq!(found(&depths, 4, 4), Some(0.9));
        depths[(4 * width + 8) as usize] = 0.5;
        depths[(6 * width + 6) as usize] = 0.25;
        assert_eq!(found(&depths, 7, 4), Some(0.5));
        assert_eq!(found(&depths, 6, 6), Some(0.25));
    }

    #[test]
    fn areas_end_at_the_rim_of_the_picture() {
        let area = ProbeArea::around([2, 95], [100, 100]);
        assert_eq!(area.part(), [0, 89, 9, 11]);
        assert_eq!(area.middle, [2, 6]);
        let whole = ProbeArea::around([50, 50], [100, 100]);
        let [_, _, width, height] = whole.part();
        assert_eq!(u64::from(width * height), MOST_PROBE_PIXELS);
    }
}
