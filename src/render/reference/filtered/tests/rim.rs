//! Coverage where a surface ends.

use crate::render::reference::filtered::tests::*;

/// Area of a convex polygon, and its centroid, where `inside(p) >= 0` (linear).
fn clipped(polygon: &[[f64; 2]], inside: impl Fn([f64; 2]) -> f64) -> (f64, [f64; 2]) {
    let mut kept = Vec::new();
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (da, db) = (inside(a), inside(b));
        if da >= 0.0 {
            kept.push(a);
        }
        if (da >= 0.0) != (db >= 0.0) {
            let t = da / (da - db);
            kept.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
        }
    }
    let (mut area, mut x, mut y) = (0.0, 0.0, 0.0);
    for (i, a) in kept.iter().enumerate() {
        let b = kept[(i + 1) % kept.len()];
        let cross = (a[0] * b[1] - b[0] * a[1]) / 2.0;
        area += cross;
        x += cross * (a[0] + b[0]) / 3.0;
        y += cross * (a[1] + b[1]) / 3.0;
    }
    (area, [x / area, y / area])
}

fn square_at(x: f64, y: f64, side: f64) -> [[f64; 2]; 4] {
    [[x, y], [x + side, y], [x + side, y + side], [x, y + side]]
}

#[test]
fn the_rim_of_a_tilted_half_plane_is_covered_as_the_half_plane_covers_it() {
    for angle in [0.1f64, 0.4, 0.785, 1.3, 2.5, 4.0] {
        let (sin, cos) = angle.sin_cos();
        let inside = |[x, y]: [f64; 2]| (x - 24.1) * cos + (y - 20.3) * sin;
        // Cells that fit neither the pixels nor the half plane.
        let cell = 0.23;
        let mut splats = Vec::new();
        for j in -5..190 {
            for i in -5..230 {
                let (area, [x, y]) = clipped(
                    &square_at(f64::from(i) * cell, f64::from(j) * cell, cell),
                    inside,
                );
                if area > 1e-9 {
                    // The half plane is tilted in depth, too.
                    let z = 8.0 + 0.2 * x;
                    let one = splat([x as f32, y as f32, z as f32], RED, area as f32);
                    let side = area.sqrt() as f32;
                    splats.push(FilteredPatch {
                        extent_px: [side, side],
                        side_px: 1.0,
                        ..one
                    });
                }
            }
        }
        let got = draw_splats(&flat(), &splats, &style(1.0));
        let (mut count, mut off, mut bias) = (0.0, 0.0, 0.0);
        for y in 1..39 {
            for x in 1..47 {
                let (exact, _) = clipped(&square_at(x as f64, y as f64, 1.0), inside);
                let alpha = f64::from(got.image.color[at(x, y)][3]) / 255.0;
                if exact > 1e-6 && exact < 1.0 - 1e-6 {
                    count += 1.0;
                    off += (alpha - exact).abs();
                    bias += alpha - exact;
                } else if inside([x as f64 + 0.5, y as f64 + 0.5]) < -1.0 {
                    // Cells that the edge cuts reach beyond it by less than a cell.
                    assert_eq!(alpha, 0.0, "{angle} {x} {y}");
                } else if inside([x as f64 + 0.5, y as f64 + 0.5]) > 2.0 {
                    assert_eq!(alpha, 1.0, "{angle} {x} {y}");
                }
            }
        }
        assert!(count > 30.0, "{count}");
        assert!(off / count < 0.1, "{angle}: off by {}", off / count);
        assert!(
            (bias / count).abs() < 0.03,
            "{angle}: {} too much",
            bias / count
        );
    }
}

/// Within a level: squares add a little to a weight of a half.
#[track_caller]
fn assert_is(found: [u8; 4], expected: [u8; 4]) {
    assert!(
        (0..4).all(|c| found[c].abs_diff(expected[c]) <= 1),
        "{found:?} is not {expected:?}"
    );
}

#[test]
fn before_a_farther_part_the_rim_shows_that_part() {
    // A near square of half the weight before a far wall; both one pixel a splat.
    let mut splats = Vec::new();
    for y in 0..40 {
        for x in 0..48 {
            let center = [x as f32 + 0.5, y as f32 + 0.5, 50.0];
            splats.push(splat(center, GREEN, 1.0));
            if (10..15).contains(&x) && (10..15).contains(&y) {
                splats.push(splat([center[0], center[1], 8.0], RED, 0.5));
            }
        }
    }
    let got = draw_splats(&flat(), &splats, &style(1.0));
    assert_eq!(got.image.color[at(12, 12)], [255, 0, 0, 255]);
    for (x, y) in [(10, 10), (12, 10), (14, 13)] {
        assert_is(got.image.color[at(x, y)], [128, 128, 0, 255]);
    }
    assert_eq!(got.image.color[at(9, 12)], [0, 255, 0, 255]);
    // Not farther by more than the jump: no rim.
    for splat in splats.iter_mut().filter(|s| s.color == GREEN) {
        splat.center.z = 8.0 + FILTERED_JUMP;
    }
    let near = draw_splats(&flat(), &splats, &style(1.0));
    assert_eq!(near.image.color[at(12, 10)], [255, 0, 0, 255]);
    // Half of the neighbors empty, half the far part: both show, and only the part counts as covered.
    let splats = [
        splat([10.5, 10.5, 8.0], RED, 0.5),
        splat([9.5, 9.5, 50.0], GREEN, 1.0),
        splat([9.5, 10.5, 50.0], GREEN, 1.0),
        splat([9.5, 11.5, 50.0], GREEN, 1.0),
        splat([10.5, 9.5, 50.0], GREEN, 1.0),
    ];
    let style = PrimitiveStyle {
        background: [0.0, 0.0, 1.0],
        ..style(1.0)
    };
    let got = draw_splats(&flat(), &splats, &style);
    assert_is(got.image.color[at(10, 10)], [128, 64, 64, 191]);
}
