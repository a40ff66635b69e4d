#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use super::*;
use crate::mesh::Mesh;
use crate::oriented::nearest::FaceBoxes;
use crate::oriented::shapes::{cube, grid, l_shape};
use crate::progress::SilentProgress;
use std::sync::atomic::{AtomicU64, Ordering};

fn sampled(
    mesh: &Mesh,
    pattern: SamplePattern,
    spacing: f64,
) -> (WeldedSurface, Vec<OrientedPolygon>) {
    let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
    let rules = SampleRules {
        pattern,
        spacing,
        crease: 0.3,
    };
    let splats = samples_of(&surface, &[], &rules, &SilentProgress).unwrap();
    (surface, splats)
}

/// The share of places on the surface that no splat holds, by other places than those that are filled.
fn bare(surface: &WeldedSurface, splats: &[OrientedPolygon]) -> f64 {
    let mut numbers = DartNumbers(77);
    let (mut all, mut bare) = (0, 0);
    for face in 0..surface.faces.len() as u32 {
        let normal = surface.normals[face as usize];
        for _ in 0..300 {
            let at = place_in(surface.corners(face), numbers.next(), numbers.next());
            let is_covered = splats.iter().any(|splat| {
                let from = at - splat.center.as_dvec3();
                let [u, v] =
                    [splat.axis, splat.second_axis()].map(|a| from.dot(a.as_dvec3()) as f32);
                splat.normal.as_dvec3().dot(normal) > 0.9
                    && from.dot(normal).abs() < 1e-3
                    && splat.contains([u, v])
            });
            all += 1;
            bare += usize::from(!is_covered);
        }
    }
    bare as f64 / f64::from(all)
}

#[test]
fn a_lattice_covers_exactly_and_stays_within_edges() {
    for mesh in [cube(), l_shape()] {
        let (surface, splats) = sampled(&mesh, SamplePattern::Lattice, 0.3);
        let expected: usize = (0..surface.faces.len() as u32)
            .map(|f| (longest_side(surface.corners(f)) / 0.3).ceil() as usize)
            .map(|n| n * n)
            .sum();
        assert_eq!(splats.len(), expected);
        assert_eq!(bare(&surface, &splats), 0.0);
    }
    let (surface, splats) = sampled(&cube(), SamplePattern::Lattice, 0.3);
    let boxes = FaceBoxes::new(&surface);
    let far = splats.iter().flat_map(|s| {
        s.footprint().iter().map(|&c| {
            let c = DVec2::from(c.map(f64::from)).clamp_length_max(s.round_radius.into());
            boxes.distance(s.point(c.as_vec2().to_array()).as_dvec3())
        })
    });
    assert!(far.fold(0.0, f64::max) < 1e-4);
}

#[test]
fn poisson_discs_keep_their_distance_and_have_the_density_of_random_packing() {
    let mesh = grid(20, |_, _| 0.0);
    let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
    let rules = SampleRules {
        pattern: SamplePattern::Poisson,
        spacing: 0.5,
        crease: 0.3,
    };
    let mut samples = empty(&surface, &rules);
    darts(&mut samples, 400.0).unwrap();
    let darts = samples.splats.len();
    for (i, a) in samples.splats.iter().enumerate() {
        let near = samples.splats[..i]
            .iter()
            .any(|b| a.center.distance(b.center) < 0.4999);
        assert!(!near);
    }
    // 0.70 area / spacing² at jamming; 12 darts a sample leave some room.
    let density = darts as f64 * 0.25 / 400.0;
    assert!((0.57..0.70).contains(&density), "{density}");
    samples.each_face("", fill).unwrap();
    assert!(samples.splats.len() < darts * 5 / 4);
    assert!(bare(&surface, &samples.splats) < 1e-3);
}

#[test]
fn rays_meet_every_face_and_gaps_are_filled() {
    for mesh in [cube(), l_shape()] {
        let (surface, splats) = sampled(&mesh, SamplePattern::Rays, 0.13);
        assert!(bare(&surface, &splats) < 1e-3);
        let area: f64 = surface.areas.iter().sum();
        let density = splats.len() as f64 * 0.13 * 0.13 / area;
        assert!((0.8..1.4).contains(&density), "{density}");
    }
    // Small steep faces, between whose rays there is room.
    let steep = grid(12, |x, y| 1.3 * ((x * 1.9).sin() + (y * 1.7).cos()));
    let surface = WeldedSurface::new(&steep.positions, &steep.triangles);
    let rules = SampleRules {
        pattern: SamplePattern::Rays,
        spacing: 0.9,
        crease: 0.3,
    };
    let mut samples = empty(&surface, &rules);
    samples.each_face("", rays).unwrap();
    let before = bare(&surface, &samples.splats);
    samples.each_face("", fill).unwrap();
    let after = bare(&surface, &samples.splats);
    let all = samples_of(&surface, &[], &rules, &SilentProgress).unwrap();
    assert!(before > 0.05 && after < before / 10.0, "{before} {after}");
    assert_eq!(all, samples.splats, "both steps, in this order");
}

fn empty<'a>(surface: &'a WeldedSurface, rules: &'a SampleRules) -> PlacedSamples<'a> {
    PlacedSamples {
        surface,
        looks: &[],
        rules,
        progress: &SilentProgress,
        splats: Vec::new(),
        cells: HashMap::new(),
    }
}

/// Cancels once it was asked so many times.
struct CancelledSoon(AtomicU64);

impl Progress for CancelledSoon {
    fn stage(&self, _name: &str, _total: u64) {}
    fn advance(&self, _amount: u64) {}
    fn is_cancelled(&self) -> bool {
        self.0.fetch_add(1, Ordering::Relaxed) >= 1
    }
}

#[test]
fn there_are_never_too_many_and_the_making_ends_when_it_is_asked_to() {
    let mesh = grid(16, |_, _| 0.0);
    let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
    let bounds = SampleBounds::of(|v| mesh.positions.get(v as usize).copied(), &mesh.triangles);
    for pattern in [
        SamplePattern::Lattice,
        SamplePattern::Poisson,
        SamplePattern::Rays,
    ] {
        let choice = |spacing| SampleChoice { pattern, spacing };
        let usual = bounds.rules(&choice(None), 0.3).unwrap();
        assert!((usual.spacing - 2f64.sqrt()).abs() < 1e-6);
        let soon = CancelledSoon(AtomicU64::new(0));
        let ended = samples_of(&surface, &[], &usual, &soon);
        assert_eq!(ended.err(), Some(SampleError::Cancelled), "{pattern:?}");
        let Err(SampleError::TooMany { count, enough, .. }) =
            bounds.rules(&choice(Some(1e-3)), 0.3)
        else {
            panic!("{pattern:?}: far too many");
        };
        assert!(
            count > 1e6 && (0.03..0.2).contains(&enough),
            "{count} {enough}"
        );
        assert!(bounds.rules(&choice(Some(enough)), 0.3).is_ok());
        // What bounds say is an upper bound.
        let rules = bounds.rules(&choice(Some(0.5)), 0.3).unwrap();
        let made = samples_of(&surface, &[], &rules, &SilentProgress)
            .unwrap()
            .len() as f64;
        let most = bounds.most_samples(pattern, 0.5);
        assert!(
            made <= most && made > most / 4.0,
            "{pattern:?}: {made} of {most}"
        );
    }
}

#[test]
fn many_faces_get_a_coarser_spacing_and_too_many_are_refused() {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let bounds = |count: usize| {
        SampleBounds::of(
            |v| corners.get(v as usize).copied(),
            &vec![[0, 1, 2]; count],
        )
    };
    let choice = SampleChoice {
        pattern: SamplePattern::Lattice,
        spacing: None,
    };
    let of = |count| bounds(count).rules(&choice, 0.3);
    // Four parts a face at the usual spacing and below.
    assert!((of(1000).unwrap().spacing - 2f64.sqrt()).abs() < 1e-6);
    assert!(of(100_000).unwrap().spacing > 2.0);
    assert_eq!(of(250_000), Err(SampleError::Faces(250_000)));
    let error = of(250_000).unwrap_err().to_string();
    assert!(error.contains("without --resample"), "{error}");
}

#[test]
fn spacings_that_are_none_are_refused() {
    let mesh = cube();
    let surface = WeldedSurface::new(&mesh.positions, &mesh.triangles);
    for pattern in [
        SamplePattern::Lattice,
        SamplePattern::Poisson,
        SamplePattern::Rays,
    ] {
        for spacing in [0.0, -1.0, f64::NAN, 1e-9] {
            let rules = SampleRules {
                pattern,
                spacing,
                crease: 0.3,
            };
            assert!(
                samples_of(&surface, &[], &rules, &SilentProgress).is_err(),
                "{spacing}"
            );
        }
    }
    let none = WeldedSurface::default();
    let rules = SampleRules {
        pattern: SamplePattern::Poisson,
        spacing: 1.0,
        crease: 0.3,
    };
    assert_eq!(
        samples_of(&none, &[], &rules, &SilentProgress),
        Ok(Vec::new())
    );
}
