//! Supersampled references, and pictures that differ.

use super::scene::*;
use glam::DVec3;
use surfel::image::{Image, PictureAccumulator, compare, jittered};
use surfel::pack::PrimitiveStyle;
use surfel::render::PictureOutputs;
use surfel::render::reference::render;

/// Area of the unit square at (0, 0) below the line y = a x + b.
fn area_below(a: f64, b: f64) -> f64 {
    let steps = 4000;
    (0..steps)
        .map(|i| {
            (a * (f64::from(i) + 0.5) / f64::from(steps) + b).clamp(0.0, 1.0) / f64::from(steps)
        })
        .sum()
}

#[test]
fn the_mean_of_jittered_pictures_is_the_covered_area() {
    let view = flat_view();
    for (slope, start) in [(0.37f32, 17.3f32), (-0.81, 55.1), (0.25, 20.0)] {
        let line = |x: f32| at(x, start + slope * x, 3.0);
        let model = Model::from_corners(&[
            [line(-1000.0), line(1000.0), at(-1000.0, -5000.0, 3.0)],
            [
                line(1000.0),
                at(1000.0, -5000.0, 3.0),
                at(-1000.0, -5000.0, 3.0),
            ],
        ]);
        let mut sum = PictureAccumulator::new();
        for i in 0..16 {
            let image = render(
                &jittered(&view, i, 4),
                &model.list(),
                &PrimitiveStyle::default(),
                PictureOutputs::default(),
            );
            sum.add(&image).unwrap();
        }
        let mean = sum.mean();
        let single = render(
            &view,
            &model.list(),
            &PrimitiveStyle::default(),
            PictureOutputs::default(),
        );
        let (mut largest, mut largest_single): (f64, f64) = (0.0, 0.0);
        let mut signed = 0.0;
        for y in 0..64 {
            for x in 0..64 {
                let b = f64::from(start) + f64::from(slope) * f64::from(x) - f64::from(y);
                let area = area_below(f64::from(slope), b);
                let i = (y * 64 + x) as usize;
                let error = f64::from(mean.color[i][3]) - area;
                signed += error;
                largest = largest.max(error.abs());
                largest_single =
                    largest_single.max((f64::from(single.color[i][3]) / 255.0 - area).abs());
            }
        }
        println!(
            "slope {slope}: {largest:.4} with 16 samples, {largest_single:.4} with one, sum {signed:.3}"
        );
        assert!(largest <= 1.0 / 16.0 + 1e-3, "slope {slope}: {largest}");
        assert!(signed.abs() < 0.5, "slope {slope}: {signed}");
        assert!(largest_single > 0.3);
    }
}

#[test]
fn comparing_pictures_sees_a_moved_sphere() {
    let draw = |x: f64| {
        let model = sphere(DVec3::new(x, 0.0, 0.0), 100, 50);
        render(
            &sphere_view(3.0, 200),
            &model.list(),
            &PrimitiveStyle::default(),
            PictureOutputs::default(),
        )
    };
    let here = draw(0.0);
    assert!(compare(&here, &draw(0.0), 0.0).unwrap().is_zero());
    let d = compare(&here, &draw(0.012), 1.0).unwrap();
    assert!(!d.is_zero());
    assert!(
        d.missing > 50 && d.extra > 50 && d.hole_pixels == 0,
        "{d:?}"
    );
    assert!(
        d.object.rmse > d.whole.rmse && d.whole.rmse > 0.005,
        "{d:?}"
    );
    assert!(compare(&here, &Image::filled(3, 3, [0; 4]), 0.0).is_err());
}
