//! A check of conventions that needs nobody to look: sparse points, projected into the photographs, must have their colors.
//!
//! A flipped axis, a focal length in other units or a list in another order puts the points elsewhere, where colors agree by
//! chance alone.

use crate::photos::error::PhotoError;
use crate::photos::library::load_photo;
use crate::photos::scene::PhotoScene;
use rayon::prelude::*;

/// Photographs that are looked at, spread evenly over a larger scene.
const MOST_PHOTOS: usize = 24;

/// Photographs are made this small at most before points are looked up: colors of points are of no single pixel.
const LONGEST_SIDE: u32 = 1600;

/// Fewer points than this say nothing.
pub const FEWEST_POINTS: usize = 30;

/// A correlation below this is taken for a wrong convention. Right ones measured 0.87 (the castle) and 0.98
/// (Kermit), 0.82 to 0.99 a photograph; wrong ones at most 0.20.
pub const LEAST_CORRELATION: f64 = 0.6;

/// Agreement of one photograph with the sparse points.
#[derive(Debug, Clone, PartialEq)]
pub struct PhotoCheck {
    /// Index of the photograph.
    pub photo: usize,
    /// Points that the file says it shows.
    pub points: usize,
    /// Points of these that its camera puts into it.
    pub inside: usize,
    /// Correlation of the points' brightness with the photograph's, -1 to 1; `None` of too few points or without contrast.
    pub correlation: Option<f64>,
}

/// Agreement of a scene's photographs with its sparse points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SceneCheck {
    /// The photographs that were looked at.
    pub photos: Vec<PhotoCheck>,
    /// Correlation over all points of all photographs.
    pub correlation: Option<f64>,
    /// Median distance between measured and projected points, pixels; `None` where the file has no measurements.
    pub reprojection_px: Option<f64>,
    /// Sentences on all that could not be looked at or looks wrong.
    pub warnings: Vec<String>,
}

/// Pearson's correlation of pairs; `None` of fewer than [`FEWEST_POINTS`] or where one side is constant.
fn correlation(pairs: &[[f64; 2]]) -> Option<f64> {
    if pairs.len() < FEWEST_POINTS {
        return None;
    }
    let n = pairs.len() as f64;
    let mean = [0, 1].map(|i| pairs.iter().map(|p| p[i]).sum::<f64>() / n);
    let mut sums = [0.0; 3];
    for p in pairs {
        let [a, b] = [p[0] - mean[0], p[1] - mean[1]];
        sums = [sums[0] + a * a, sums[1] + b * b, sums[2] + a * b];
    }
    let scale = (sums[0] * sums[1]).sqrt();
    (scale > 1e-9).then(|| sums[2] / scale)
}

fn luma(color: [f64; 3]) -> f64 {
    0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2]
}

/// Pairs of brightness (point, photograph) of one photograph.
fn pairs_of(scene: &PhotoScene, photo: usize) -> Result<(PhotoCheck, Vec<[f64; 2]>), PhotoError> {
    let pyramid = load_photo(&scene.photos[photo], LONGEST_SIDE)?;
    let camera = &scene.photos[photo].camera;
    let mut found = PhotoCheck {
        photo,
        points: 0,
        inside: 0,
        correlation: None,
    };
    let mut pairs = Vec::new();
    for point in &scene.points {
        if !point.views.iter().any(|view| view.photo as usize == photo) {
            continue;
        }
        found.points += 1;
        let Some(pixel) = camera
            .project(point.position)
            .filter(|p| camera.contains(*p))
        else {
            continue;
        };
        found.inside += 1;
        let at = [
            pixel.x / f64::from(camera.width),
            pixel.y / f64::from(camera.height),
        ];
        let seen = pyramid.sample(at.map(|v| v as f32), 0.0);
        pairs.push([
            luma(point.color.map(f64::from)),
            255.0 * luma(seen.map(f64::from)),
        ]);
    }
    found.correlation = correlation(&pairs);
    Ok((found, pairs))
}

/// Checks the conventions of a scene. Photographs that cannot be decoded are warnings.
pub fn check_scene(scene: &PhotoScene) -> SceneCheck {
    let mut check = SceneCheck {
        reprojection_px: reprojection(scene),
        ..SceneCheck::default()
    };
    let there: Vec<usize> = (0..scene.photos.len())
        .filter(|i| scene.photos[*i].file.is_some())
        .collect();
    let has_colors = scene.points.iter().any(|point| point.color != [0; 3]);
    let has_views = scene.points.iter().any(|point| !point.views.is_empty());
    if there.is_empty() || !has_colors || !has_views {
        let lack = if there.is_empty() {
            "photographs"
        } else {
            "sparse points with colors"
        };
        check
            .warnings
            .push(format!("conventions were not checked: there are no {lack}"));
        return check;
    }
    let step = there.len().div_ceil(MOST_PHOTOS);
    let chosen: Vec<usize> = there.into_iter().step_by(step).collect();
    let found: Vec<_> = chosen
        .par_iter()
        .map(|photo| pairs_of(scene, *photo))
        .collect();
    let mut all = Vec::new();
    for result in found {
        match result {
            Ok((photo, pairs)) => {
                check.photos.push(photo);
                all.extend(pairs);
            }
            Err(error) => check.warnings.push(error.to_string()),
        }
    }
    check.correlation = correlation(&all);
    let points: usize = check.photos.iter().map(|photo| photo.points).sum();
    let inside: usize = check.photos.iter().map(|photo| photo.inside).sum();
    if points >= FEWEST_POINTS && 2 * inside < points {
        check.warnings.push(format!(
            "conventions look wrong: of {points} views of sparse points only {inside} fall into their photographs"
        ));
    } else if let Some(r) = check.correlation.filter(|r| *r < LEAST_CORRELATION) {
        check.warnings.push(format!(
            "conventions look wrong: sparse points and photographs correlate at {r:.2}, below {LEAST_CORRELATION}; an axis, the focal length, the order of the photographs or their size may be another"
        ));
    } else {
        for photo in &check.photos {
            let Some(r) = photo.correlation.filter(|r| *r < LEAST_CORRELATION) else {
                continue;
            };
            check.warnings.push(format!(
                "{} looks wrong: it correlates with its sparse points at {r:.2}, below {LEAST_CORRELATION}",
                scene.photos[photo.photo].name
            ));
        }
    }
    check
}

/// Median distance between measured and projected points, pixels, of photographs whose size is known.
fn reprojection(scene: &PhotoScene) -> Option<f64> {
    let mut distances: Vec<f64> = (scene.points.iter())
        .flat_map(|point| point.views.iter().map(move |view| (point, view)))
        .filter(|(_, view)| view.pixel.iter().all(|v| v.is_finite()))
        .filter_map(|(point, view)| {
            let camera = &scene.photos[view.photo as usize].camera;
            let [x, y] = view.pixel.map(f64::from);
            let away = camera
                .project(point.position)
                .map_or(f64::INFINITY, |p| (p.x - x).hypot(p.y - y));
            (camera.width > 0).then_some(away)
        })
        .collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_is_of_enough_points_with_contrast() {
        let line = |n: usize, sign: f64| -> Vec<[f64; 2]> {
            (0..n).map(|i| [i as f64, 3.0 + sign * i as f64]).collect()
        };
        assert!((correlation(&line(40, 1.0)).unwrap() - 1.0).abs() < 1e-12);
        assert!((correlation(&line(40, -2.0)).unwrap() + 1.0).abs() < 1e-12);
        assert_eq!(correlation(&line(FEWEST_POINTS - 1, 1.0)), None);
        assert_eq!(correlation(&line(40, 0.0)), None);
    }
}
