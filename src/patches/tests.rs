//! What patches promise, on whole models: no hole, no growth beyond twice the tolerance, gaps that stay open.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use super::check::violation;
use super::*;
use crate::cut::{Cut, CutSelector, CutSettings};
use crate::image::Image;
use crate::math::camera::{Camera, View};
use crate::math::octahedral;
use crate::mesh::Mesh;
use crate::progress::SilentProgress;
use crate::tree::{self, BuildOptions, Model, PackedPatch, PackedPatchColors};
use glam::{DVec2, DVec3, Vec2, Vec3};

/// A generated model, such as `sphere:1000`.
pub(super) fn model_of(spec: &str) -> Model {
    of_mesh(crate::generate::mesh(&spec.parse().unwrap()))
}

/// The tree of a mesh.
pub(super) fn of_mesh(mesh: Mesh) -> Model {
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// A sheet of `columns` times `rows` cells over (x, y) from 0 to 1, two triangles each; without those that `is_hole` names.
pub(super) fn sheet(
    [columns, rows]: [u32; 2],
    place: impl Fn(f32, f32) -> Vec3,
    is_hole: impl Fn(u32, u32) -> bool,
) -> Mesh {
    let mut mesh = Mesh::default();
    for y in 0..=rows {
        for x in 0..=columns {
            (mesh.positions).push(place(x as f32 / columns as f32, y as f32 / rows as f32));
        }
    }
    for y in 0..rows {
        for x in 0..columns {
            if !is_hole(x, y) {
                let a = y * (columns + 1) + x;
                let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    mesh
}

/// A box of finely cut faces, as wide as 1 along x and y.
fn plate(cells: u32, thickness: f32) -> Mesh {
    let mut all = Mesh::default();
    let mut add = |counts: [u32; 2], place: &dyn Fn(f32, f32) -> Vec3| {
        let part = sheet(counts, place, |_, _| false);
        let first = all.positions.len() as u32;
        all.positions.extend(part.positions);
        (all.triangles).extend(
            part.triangles
                .iter()
                .map(|t| t.map(|corner| corner + first)),
        );
    };
    let t = thickness;
    add([cells, cells], &|x, y| Vec3::new(x, y, t));
    add([cells, cells], &|x, y| Vec3::new(y, x, 0.0));
    add([cells, 1], &|x, z| Vec3::new(x, 0.0, z * t));
    add([cells, 1], &|x, z| Vec3::new(1.0 - x, 1.0, z * t));
    add([cells, 1], &|y, z| Vec3::new(1.0, y, z * t));
    add([cells, 1], &|y, z| Vec3::new(0.0, 1.0 - y, z * t));
    all
}

fn random(state: &mut u64) -> f32 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    ((*state >> 40) as f32) / (1u64 << 24) as f32
}

/// A view from anywhere around the model, at a random distance.
pub(super) fn view_from_anywhere(model: &Model, side: u32, state: &mut u64) -> View {
    let azimuth = f64::from(random(state)) * std::f64::consts::TAU;
    let elevation = (f64::from(random(state)) * 2.0 - 1.0).asin();
    let fill = 2f64.powf(f64::from(random(state)) * 5.0 - 3.0);
    let camera = model.orbit_camera((side, side), azimuth, elevation, fill);
    camera.view(model.origin).unwrap()
}

pub(super) fn settings_of(model: &Model, tolerances: ErrorTolerances) -> PatchCutSettings {
    PatchCutSettings {
        cut: CutSettings {
            cull_back: model.is_closed,
            ..CutSettings::default()
        },
        tolerances,
        ..PatchCutSettings::default()
    }
}

pub(super) fn tolerances(rim_px: f32, inside_px: f32, shade_levels: f32) -> ErrorTolerances {
    ErrorTolerances {
        rim_px,
        inside_px,
        shade_levels,
    }
}

/// A model with its records.
pub(super) struct PatchedModel {
    pub(super) model: Model,
    pub(super) patches: NodePatches,
}

impl PatchedModel {
    pub(super) fn new(model: Model) -> Self {
        let patches = build(&model, &SilentProgress).unwrap();
        Self { model, patches }
    }

    pub(super) fn cut(&self, view: &View, settings: &PatchCutSettings) -> PatchCut {
        self.cut_by(view, settings, false)
    }

    fn cut_by(&self, view: &View, settings: &PatchCutSettings, is_strict: bool) -> PatchCut {
        let conditions = PatchConditions::new(&self.model, &self.patches, is_strict);
        let mut cut = PatchCut::default();
        select(&self.model, &conditions, view, settings, &mut cut);
        cut
    }

    fn draw(&self, cut: &PatchCut, view: &View, margin: f64) -> Image {
        let style = PatchStyle {
            margin,
            ..PatchStyle::default()
        };
        draw(&self.model, &self.patches, cut, view, &style).image
    }

    /// The records, packed and unpacked.
    fn packed(&self) -> Vec<NodePatch> {
        let nodes = self.model.tree.nodes.iter().zip(&self.patches.records);
        nodes
            .map(|(node, patch)| {
                let colors = PackedPatchColors::new(node, patch);
                PackedPatch::new(node, patch).unpack(node, Some(&colors))
            })
            .collect()
    }

    fn exact(&self, view: &View) -> Image {
        draw_triangles(&self.model, view, &PatchStyle::default()).image
    }
}

/// Indices of pixels that the first picture covers and the second does not.
pub(super) fn uncovered(by: &Image, other: &Image) -> Vec<usize> {
    let pixels = 0..by.color.len();
    pixels
        .filter(|&i| by.color[i][3] > 0 && other.color[i][3] == 0)
        .collect()
}

/// Asserts what a record says of the corners below its node.
fn assert_corners_within(model: &Model, patches: &NodePatches) {
    let mut drawn = 0;
    for (node, patch) in (0u32..).zip(&patches.records) {
        if !patch.may_be_drawn() {
            continue;
        }
        drawn += 1;
        assert_eq!(violation(model, node, patch, 1e-9), None, "{patch:?}");
    }
    assert!(
        drawn * 10 > patches.records.len() * 7,
        "{drawn} of {}",
        patches.records.len()
    );
}

#[test]
fn every_corner_lies_within_the_record_of_each_node_above_it() {
    let wavy = |x: f32, y: f32| Vec3::new(x, y, 0.02 * (x * 40.0).sin() * (y * 25.0).cos());
    let far = |x: f32, y: f32| Vec3::new(x + 900.0, y, 0.01 * (x * 9.0).sin());
    for model in [
        model_of("sphere:3000"),
        model_of("torus:4000"),
        model_of("statue:6000"),
        of_mesh(sheet([40, 30], wavy, |x, y| (x * y) % 5 == 0)),
        of_mesh(sheet([40, 30], far, |_, _| false)),
        of_mesh(sheet([16, 16], |x, y| Vec3::new(x, y, 0.0), |_, _| false)),
    ] {
        let patched = PatchedModel::new(model);
        assert_eq!(
            patched.patches.records.len(),
            patched.model.tree.nodes.len()
        );
        assert_corners_within(&patched.model, &patched.patches);
    }
}

#[test]
fn records_do_not_depend_on_the_number_of_threads() {
    let model = model_of("statue:20000");
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| build(&model, &SilentProgress).unwrap())
    };
    assert_eq!(of(1), of(3));
}

#[test]
fn without_tolerance_the_cut_is_that_by_size() {
    let mut state = 11;
    let needles = |x: f32, y: f32| Vec3::new(x * 300.0, y, 0.0);
    let mut kinds = [0; 4];
    for model in [
        model_of("sphere:20000"),
        model_of("statue:20000"),
        of_mesh(sheet([20, 200], needles, |_, _| false)),
    ] {
        let patched = PatchedModel::new(model);
        for round in 0..24 {
            let view = view_from_anywhere(&patched.model, 200, &mut state);
            // Nothing is as exact as 0; a negative number takes the other selector.
            let none = [tolerances(0.0, 0.0, 0.0), ErrorTolerances::NONE][round % 2];
            let mut settings = settings_of(&patched.model, none);
            settings.cut.threshold_px = [1.0, 0.3, 4.0][round % 3];
            settings.cut.cull_frustum = round % 4 != 0;
            let mut expected = Cut::default();
            let mut selector = CutSelector::with_threads(1);
            selector.select(&patched.model, &view, &settings.cut, &mut expected);
            let found = patched.cut(&view, &settings);
            assert_eq!(found.rest, expected, "round {round}");
            assert!(found.patches.is_empty() && found.tiny.is_empty());
            let lengths =
                [&found.rest.nodes, &found.rest.leaves, &found.rest.triangles].map(Vec::len);
            kinds[0] += found.rest.strips.len();
            kinds[1..]
                .iter_mut()
                .zip(lengths)
                .for_each(|(kind, length)| *kind += length);
        }
    }
    assert!(kinds.iter().all(|&kind| kind > 500), "{kinds:?}");
}

/// The proof says none; without the margin there are many.
#[test]
fn no_pixel_of_a_closed_surface_is_missed_in_a_thousand_views() {
    let mut state = 5;
    let mut without = 0;
    for spec in ["sphere:4000", "torus:4000", "statue:8000"] {
        let patched = PatchedModel::new(model_of(spec));
        for round in 0..336 {
            let view = view_from_anywhere(&patched.model, 64, &mut state);
            let loose = [(0.15, 0.25, 24.0), (0.5, 0.5, 60.0), (1.0, 1.0, 60.0)][round % 3];
            let mut settings = settings_of(&patched.model, tolerances(loose.0, loose.1, loose.2));
            settings.tiny_polygons = round % 2 == 1;
            let cut = patched.cut(&view, &settings);
            let exact = patched.exact(&view);
            let missed = uncovered(&exact, &patched.draw(&cut, &view, 1.0));
            assert!(
                missed.is_empty(),
                "{spec}, round {round}: {} pixels",
                missed.len()
            );
            if round % 8 == 0 {
                without += uncovered(&exact, &patched.draw(&cut, &view, 0.0)).len();
            }
        }
    }
    assert!(without > 100, "{without}");
}

/// Distance of a window position from the nearest triangle on the picture, pixels.
fn distance_px(model: &Model, view: &View, at: DVec2) -> f64 {
    let place = |corner: u32| {
        let (x, y, _) = view.project(model.vertices[corner as usize].position);
        DVec2::new(x.into(), y.into())
    };
    let mut nearest = f64::INFINITY;
    for triangle in &model.triangles {
        let corners = triangle.map(place);
        for i in 0..3 {
            let [from, to] = [corners[i], corners[(i + 1) % 3]];
            let edge = to - from;
            let along = (at - from).dot(edge) / edge.length_squared().max(1e-30);
            nearest = nearest.min(at.distance(from + edge * along.clamp(0.0, 1.0)));
        }
    }
    nearest
}

#[test]
fn silhouettes_grow_by_at_most_twice_the_tolerance() {
    let mut state = 21;
    let mut grown = 0;
    for spec in ["sphere:4000", "torus:4000", "statue:4000"] {
        let patched = PatchedModel::new(model_of(spec));
        for round in 0..60 {
            let view = view_from_anywhere(&patched.model, 96, &mut state);
            let rim_px = [0.15, 0.5, 1.0][round % 3];
            let settings = settings_of(&patched.model, tolerances(rim_px, rim_px, 60.0));
            let mut cut = patched.cut(&view, &settings);
            assert_eq!(cut.sizes.iter().sum::<u64>(), cut.patches.len() as u64);
            // Squares and triangles have bounds of their own.
            cut.rest.clear();
            let exact = patched.exact(&view);
            for index in uncovered(&patched.draw(&cut, &view, 1.0), &exact) {
                let at = DVec2::new((index % 96) as f64 + 0.5, (index / 96) as f64 + 0.5);
                let distance = distance_px(&patched.model, &view, at);
                assert!(
                    distance <= 2.0 * f64::from(rim_px) + 0.02,
                    "{spec}, round {round}: {distance}"
                );
                grown += 1;
            }
        }
    }
    assert!(grown > 100, "{grown}");
}

/// Looks at the middle of a sheet of side 1, in `side` pixels.
fn view_of_sheet(side: u32, toward: DVec3) -> View {
    let middle = DVec3::new(0.5, 0.5, 0.0);
    let eye = middle + toward.normalize() * 2.0;
    let up = if toward.x == 0.0 && toward.y == 0.0 {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let camera = Camera::look_at((side, side), eye, middle, up, 0.6, [0.1, 10.0]);
    camera.view(DVec3::ZERO).unwrap()
}

/// Coplanar pieces with gaps: the thickness does not see them, the overhang does.
#[test]
fn holes_and_gaps_stay_open() {
    let flat = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let holes = sheet([60, 60], flat, |x, y| x % 6 < 2 && y % 6 < 2);
    let strips = sheet([64, 64], flat, |x, _| x / 4 % 2 == 1);
    for (name, mesh, allowed) in [("plate with holes", holes, 3), ("strips", strips, 3)] {
        let mut patched = PatchedModel::new(of_mesh(mesh));
        let (mut with, mut without, mut polygons) = (0, 0, 0);
        for toward in [
            DVec3::Z,
            DVec3::new(0.3, 0.2, 1.0),
            DVec3::new(1.0, 0.5, 0.6),
        ] {
            let view = view_of_sheet(300, toward);
            let settings = settings_of(&patched.model, ErrorTolerances::default());
            let exact = patched.exact(&view);
            let cut = patched.cut(&view, &settings);
            polygons += cut.patches.len();
            let drawn = patched.draw(&cut, &view, 1.0);
            assert!(uncovered(&exact, &drawn).is_empty(), "{name}");
            with += uncovered(&drawn, &exact).len();
            let kept: Vec<f32> = patched.patches.records.iter().map(|p| p.overhang).collect();
            patched
                .patches
                .records
                .iter_mut()
                .for_each(|p| p.overhang = 0.0);
            let drawn = patched.draw(&patched.cut(&view, &settings), &view, 1.0);
            without += uncovered(&drawn, &exact).len();
            let records = patched.patches.records.iter_mut();
            records
                .zip(kept)
                .for_each(|(p, overhang)| p.overhang = overhang);
        }
        assert!(with <= allowed, "{name}: {with}");
        assert!(without > 3000, "{name}: {without}");
        assert!(polygons > 100, "{name}: {polygons}");
    }
}

/// Both sheets of a plate lie in a pixel: nodes that mix them are no patches, and no pixel is missed or dark.
#[test]
fn thin_plates_keep_both_sides_apart() {
    for thickness in [0.004, 0.001, 1e-5] {
        let patched = PatchedModel::new(of_mesh(plate(64, thickness)));
        assert!(patched.model.is_closed);
        for toward in [
            DVec3::Z,
            -DVec3::Z,
            DVec3::new(0.4, 1.0, 0.3),
            DVec3::new(1.0, 0.1, 0.02),
        ] {
            let view = view_of_sheet(256, toward);
            let cut = patched.cut(
                &view,
                &settings_of(&patched.model, ErrorTolerances::default()),
            );
            let (drawn, exact) = (patched.draw(&cut, &view, 1.0), patched.exact(&view));
            assert!(
                uncovered(&exact, &drawn).is_empty(),
                "{thickness}, {toward}"
            );
            let differ = |i: &usize| {
                let off = drawn.values[*i][0] - exact.values[*i][0];
                exact.color[*i][3] > 0 && off.abs() > 16.0 / 255.0
            };
            let off = (0..exact.color.len()).filter(differ).count();
            assert!(
                off * 200 <= exact.covered_pixels() as usize,
                "{thickness}, {toward}: {off}"
            );
        }
    }
}

#[test]
fn a_wavy_sheet_seen_along_itself_has_no_hole_and_few_pixels_more() {
    let wave = |x: f32, y: f32| Vec3::new(x, y, 0.01 * (x * 31.0).sin() * (y * 23.0).cos());
    let patched = PatchedModel::new(of_mesh(sheet([200, 200], wave, |_, _| false)));
    let elevation = 2f64.to_radians();
    let view = view_of_sheet(300, DVec3::new(0.6, 0.8, elevation.tan()));
    let cut = patched.cut(
        &view,
        &settings_of(&patched.model, ErrorTolerances::default()),
    );
    let (drawn, exact) = (patched.draw(&cut, &view, 1.0), patched.exact(&view));
    assert!(
        cut.patches.len() * 10 > cut.primitives() * 8,
        "{}",
        cut.primitives()
    );
    assert!(cut.rest.stats.visited < 16_000, "{:?}", cut.rest.stats);
    assert!(uncovered(&exact, &drawn).is_empty());
    let more = uncovered(&drawn, &exact);
    for &index in &more {
        let at = DVec2::new((index % 300) as f64 + 0.5, (index / 300) as f64 + 0.5);
        // A patch that is no silhouette itself may reach over one by the larger tolerance.
        assert!(distance_px(&patched.model, &view, at) <= 2.0 * 0.25 + 0.02);
    }
    let squares = |image: &Image| -> f32 {
        let both = image.values.iter().zip(&exact.values);
        both.filter(|(_, exact)| exact[3] > 0.0)
            .map(|(own, exact)| (own[0] - exact[0]).powi(2))
            .sum()
    };
    let rms = |image: &Image| (squares(image) / exact.covered_pixels() as f32).sqrt() * 255.0;
    assert!(rms(&drawn) < 12.0, "{}", rms(&drawn));
}

/// With the largest residual the shade is bounded at every corner below a patch.
#[test]
fn the_strict_shade_is_a_bound_at_every_corner() {
    let mut state = 31;
    let (mut checked, mut worst) = (0, 0.0f32);
    for spec in ["sphere:20000", "torus:20000", "statue:20000"] {
        let patched = PatchedModel::new(model_of(spec));
        for levels in [8.0, 24.0, 60.0] {
            for _ in 0..6 {
                let view = view_from_anywhere(&patched.model, 400, &mut state);
                let settings = settings_of(&patched.model, tolerances(2.0, 0.25, levels));
                for &node in &patched.cut_by(&view, &settings, true).patches {
                    let patch = &patched.patches.records[node as usize];
                    for leaf in patched.model.tree.leaf_range(node) {
                        for corner in patched.model.triangles[leaf as usize] {
                            let vertex = &patched.model.vertices[corner as usize];
                            let to_light = (view.eye - vertex.position).normalize();
                            let offset = vertex.position - patch.origin;
                            let foot =
                                Vec2::new(offset.dot(patch.axis), offset.dot(patch.second_axis()));
                            let own = octahedral::decode(vertex.normal).dot(to_light);
                            let fitted = patch.sigma * patch.shading_normal(foot).dot(to_light);
                            let off = FULL_LEVELS * (own - fitted).abs();
                            worst = worst.max(off / levels);
                            checked += 1;
                        }
                    }
                }
            }
        }
    }
    assert!(worst <= 1.0, "{worst}");
    assert!(worst > 0.5 && checked > 10_000, "{worst} {checked}");
}

#[test]
fn clouds_and_models_without_nodes_have_no_records() {
    let mut mesh = sheet([4, 4], |x, y| Vec3::new(x, y, 0.0), |_, _| false);
    mesh.triangles.clear();
    let one = sheet([1, 1], |x, y| Vec3::new(x, y, 0.0), |_, _| false);
    let one = Mesh {
        triangles: one.triangles[..1].to_vec(),
        ..one
    };
    for (mesh, leaves, triangles) in [(mesh, 25, 0), (one, 0, 1), (Mesh::default(), 0, 0)] {
        let patched = PatchedModel::new(of_mesh(mesh));
        assert_eq!(patched.patches, NodePatches::default());
        let view = view_of_sheet(100, DVec3::Z);
        let cut = patched.cut(
            &view,
            &settings_of(&patched.model, ErrorTolerances::default()),
        );
        let small = cut.rest.nodes.len() + cut.rest.leaves.len();
        assert_eq!((small, cut.rest.triangles.len()), (leaves, triangles));
    }
}

/// Packed records keep every promise: each corner lies within them, and they miss no pixel.
#[test]
fn packed_records_are_at_least_as_large() {
    let mut state = 41;
    for spec in ["sphere:8000", "torus:8000", "statue:8000"] {
        let mut patched = PatchedModel::new(model_of(spec));
        let packed = patched.packed();
        for (node, (full, packed)) in patched.patches.records.iter().zip(&packed).enumerate() {
            assert_eq!(
                full.may_be_drawn(),
                packed.may_be_drawn(),
                "{spec}, node {node}"
            );
            if full.may_be_drawn() {
                assert_eq!((full.normal, full.axis), (packed.normal, packed.axis));
                assert_eq!(full.flags, packed.flags);
                assert!(full.thickness <= packed.thickness && full.overhang <= packed.overhang);
                assert!(full.half_angle <= packed.half_angle);
                assert!(full.largest_residual <= packed.largest_residual);
                let levels = full.residuals.iter().zip(packed.residuals);
                assert!(levels.into_iter().all(|(full, packed)| *full <= packed));
                assert!((full.sigma - packed.sigma).abs() < 0.002);
                let at = full.half_extents * 0.5;
                let angle = full
                    .shading_normal(at)
                    .angle_between(packed.shading_normal(at));
                assert!(angle < 0.02, "{spec}, node {node}: {angle}");
            }
        }
        patched.patches.records = packed;
        assert_corners_within(&patched.model, &patched.patches);
        for _ in 0..60 {
            let view = view_from_anywhere(&patched.model, 64, &mut state);
            let cut = patched.cut(
                &view,
                &settings_of(&patched.model, tolerances(0.5, 0.5, 60.0)),
            );
            let missed = uncovered(&patched.exact(&view), &patched.draw(&cut, &view, 1.0));
            assert!(missed.is_empty(), "{spec}: {} pixels", missed.len());
        }
    }
}

#[test]
fn packed_colors_are_within_a_level_or_two() {
    let mut mesh = sheet([40, 40], |x, y| Vec3::new(x, y, 0.0), |_, _| false);
    let byte = |x: f32| (x * 255.0) as u8;
    mesh.colors = mesh
        .positions
        .iter()
        .map(|p| [byte(p.x), byte(1.0 - p.y), 77, 255])
        .collect();
    let patched = PatchedModel::new(of_mesh(mesh));
    let mut worst = 0.0f32;
    for (packed, full) in patched.packed().iter().zip(&patched.patches.records) {
        assert!(packed.color_residual >= full.color_residual);
        for at in [Vec2::ZERO, full.half_extents * 0.9, -full.half_extents] {
            let off = (packed.color_at(packed.clamped(at)) - full.color_at(at)).abs();
            worst = worst.max(off.max_element() * 255.0);
            // Colors are linear here: the fit is exact, but for the rounding of bytes.
            let truth = full.point(at);
            let expected = Vec3::new(truth.x, 1.0 - truth.y, 77.0 / 255.0);
            assert!((full.color_at(at) - expected).abs().max_element() < 1.5 / 255.0);
        }
    }
    assert!(worst < 4.0, "{worst}");
}
