#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use crate::math::camera::{Camera, View};
use crate::mesh::Mesh;
use crate::oriented::quality::{overhang, uncovered_share};
use crate::oriented::radius::RadiusRule;
use crate::oriented::shapes::{cube, grid, l_shape};
use crate::oriented::splats::{SplatRules, SplatSet, splats_of};
use crate::oriented::surface::WeldedSurface;
use crate::pack::polygons::ScreenPolygon;
use crate::progress::SilentProgress;
use glam::{DVec2, DVec3};

fn rules(degrees: f64) -> SplatRules {
    SplatRules {
        clip: Some(degrees.to_radians()),
        ..SplatRules::default()
    }
}

fn set_of(mesh: &Mesh, rules: &SplatRules) -> (WeldedSurface, SplatSet) {
    let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
    let set = splats_of(&surface, &[], rules);
    (surface, set)
}

/// Pixels of the silhouette that nothing drawn covers, and drawn ones more than a pixel outside of it.
fn pixels_beyond(surface: &WeldedSurface, set: &SplatSet, view: &View) -> [usize; 2] {
    let (width, height) = (view.width as usize, view.height as usize);
    let mut is_drawn = vec![false; width * height];
    let mut is_exact = vec![false; width * height];
    for splat in set.splats.iter().filter(|splat| splat.faces(view)) {
        let Some(seen) = ScreenPolygon::of(splat, view) else {
            continue;
        };
        mark(&seen.bounds(), view, &mut is_drawn, |at| {
            seen.sample(at).is_some()
        });
    }
    for face in 0..surface.faces.len() as u32 {
        let corners = surface.corners(face).map(|c| {
            let (x, y, _) = view.project(c.as_vec3());
            DVec2::new(x.into(), y.into())
        });
        let [a, b, c] = corners;
        let turn = (b - a).perp_dot(c - a).signum();
        let bounds = [a.min(b).min(c), a.max(b).max(c)];
        let is_inside = |at: DVec2| {
            [(a, b), (b, c), (c, a)]
                .iter()
                .all(|(p, q)| (*q - *p).perp_dot(at - *p) * turn >= 0.0)
        };
        mark(&bounds, view, &mut is_exact, is_inside);
        if set
            .triangles
            .contains(&surface.triangle_of_face[face as usize])
        {
            mark(&bounds, view, &mut is_drawn, is_inside);
        }
    }
    let pairs = || is_drawn.iter().zip(&is_exact);
    let bare = pairs().filter(|&(&drawn, &exact)| exact && !drawn).count();
    // Farther than a pixel from what is exact.
    let is_near = |k: usize| {
        let (x, y) = (k % width, k / width);
        (y.saturating_sub(1)..(y + 2).min(height))
            .any(|y| (x.saturating_sub(1)..(x + 2).min(width)).any(|x| is_exact[y * width + x]))
    };
    let beyond = (0..is_drawn.len())
        .filter(|&k| is_drawn[k] && !is_near(k))
        .count();
    [bare, beyond]
}

fn mark(bounds: &[DVec2; 2], view: &View, marks: &mut [bool], is_inside: impl Fn(DVec2) -> bool) {
    let clip = |x: f64, most: u32| x.clamp(0.0, f64::from(most)) as u32;
    let [low, high] = bounds;
    for y in clip(low.y.floor(), view.height)..clip(high.y.ceil(), view.height) {
        for x in clip(low.x.floor(), view.width)..clip(high.x.ceil(), view.width) {
            if is_inside(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)) {
                marks[(y * view.width + x) as usize] = true;
            }
        }
    }
}

/// Directions spread over the sphere.
fn views(mesh: &Mesh, count: u32) -> impl Iterator<Item = View> {
    let low = mesh
        .positions
        .iter()
        .fold(DVec3::INFINITY, |low, p| low.min(p.as_dvec3()));
    let high = mesh
        .positions
        .iter()
        .fold(DVec3::NEG_INFINITY, |high, p| high.max(p.as_dvec3()));
    let (center, radius) = ((low + high) / 2.0, (high - low).length() / 2.0);
    (0..count).map(move |k| {
        let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
        let azimuth = f64::from(k) * 2.399_963_229_728_653;
        Camera::orbit((250, 250), center, radius, azimuth, z.asin(), 0.9)
            .view(DVec3::ZERO)
            .unwrap()
    })
}

#[test]
fn a_cube_of_eight_vertices_is_a_cube() {
    let mesh = cube();
    let (surface, set) = set_of(&mesh, &rules(20.0));
    assert_eq!(
        (set.splats.len(), set.triangles.len()),
        (24, 0),
        "three quarters of discs a corner"
    );
    assert!(overhang(&surface, &set, &SilentProgress).most < 2e-4);
    assert_eq!(uncovered_share(&surface, &set, 200, 0.01), 0.0);
    let plain = set_of(&mesh, &SplatRules::default()).1;
    assert!(
        overhang(&surface, &plain, &SilentProgress).most > 0.5,
        "whole discs stand out"
    );
    let mut plain_beyond = 0;
    for view in views(&mesh, 100) {
        assert_eq!(pixels_beyond(&surface, &set, &view), [0, 0]);
        plain_beyond += pixels_beyond(&surface, &plain, &view)[1];
    }
    assert!(plain_beyond > 100_000, "{plain_beyond}");
}

#[test]
fn an_l_shape_is_cut_at_convex_and_concave_edges() {
    let mesh = l_shape();
    let (surface, set) = set_of(&mesh, &rules(20.0));
    // Where top and bottom have their reflex corner no half planes bound a splat: the four triangles around it are drawn,
    // which are the whole L. Its walls have two splats at each of 12 points.
    assert_eq!((set.triangles.len(), set.splats.len()), (8, 24));
    assert!(overhang(&surface, &set, &SilentProgress).most < 2e-4);
    assert_eq!(uncovered_share(&surface, &set, 200, 0.01), 0.0);
    for view in views(&mesh, 100) {
        assert_eq!(pixels_beyond(&surface, &set, &view), [0, 0]);
    }
}

#[test]
fn a_flat_grid_is_cut_along_its_border_alone() {
    let mesh = grid(6, |_, _| 0.0);
    let (surface, set) = set_of(&mesh, &rules(20.0));
    assert_eq!((set.splats.len(), set.triangles.len()), (49, 0));
    let over = overhang(&surface, &set, &SilentProgress).most;
    assert!(over < 1.1e-4, "{over} beyond the border");
    assert_eq!(uncovered_share(&surface, &set, 100, 0.01), 0.0);
    let radius = set.splats_of_point(24)[0].round_radius;
    assert!(
        (radius - 1.02 * 0.5f32.sqrt()).abs() < 1e-6,
        "half the diagonal covers"
    );
}

#[test]
fn a_ridge_of_any_angle_stays_within_r_tan_beta() {
    for degrees in [3.0_f64, 8.0, 15.0, 25.0, 40.0, 70.0] {
        let slope = degrees.to_radians().tan() as f32;
        let mesh = grid(6, |x, _| -(x - 3.0).abs() * slope);
        for spread in [5.0_f64, 20.0] {
            let (surface, set) = set_of(&mesh, &rules(spread));
            let over = overhang(&surface, &set, &SilentProgress);
            let bound = spread.to_radians().tan();
            assert!(
                over.most_of_radius <= bound + 1e-3,
                "{degrees} {spread}: {over:?}"
            );
            assert_eq!(uncovered_share(&surface, &set, 50, bound + 1e-6), 0.0);
        }
    }
}

#[test]
fn a_spread_of_zero_draws_what_is_not_flat_as_triangles() {
    let mesh = grid(5, |x, y| (x * 1.1 + 0.3).sin() * (y * 0.9 + 0.2).cos());
    let (_, set) = set_of(&mesh, &rules(0.0));
    // All but two at corners of the grid, whose points have three faces at most: a splat for each.
    assert_eq!(set.triangles.len(), 48);
    let flat = grid(5, |_, _| 0.0);
    assert_eq!(set_of(&flat, &rules(0.01)).1.triangles.len(), 0);
}

#[test]
fn half_the_side_leaves_holes_on_an_equilateral_grid() {
    // F3: 9.31 percent with half the side, none with the side over root three.
    let height = 3f32.sqrt() / 2.0;
    let mut mesh = grid(20, |_, _| 0.0);
    for p in &mut mesh.positions {
        *p = glam::Vec3::new(p.x + p.y * -0.5, p.y * height, 0.0);
    }
    let share = |radius| {
        let rules = SplatRules {
            radius,
            ..SplatRules::default()
        };
        let (surface, set) = set_of(&mesh, &rules);
        uncovered_share(&surface, &set, 400, 0.01)
    };
    let half = share(RadiusRule::Dietz50);
    assert!((half - 0.0931).abs() < 0.006, "{half}");
    assert_eq!(share(RadiusRule::Cover), 0.0);
    assert_eq!(share(RadiusRule::Dietz), 0.0);
}
