//! What is packed for filtered splats, against closed forms.

use glam::{DVec3, Vec3};
use surfel::abi::FilteredSplat;
use surfel::cut::{self, Cut, CutSelector};
use surfel::math::camera::{Camera, View};
use surfel::mesh::Mesh;
use surfel::pack::filtered::{FilteredShade, drawn_counts, splat_count, splats, take_triangles};
use surfel::pack::{ALBEDO, ColorBy};
use surfel::progress::SilentProgress;
use surfel::tree::{BuildOptions, Model, build};

/// A grid of n by n unit cells in the plane z = 0.
fn grid(n: u32) -> Mesh {
    let at = |i: u32| Vec3::new((i % (n + 1)) as f32, (i / (n + 1)) as f32, 0.0);
    let cell = |i: u32| {
        let a = i / n * (n + 1) + i % n;
        [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    };
    Mesh {
        positions: (0..(n + 1) * (n + 1)).map(at).collect(),
        triangles: (0..n * n).flat_map(cell).collect(),
        ..Mesh::default()
    }
}

fn model(mesh: Mesh) -> Model {
    build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// Facing the middle of a grid of 40 cells from such a distance that a unit is `unit_px` pixels there.
fn facing(unit_px: f64) -> View {
    let size = 800.0;
    let distance = size / (2.0 * 0.5f64.tan()) / unit_px;
    let target = DVec3::new(20.0, 20.0, 0.0);
    let eye = target + DVec3::Z * distance;
    let range = [0.1, 2.0 * distance];
    Camera::look_at((800, 800), eye, target, DVec3::Y, 1.0, range)
        .view(DVec3::ZERO)
        .unwrap()
}

const SHADE: FilteredShade = FilteredShade {
    side_px: 1.0,
    max_size_px: 64.0,
    splats_only: false,
    depth_offset: 3.0,
    cull_back: false,
    use_colors: true,
    color_by: ColorBy::Shading,
    depth_range: [0.0, 1.0],
    light: surfel::pack::SurfaceLighting::Headlight,
    cut_view: None,
};

/// The splats of a model, and how many triangles are left.
fn packed(model: &Model, view: &View, shade: FilteredShade) -> (Vec<FilteredSplat>, usize) {
    let mut cut = Cut::default();
    let settings = cut::CutSettings {
        threshold_px: 1.0,
        ..cut::CutSettings::default()
    };
    CutSelector::default().select(model, view, &settings, &mut cut);
    let foreseen = drawn_counts(model, view, &shade, &cut);
    let large = take_triangles(model, view, &shade, &mut cut);
    assert_eq!(foreseen, [splat_count(&cut, large), cut.triangles.len()]);
    let mut out = vec![bytemuck::Zeroable::zeroed(); splat_count(&cut, large)];
    let len = splats(model, &cut, large, view, shade, &mut out);
    out.truncate(len);
    (out, cut.triangles.len())
}

#[test]
fn areas_add_up_to_that_of_a_plane() {
    let mesh = grid(40);
    let only = FilteredShade {
        splats_only: true,
        ..SHADE
    };
    // A cell of half a pixel (nodes), of one (leaves), of 1.5 (in pieces), and of nine (splats only).
    for (unit_px, shade) in [(0.5, SHADE), (1.0, SHADE), (1.5, SHADE), (9.0, only)] {
        let (splats, triangles) = packed(&model(mesh.clone()), &facing(unit_px), shade);
        let area: f64 = splats.iter().map(|s| f64::from(s.area_px)).sum();
        let expected = (40.0 * unit_px).powi(2);
        assert_eq!(triangles, 0, "{unit_px}");
        assert!(
            (area / expected - 1.0).abs() < 2e-3,
            "{unit_px}: {area} {expected}"
        );
        for splat in &splats {
            // The cosine toward the corners of the picture is 0.94.
            assert!((0.93 * ALBEDO..=ALBEDO).contains(&splat.color[0]));
            let ([width, height], side) = (splat.extent_px, splat.side_px);
            assert!(width > 0.0 && height > 0.0 && side >= 1.0);
            assert!(width <= side && height <= side, "{splat:?}");
        }
    }
    // Larger than the device draws: as large as it draws.
    let (splats, _) = packed(&model(mesh), &facing(300.0), only);
    assert!(!splats.is_empty());
    assert!(
        splats
            .iter()
            .all(|s| s.extent_px == [62.0; 2] && s.side_px == 62.0)
    );
}

#[test]
fn points_stand_for_the_area_between_them() {
    // Of an inner point of a square grid the sixth neighbor is at the diagonal: pi / 6 times 2 cells.
    let mut mesh = grid(40);
    mesh.triangles.clear();
    for normals in [Vec::new(), vec![Vec3::Z; mesh.positions.len()]] {
        let cloud = Mesh {
            normals,
            ..mesh.clone()
        };
        for unit_px in [0.3, 1.0, 8.0] {
            let (splats, _) = packed(&model(cloud.clone()), &facing(unit_px), SHADE);
            let area: f64 = splats.iter().map(|s| f64::from(s.area_px)).sum();
            let inner = (41.0 * unit_px).powi(2) * std::f64::consts::PI / 3.0;
            // Points at the edge have their neighbors farther away.
            let share = area / inner;
            assert!((0.99..1.25).contains(&share), "{unit_px}: {share}");
            let lit = |s: &FilteredSplat| (0.93 * ALBEDO..=ALBEDO).contains(&s.color[0]);
            assert!(splats.iter().all(lit));
            if unit_px == 8.0 {
                // No gap: every square reaches its neighbors.
                assert_eq!(splats.len(), 41 * 41);
                assert!(splats.iter().all(|s| s.side_px > 16.0));
            }
        }
    }
}

#[test]
fn triangles_are_splats_where_nearly_all_are_small() {
    let fine = grid(40);
    let count = fine.triangles.len();
    // The diagonal of a cell is 1.4 units.
    let (_, triangles) = packed(&model(fine.clone()), &facing(2.0), SHADE);
    assert_eq!(triangles, 0);
    let (splats, triangles) = packed(&model(fine.clone()), &facing(2.3), SHADE);
    assert_eq!((splats.len(), triangles), (0, count));
    // Some large ones beside stay triangles; with more of them all do.
    for (copies, expected) in [(count / 20, count / 20), (count / 5, count + count / 5)] {
        let mut mesh = fine.clone();
        let first = mesh.positions.len() as u32;
        mesh.positions
            .extend([Vec3::ZERO, Vec3::X * 30.0, Vec3::Y * 30.0]);
        mesh.triangles
            .extend(vec![[first, first + 1, first + 2]; copies]);
        let (_, triangles) = packed(&model(mesh), &facing(2.0), SHADE);
        assert_eq!(triangles, expected);
    }
}

#[test]
fn a_few_larger_triangles_are_splats_in_as_many_pieces_as_it_takes() {
    let fine = grid(40);
    let count = fine.triangles.len();
    // Ten pixels wide: 64 pieces of 1.2.
    for (copies, is_taken) in [(1, true), (count / 64, true), (count / 64 + 1, false)] {
        let mut mesh = fine.clone();
        let first = mesh.positions.len() as u32;
        (mesh.positions).extend([Vec3::ZERO, Vec3::X * 7.0, Vec3::Y * 7.0]);
        mesh.triangles
            .extend(vec![[first, first + 1, first + 2]; copies]);
        let (splats, triangles) = packed(&model(mesh), &facing(1.0), SHADE);
        let expected = match is_taken {
            true => (count + 64 * copies, 0),
            false => (count, copies),
        };
        assert_eq!((splats.len(), triangles), expected);
        let area: f64 = splats.iter().map(|s| f64::from(s.area_px)).sum();
        let taken = if is_taken { copies } else { 0 };
        let wanted = 1600.0 + 24.5 * taken as f64;
        assert!((area / wanted - 1.0).abs() < 2e-3, "{area} {wanted}");
    }
}
