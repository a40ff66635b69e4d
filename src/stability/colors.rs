//! Colors of a picture against those that the surface has.

use crate::image::{FloatImage, Image};

/// Least and largest red, green and blue of the surface alone, without the background; the least is larger where there
/// is no surface.
pub(super) type ColorRange = [[f32; 3]; 2];

const NOTHING: ColorRange = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
/// A color this far outside of its range is astray, levels.
const ASTRAY: f64 = 32.0;
/// Colors are looked for no farther, pixels.
pub(super) const FARTHEST_PX: f64 = 64.0;

fn extend(range: &mut ColorRange, [least, most]: ColorRange) {
    for c in 0..3 {
        range[0][c] = range[0][c].min(least[c]);
        range[1][c] = range[1][c].max(most[c]);
    }
}

/// The colors of a picture of one sample a pixel.
pub(super) fn ranges(picture: &Image) -> Vec<ColorRange> {
    let mut ranges = vec![NOTHING; picture.color.len()];
    widen(&mut ranges, picture);
    ranges
}

/// Adds the colors of another such picture of the same size.
pub(super) fn widen(ranges: &mut [ColorRange], picture: &Image) {
    for (range, &[r, g, b, a]) in ranges.iter_mut().zip(&picture.color) {
        if a > 0 {
            let alpha = f32::from(a);
            extend(range, [[r, g, b].map(|c| f32::from(c) / alpha); 2]);
        }
    }
}

/// [`super::FailureFigure::Stray`] and [`super::FailureFigure::Astray`]; zeros where nothing is covered or no surface is near.
pub(super) fn strays(ranges: &[ColorRange], picture: &Image, reach_px: f64) -> (f64, f64) {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let reach = reach_px.min(FARTHEST_PX).ceil() as usize;
    let mut ranges = ranges.to_vec();
    // Along rows, then along columns.
    for (step, length, lines, line_step) in [(1, width, height, width), (width, height, width, 1)] {
        let before = ranges.clone();
        for line in 0..lines {
            for i in 0..length {
                let mut range = NOTHING;
                for k in i.saturating_sub(reach)..(i + reach + 1).min(length) {
                    extend(&mut range, before[line * line_step + k * step]);
                }
                ranges[line * line_step + i * step] = range;
            }
        }
    }
    let (mut sum, mut astray, mut count) = (0.0, 0u64, 0u64);
    for ([r, g, b, a], [least, most]) in picture.color.iter().zip(&ranges) {
        if *a < 128 || least[0] > most[0] {
            continue;
        }
        let alpha = f64::from(*a);
        let mut off: f64 = 0.0;
        for (c, value) in [r, g, b].into_iter().enumerate() {
            let value = 255.0 * f64::from(*value) / alpha;
            let (least, most) = (255.0 * f64::from(least[c]), 255.0 * f64::from(most[c]));
            off = off.max(least - value).max(value - most);
        }
        sum += off;
        astray += u64::from(off > ASTRAY);
        count += 1;
    }
    let count = count.max(1) as f64;
    (sum / count, 100.0 * astray as f64 / count)
}

/// [`super::FailureFigure::Moire`] with windows of 2 `reach` + 1 pixels a side, over the pixels that both cover by half; 0 where
/// there are none, and where the picture is nearer to the truth as it is.
pub(super) fn moire(truth: &FloatImage, picture: &Image, reach: usize) -> f64 {
    let (width, height) = (truth.width as usize, truth.height as usize);
    let at = |x: usize, y: usize| y * (width + 1) + x;
    // Sums from the top left: how many, then their red, green and blue.
    let mut sums = vec![[0.0f64; 4]; (width + 1) * (height + 1)];
    let shown: Vec<Option<[f64; 3]>> = truth
        .color
        .iter()
        .zip(&picture.color)
        .map(|(right, &[r, g, b, a])| {
            let is_both = right[3] >= 0.5 && a >= 128;
            is_both.then(|| [r, g, b].map(|c| 255.0 * f64::from(c) / f64::from(a)))
        })
        .collect();
    for y in 0..height {
        for x in 0..width {
            let own = shown[y * width + x].map_or([0.0; 4], |[r, g, b]| [1.0, r, g, b]);
            for c in 0..4 {
                sums[at(x + 1, y + 1)][c] =
                    own[c] + sums[at(x, y + 1)][c] + sums[at(x + 1, y)][c] - sums[at(x, y)][c];
            }
        }
    }
    let (mut as_shown, mut blurred, mut count) = (0.0, 0.0, 0u64);
    for (i, own) in shown.iter().enumerate() {
        let Some(own) = own else { continue };
        let (x, y) = (i % width, i / width);
        let (left, right) = (x.saturating_sub(reach), (x + reach + 1).min(width));
        let (top, bottom) = (y.saturating_sub(reach), (y + reach + 1).min(height));
        let of = |c: usize| {
            sums[at(right, bottom)][c] - sums[at(left, bottom)][c] - sums[at(right, top)][c]
                + sums[at(left, top)][c]
        };
        let alpha = truth.color[i][3];
        for (c, own) in own.iter().enumerate() {
            let wanted = 255.0 * f64::from(truth.color[i][c] / alpha);
            as_shown += (own - wanted).powi(2);
            blurred += (of(c + 1) / of(0) - wanted).powi(2);
        }
        count += 3;
    }
    let count = count.max(1) as f64;
    ((as_shown / count).sqrt() - (blurred / count).sqrt()).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_color_that_is_near_in_the_truth_is_not_astray() {
        // Black on the left, white on the right, half covered between.
        let mut surface = Image::filled(20, 5, [255; 4]);
        for (i, pixel) in surface.color.iter_mut().enumerate() {
            match i % 20 {
                0..=8 => *pixel = [0, 0, 0, 255],
                9 => *pixel = [128; 4],
                _ => {}
            }
        }
        let truth = ranges(&surface);
        let mut picture = Image::filled(20, 5, [0, 0, 0, 255]);
        for (i, pixel) in picture.color.iter_mut().enumerate() {
            if i % 20 > 11 {
                *pixel = [255; 4];
            }
        }
        // The step is shown 3 pixels too far right: what is 2 away is within a reach of 3.
        assert_eq!(strays(&truth, &picture, 3.0), (0.0, 0.0));
        // Within a pixel it is not: columns 10 and 11 are black where the truth is white, 9 knows column 8.
        let (stray, astray) = strays(&truth, &picture, 1.0);
        assert_eq!((stray, astray), (255.0 * 2.0 / 20.0, 10.0));
        // Colors of partly covered pixels are those of the surface.
        picture.color[9] = [128, 128, 128, 128];
        assert_eq!(strays(&truth, &picture, 3.0).1, 0.0);
        assert_eq!(
            strays(&truth, &Image::filled(20, 5, [9, 9, 9, 0]), 3.0),
            (0.0, 0.0)
        );
    }

    #[test]
    fn a_pattern_that_is_not_there_is_moire() {
        let stripes = |side: usize, from: usize| {
            let mut picture = Image::filled(64, 8, [0, 0, 0, 255]);
            for (i, pixel) in picture.color.iter_mut().enumerate() {
                if (i % 64 + from) / side % 2 == 1 {
                    *pixel = [200, 200, 200, 255];
                }
            }
            picture
        };
        let truth_of = |picture: &Image| FloatImage {
            width: 64,
            height: 8,
            color: (picture.color.iter())
                .map(|c| c.map(|v| f32::from(v) / 255.0))
                .collect(),
            ..FloatImage::default()
        };
        let striped = truth_of(&stripes(4, 0));
        assert_eq!(moire(&striped, &stripes(4, 0), 4), 0.0);
        // A pixel too far to one side is no other pattern; as wide again it is one, and so it is turned around.
        assert_eq!(moire(&striped, &stripes(4, 1), 4), 0.0);
        assert!(moire(&striped, &stripes(8, 0), 4) > 20.0);
        assert!(moire(&striped, &stripes(4, 4), 4) > 50.0);
        // Blurred away is no pattern, and where there is none in truth every one is false.
        let gray = Image::filled(64, 8, [100, 100, 100, 255]);
        assert_eq!(moire(&striped, &gray, 4), 0.0);
        let found = moire(&truth_of(&gray), &stripes(1, 0), 4);
        // Means of nine columns are 11 levels off.
        assert!((85.0..90.0).contains(&found), "{found}");
        assert_eq!(moire(&striped, &Image::filled(64, 8, [0; 4]), 4), 0.0);
    }
}
