//! Ambient occlusion in screen space: a pixel is darkened by how much of the sky above its surface the surface around it hides.
//!
//! Source: the openness of terrain, which needs no normal (Yokoyama, Shirasawa, Pike, "Visualizing Topography by Openness",
//! Photogrammetric Engineering and Remote Sensing 68, 2002), taken from a height above a map to a distance before the eye, in
//! the manner of horizons (Bavoil, Sainz, Dimitrov, "Image-Space Horizon-Based Ambient Occlusion", SIGGRAPH talks 2008).
//!
//! In each of eight lines through the pixel, the steepest rise s to one side and s' to the other hide
//! `max(0, atan s + atan s')` of pi: nothing of a plane however it is tilted, a half in an inner corner of a right angle. Where
//! nothing is, nothing hides. Rises of more than the radius fade until twice that, so that no shade falls on what lies far
//! behind. Of a cloud rises by less than half a point hide nothing: points are domes, or flat where the surface is not. Our deviations: rises are taken as if each pixel lay in the middle of the picture, all lines weigh the same, and the
//! pattern is the same in all pixels, so that nothing is random.

use super::darken::darken_pixel;
use crate::image::Image;
use crate::math::camera::View;

/// Lines through a pixel: columns and rows of a step to one side, and the parts of the radius at which they are looked at.
const LINES: [([i64; 2], [f32; 3]); 8] = [
    ([1, 0], [0.2, 0.55, 1.0]),
    ([2, 1], [0.25, 0.6, 0.95]),
    ([1, 1], [0.15, 0.45, 0.85]),
    ([1, 2], [0.3, 0.65, 1.0]),
    ([0, 1], [0.2, 0.55, 1.0]),
    ([-1, 2], [0.25, 0.6, 0.95]),
    ([-1, 1], [0.15, 0.45, 0.85]),
    ([-2, 1], [0.3, 0.65, 1.0]),
];

/// What a pixel looks at.
#[derive(Debug)]
pub(crate) struct PixelSurroundings {
    radius_px: f32,
    focal_px: f64,
    is_perspective: bool,
    /// Rises by less hide nothing, view-space units.
    slack: f64,
}

impl PixelSurroundings {
    /// Surroundings of pixels of a view, in which rises by less than `slack` (view-space units) hide nothing.
    pub(crate) fn new(view: &View, radius_px: f32, slack: f32) -> Self {
        Self {
            radius_px,
            focal_px: f64::from(view.focal_px()),
            is_perspective: view.is_perspective,
            slack: f64::from(slack),
        }
    }

    /// Darkens a picture that has distances: colors are multiplied by the openness of their pixel, 0 to 1, to a power. What
    /// the pixel is not covered by shows the background, and stays.
    pub(crate) fn darken(&self, image: &mut Image, background: [f32; 3], power: f32) {
        for at in 0..image.depth.len() {
            if !image.depth[at].is_finite() {
                continue;
            }
            let light = self.openness(image, at).powf(f64::from(power));
            let pixel = (&mut image.color[at], image.values.get_mut(at));
            darken_pixel(pixel, background, light);
        }
    }

    /// The part of the sky that a pixel sees of what it would see on a plane, 0 to 1.
    pub(crate) fn openness(&self, image: &Image, at: usize) -> f64 {
        let width = i64::from(image.width);
        let (x, y) = (at as i64 % width, at as i64 / width);
        let own = f64::from(image.depth[at]);
        let distance_at = |x: i64, y: i64| {
            let is_in = (0..width).contains(&x) && (0..i64::from(image.height)).contains(&y);
            let distance = is_in.then(|| image.depth[(y * width + x) as usize]);
            distance.filter(|d| d.is_finite()).map(f64::from)
        };
        let hidden = LINES.iter().map(|([dx, dy], parts)| {
            let step_px = ((dx * dx + dy * dy) as f64).sqrt();
            let horizon = |side: i64| {
                let rises = parts.iter().filter_map(|part| {
                    let steps = steps_of(part * self.radius_px, step_px as f32);
                    let other = distance_at(x + side * steps * dx, y + side * steps * dy)?;
                    let away_px = step_px * steps as f64;
                    let height_px = match self.is_perspective {
                        true => self.focal_px * (own / other - 1.0 - self.slack / own),
                        false => self.focal_px * (own - other - self.slack),
                    };
                    let rise = height_px / away_px;
                    let in_radii = rise * away_px / f64::from(self.radius_px);
                    Some(rise * (2.0 - in_radii).clamp(0.0, 1.0))
                });
                rises.fold(f64::NEG_INFINITY, f64::max).atan()
            };
            (horizon(1) + horizon(-1)).max(0.0)
        });
        1.0 - hidden.sum::<f64>() / (std::f64::consts::PI * LINES.len() as f64)
    }
}

/// Steps that come nearest to a length, at least one.
fn steps_of(length_px: f32, step_px: f32) -> i64 {
    let steps = length_px * (1.0 / step_px) + 0.5;
    steps.floor().max(1.0) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Openness at columns of the middle row of a picture with these distances in an orthographic view, a pixel a unit.
    fn openness(columns: &[i64], radius_px: f32, distance: impl Fn(i64, i64) -> f32) -> Vec<f64> {
        openness_of(columns, (radius_px, 0.0), distance)
    }

    /// As [`openness`], where rises by less than a height hide nothing.
    fn openness_of(
        columns: &[i64],
        (radius_px, slack): (f32, f64),
        distance: impl Fn(i64, i64) -> f32,
    ) -> Vec<f64> {
        let (width, height) = (101, 101);
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x - 50, y - 50)));
        let image = Image {
            width: width as u32,
            height: height as u32,
            depth: places.map(|(x, y)| distance(x, y)).collect(),
            ..Image::default()
        };
        let around = PixelSurroundings {
            radius_px,
            focal_px: 1.0,
            is_perspective: false,
            slack,
        };
        let at = |x: &i64| around.openness(&image, (50 * width + x + 50) as usize);
        columns.iter().map(at).collect()
    }

    #[test]
    fn a_plane_is_open_however_it_is_tilted() {
        for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.25, -2.0), (-8.0, 3.0)] {
            let plane = |x: i64, y: i64| 5000.0 + dx * x as f32 + dy * y as f32;
            for found in openness(&[-50, -3, 0, 20, 50], 20.0, plane) {
                assert_eq!(found, 1.0, "{dx}, {dy}");
            }
        }
        let perspective = PixelSurroundings {
            radius_px: 20.0,
            focal_px: 80.0,
            is_perspective: true,
            slack: 0.0,
        };
        // 1 / d is linear in the picture.
        let depth =
            (0..3600).map(|i| 1.0 / (0.1 + 1e-3 * (i % 60) as f32 - 5e-4 * (i / 60) as f32));
        let image = Image {
            width: 60,
            height: 60,
            depth: depth.collect(),
            ..Image::default()
        };
        for at in [30 * 60 + 30, 17, 59 * 60 + 40] {
            let found = perspective.openness(&image, at);
            assert!(found > 1.0 - 1e-5, "{at}: {found}");
        }
    }

    /// A valley along the rows, whose sides rise by 1 to both sides: in a line of azimuth a both sides rise by |cos a|.
    #[test]
    fn an_inner_corner_hides_what_its_angle_says() {
        let valley = |x: i64, _: i64| 500.0 - x.abs() as f32;
        let hidden = |cosine: f64| 2.0 * cosine.atan() / std::f64::consts::PI;
        let cosines =
            LINES.map(|([dx, dy], _)| (dx.abs() as f64) / ((dx * dx + dy * dy) as f64).sqrt());
        let wanted = 1.0 - cosines.map(hidden).iter().sum::<f64>() / 8.0;
        // Across the corner a half is hidden, along it nothing.
        assert!((hidden(cosines[0]) - 0.5).abs() < 1e-12 && cosines[4] == 0.0);
        let found = openness(&[0, 30], 20.0, valley);
        assert!((found[0] - wanted).abs() < 1e-6, "{found:?}, {wanted}");
        assert_eq!(found[1], 1.0, "on its side nothing is hidden");
        // A ridge hides nothing.
        assert_eq!(
            openness(&[0, 7], 20.0, |x, _| 500.0 + x.abs() as f32),
            [1.0, 1.0]
        );
    }

    #[test]
    fn what_is_far_before_and_nothing_hide_nothing() {
        let step = |height: f32| move |x: i64, _: i64| if x < 0 { 500.0 - height } else { 500.0 };
        let beside = |height: f32| openness(&[1], 10.0, step(height))[0];
        // Steps of up to the radius hide more the higher they are; from twice the radius on nothing.
        assert!(
            beside(2.0) < 1.0 && beside(8.0) < beside(2.0),
            "{}",
            beside(8.0)
        );
        assert!(beside(15.0) > beside(10.0));
        assert_eq!(beside(20.0), 1.0);
        let edge = |x: i64, _: i64| if x < 0 { f32::INFINITY } else { 500.0 };
        assert_eq!(openness(&[0, 1, 5], 10.0, edge), [1.0; 3]);
    }

    /// A tilted plane of bumps is open where they are not above the slack; a step of three times that still hides.
    #[test]
    fn bumps_of_points_hide_nothing() {
        let bumps = |height: f32| {
            move |x: i64, y: i64| {
                let is_high = (x.div_euclid(3) + y.div_euclid(3)).rem_euclid(2) == 0;
                500.0 + 0.5 * x as f32 - if is_high { height } else { 0.0 }
            }
        };
        let columns: Vec<i64> = (-20..20).collect();
        let least = |slack, height| {
            let all = openness_of(&columns, (10.0, slack), bumps(height));
            all.into_iter().fold(1.0, f64::min)
        };
        assert_eq!(least(1.0, 1.0), 1.0);
        assert!(least(0.0, 1.0) < 0.9, "{}", least(0.0, 1.0));
        let step = |height: f32| move |x: i64, _: i64| if x < 0 { 500.0 - height } else { 500.0 };
        let beside = |slack, height| openness_of(&[3], (10.0, slack), step(height))[0];
        // The slack is off on either side of a pixel, also where nothing rises: still the step is seen.
        let (own, lower) = (beside(2.0, 6.0), beside(0.0, 4.0));
        assert!(own > lower && own < 0.95, "{own} {lower}");
        // One line across a step: up by 6 - 2 over 6 pixels, and down by 2 over 10, the flattest.
        let along = (4.0f64 / 6.0).atan() - (2.0f64 / 10.0).atan();
        assert!(1.0 - own < along / std::f64::consts::PI, "{own}");
    }

    #[test]
    fn the_background_shows_through_undarkened() {
        let mut image = Image {
            width: 3,
            height: 1,
            // Half covered by white, before a background of blue, between two that are before it.
            color: vec![[0, 0, 0, 255], [128, 128, 255, 128], [0, 0, 0, 255]],
            depth: vec![1.0, 2.0, 1.0],
            ..Image::default()
        };
        let around = PixelSurroundings {
            radius_px: 1.0,
            focal_px: 1.0,
            is_perspective: false,
            slack: 0.0,
        };
        around.darken(&mut image, [0.0, 0.0, 1.0], 1000.0);
        assert!(image.color[1][2].abs_diff(127) <= 1 && image.color[1][0] == 0);
        assert_eq!(image.color[0], [0, 0, 0, 255]);
    }
}
