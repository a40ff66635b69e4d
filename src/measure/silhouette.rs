//! How far apart two silhouettes are.
//!
//! Distances come from the exact Euclidean distance transform of Felzenszwalb and Huttenlocher, *Distance Transforms of
//! Sampled Functions* (Theory of Computing 8, 2012): one pass of lower envelopes of parabolas a row and a column. The
//! crates that offer it bring a linear algebra library with them or round to integers.

use super::SampleSpread;
use super::coverage::{CoverageMask, masks};
use crate::image::{Error, PixelSource};

/// Distance between the silhouettes of two pictures in pixels, symmetric: from every pixel on the outline of one to the
/// nearest on the outline of the other, and back.
///
/// The outline of a picture are its covered pixels with an uncovered one at a side; the border of the picture is no
/// outline, but the rims of holes are. Distances are those of pixel centers, so a shift by a part of a pixel may show
/// as 0 or 1. Two pictures without outlines are 0 apart; if only one has none, they are infinitely far apart.
///
/// # Errors
/// [`Error::Size`] when the pictures differ in size.
pub fn silhouette(
    reference: &impl PixelSource,
    other: &impl PixelSource,
) -> Result<SampleSpread, Error> {
    let (reference, other) = masks(reference, other)?;
    let outlines = [outline(&reference), outline(&other)];
    let fields = outlines
        .each_ref()
        .map(|marks| squared_distances(marks, reference.width, reference.height));
    let mut distances = Vec::new();
    for (marks, field) in [(&outlines[0], &fields[1]), (&outlines[1], &fields[0])] {
        distances.extend(
            marks
                .iter()
                .zip(field)
                .filter(|(is_outline, _)| **is_outline)
                .map(|(_, squared)| squared.sqrt()),
        );
    }
    Ok(SampleSpread::of(distances))
}

fn outline(mask: &CoverageMask) -> Vec<bool> {
    (0..mask.is_covered.len())
        .map(|i| mask.is_covered[i] && mask.neighbors(i).any(|n| !mask.is_covered[n]))
        .collect()
}

/// Squared distance of each pixel's center from that of the nearest marked pixel; infinite where none is marked.
pub(crate) fn squared_distances(is_marked: &[bool], width: usize, height: usize) -> Vec<f64> {
    let mut field: Vec<f64> = is_marked
        .iter()
        .map(|marked| if *marked { 0.0 } else { f64::INFINITY })
        .collect();
    let mut envelope = SilhouetteEnvelope::default();
    let mut line = Vec::new();
    for x in 0..width {
        line.clear();
        line.extend((0..height).map(|y| field[y * width + x]));
        envelope.transform(&line, |y, value| field[y * width + x] = value);
    }
    for row in field.chunks_mut(width.max(1)) {
        line.clear();
        line.extend_from_slice(row);
        envelope.transform(&line, |x, value| row[x] = value);
    }
    field
}

/// The lower envelope of parabolas (x - v)² + f(v).
#[derive(Default)]
struct SilhouetteEnvelope {
    /// Where the parabolas of the envelope have their vertices, left to right.
    vertices: Vec<usize>,
    /// From where on each is the lowest.
    starts: Vec<f64>,
}

impl SilhouetteEnvelope {
    fn transform(&mut self, line: &[f64], mut write: impl FnMut(usize, f64)) {
        self.vertices.clear();
        self.starts.clear();
        for (q, height) in line.iter().enumerate() {
            // A parabola at infinity is nowhere the lowest.
            if height.is_infinite() {
                continue;
            }
            let mut start = f64::NEG_INFINITY;
            while let (Some(&v), Some(&from)) = (self.vertices.last(), self.starts.last()) {
                let (a, b) = (v as f64, q as f64);
                start = ((height + b * b) - (line[v] + a * a)) / (2.0 * (b - a));
                if start > from {
                    break;
                }
                self.vertices.pop();
                self.starts.pop();
                start = f64::NEG_INFINITY;
            }
            self.vertices.push(q);
            self.starts.push(start);
        }
        let mut k = 0;
        for x in 0..line.len() {
            while k + 1 < self.starts.len() && self.starts[k + 1] <= x as f64 {
                k += 1;
            }
            if let Some(&v) = self.vertices.get(k) {
                let d = x as f64 - v as f64;
                write(x, d * d + line[v]);
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;
    use crate::image::Image;

    #[test]
    fn the_distance_transform_is_that_of_all_pairs() {
        let (width, height) = (23, 17);
        // From a single pixel to many; a multiplicative walk looks random enough.
        for step in [391, 97, 31, 7, 2, 1] {
            let marks: Vec<bool> = (0..width * height)
                .map(|i| i * 59 % (width * height) % step == 0)
                .collect();
            let field = squared_distances(&marks, width, height);
            for (i, found) in field.iter().enumerate() {
                let nearest = (0..marks.len())
                    .filter(|m| marks[*m])
                    .map(|m| {
                        let dx = (m % width).abs_diff(i % width);
                        let dy = (m / width).abs_diff(i / width);
                        (dx * dx + dy * dy) as f64
                    })
                    .fold(f64::INFINITY, f64::min);
                assert_eq!(*found, nearest, "pixel {i}, every {step}");
            }
        }
        let none = squared_distances(&[false; 6], 3, 2);
        assert_eq!(none, [f64::INFINITY; 6]);
    }

    /// Covered where `f` of the pixel's center is not positive.
    fn field(f: impl Fn(f64, f64) -> f64) -> Image {
        let mut image = Image::filled(100, 80, [0; 4]);
        for (i, pixel) in image.color.iter_mut().enumerate() {
            let (x, y) = ((i % 100) as f64 + 0.5, (i / 100) as f64 + 0.5);
            if f(x, y) <= 0.0 {
                pixel[3] = 255;
            }
        }
        image
    }

    #[test]
    fn shifted_half_planes_are_as_far_apart_as_they_were_shifted() {
        let (a, b) = (field(|x, _| x - 40.0), field(|x, _| x - 43.0));
        let d = silhouette(&a, &b).unwrap();
        assert_eq!((d.count, d.mean, d.p99, d.max), (160, 3.0, 3.0, 3.0));
        assert_eq!(silhouette(&a, &a).unwrap().max, 0.0);
    }

    #[test]
    fn concentric_circles_are_the_difference_of_radii_apart() {
        let disc = |r: f64| field(move |x, y| (x - 50.0).hypot(y - 40.0) - r);
        let d = silhouette(&disc(20.0), &disc(26.0)).unwrap();
        // Outlines are chains of pixels: each within a pixel of its circle.
        assert!((d.mean - 6.0).abs() < 0.3, "{d:?}");
        assert!((4.8..7.2).contains(&d.p99) && d.max < 7.5, "{d:?}");
    }

    #[test]
    fn nothing_is_infinitely_far_from_something() {
        let (full, empty) = (field(|_, _| -1.0), field(|_, _| 1.0));
        // Neither has an outline: the border of the picture is none.
        assert_eq!(silhouette(&full, &empty).unwrap().max, 0.0);
        let half = field(|x, _| x - 40.0);
        assert_eq!(silhouette(&half, &empty).unwrap().mean, f64::INFINITY);
        assert_eq!(silhouette(&empty, &half).unwrap().mean, f64::INFINITY);
    }
}
