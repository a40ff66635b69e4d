//! Eye-dome lighting: pixels are darkened by how much nearer their neighbors are, so that depth shows without normals.
//!
//! Source: Boucheny, *Visualisation scientifique de grands volumes de donnees* (2009), section 3.4.

use super::darken::darken_pixel;
use crate::image::Image;

/// Columns and rows from a pixel to its eight neighbors.
const NEIGHBORS: [[i64; 2]; 8] = [
    [-2, 0],
    [2, 0],
    [0, -2],
    [0, 2],
    [-1, -1],
    [1, -1],
    [-1, 1],
    [1, 1],
];

/// Darkens a picture that has distances: by 2 to the power of minus `exponent`, for each doubling of the distance from a
/// neighbor to the pixel. What the pixel is not covered by shows the background, and stays.
pub(crate) fn darken(image: &mut Image, background: [f32; 3], exponent: f32) {
    let (width, height) = (i64::from(image.width), i64::from(image.height));
    let level_at = |x: i64, y: i64| {
        let is_in = (0..width).contains(&x) && (0..height).contains(&y);
        let distance = is_in.then(|| image.depth[(y * width + x) as usize]);
        distance
            .filter(|d| d.is_finite())
            .map(|d| f64::from(d).log2())
    };
    for y in 0..height {
        for x in 0..width {
            let at = (y * width + x) as usize;
            let Some(own) = level_at(x, y) else { continue };
            let levels = NEIGHBORS
                .iter()
                .filter_map(|[dx, dy]| level_at(x + dx, y + dy));
            let nearer: f64 = levels.map(|level| (own - level).max(0.0)).sum();
            let light = (-f64::from(exponent) * nearer).exp2();
            let pixel = (&mut image.color[at], image.values.get_mut(at));
            darken_pixel(pixel, background, light);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step: distances 1 at the left and 2 at the right. A pixel at the right sees the left side with as many of its
    /// neighbors as lie there, each nearer by one doubling.
    #[test]
    fn a_step_is_darkened_by_the_neighbors_that_lie_before_it() {
        let (width, height) = (12, 9);
        let count = (width * height) as usize;
        let mut image = Image {
            width,
            height,
            color: vec![[200, 100, 50, 255]; count],
            depth: (0..count as u32)
                .map(|i| if i % width < 6 { 1.0 } else { 2.0 })
                .collect(),
            ..Image::default()
        };
        let exponent = 0.125;
        darken(&mut image, [0.0; 3], exponent);
        let at = |x: u32| image.color[(4 * width + x) as usize];
        // The pixel beside the step: one neighbor two columns away, two diagonal ones.
        for (x, before) in [(0, 0), (5, 0), (6, 3), (7, 1), (8, 0), (11, 0)] {
            let light = (-f64::from(exponent) * f64::from(before)).exp2();
            let wanted = [200.0, 100.0, 50.0].map(|c: f64| (c * light + 0.5).floor() as u8);
            assert_eq!(at(x)[..3], wanted, "column {x}");
        }
    }

    #[test]
    fn nothing_and_what_lies_behind_do_not_darken() {
        let mut image = Image {
            width: 5,
            height: 5,
            color: vec![[90, 90, 90, 255]; 25],
            depth: vec![f32::INFINITY; 25],
            ..Image::default()
        };
        image.depth[12] = 1.0;
        image.depth[13] = 4.0;
        image.depth[14] = 4.0;
        let before = image.color.clone();
        darken(&mut image, [0.0; 3], 1.0);
        assert_eq!(image.color[12], before[12], "what is in front stays");
        assert_eq!(
            image.color[0], before[0],
            "where nothing is nothing changes"
        );
        assert_eq!(image.color[14][0], 23, "a quarter, two doublings behind");
    }

    #[test]
    fn the_background_shows_through_undarkened() {
        let mut image = Image {
            width: 3,
            height: 1,
            // Half covered by white, before a background of blue.
            color: vec![[0, 0, 0, 255], [0; 4], [128, 128, 255, 128]],
            depth: vec![1.0, f32::INFINITY, 2.0],
            ..Image::default()
        };
        darken(&mut image, [0.0, 0.0, 1.0], 20.0);
        let [red, green, blue, alpha] = image.color[2];
        assert_eq!((red, green, alpha), (0, 0, 128));
        assert!(blue.abs_diff(127) <= 1, "{blue}: half of the background");
    }
}
