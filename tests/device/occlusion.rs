//! Leaving out what is hidden: not one bit of any picture may change, and much must be left out where much is hidden.

use crate::common::{Device, generated, orbit, pictures, scans};
use glam::{DVec3, Vec3};
use surfel::cut::{Cut, CutSelector, SplatFootprints, ZeroAreaSet, select};
use surfel::generate::GeneratedShape;
use surfel::math::camera::{Camera, View};
use surfel::mesh::Mesh;
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::stats::FrameCounts;
use surfel::render::{Blend, Culling, Method, Occlusion, Path, Settings, SplatKind, cut_key};
use surfel::scenes;
use surfel::tree::{self, BuildOptions, Model};

/// Every opaque splat of which hidden ones are left out, and every way to draw it.
const LOOKS: [(Method, SplatKind, Path); 5] = [
    (Method::Pop, SplatKind::Square, Path::Auto),
    (Method::Pop, SplatKind::Square, Path::Raster),
    (Method::Pop, SplatKind::Disc, Path::Auto),
    (Method::Splats, SplatKind::Square, Path::Auto),
    (Method::Splats, SplatKind::Disc, Path::Auto),
];

fn build(mesh: Mesh) -> Model {
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// Two engines for pictures of one size: for frames that leave nothing out, and for frames that do.
struct Pair<'m>([Engine<'m>; 2]);

impl<'m> Pair<'m> {
    fn new(backend: &Backend, model: &'m Model, size: (u32, u32)) -> Self {
        let outputs = PictureOutputs {
            depth: true,
            normal: true,
            values: false,
        };
        Self([(); 2].map(|()| Engine::new(backend, model, size, outputs).unwrap()))
    }

    /// Draws both, and compares color, depth and normals. Tells what was drawn of all.
    fn assert_same(&mut self, view: &View, settings: Settings, what: &str) -> [FrameCounts; 2] {
        let mut pictures = Vec::new();
        let mut counts = [FrameCounts::default(); 2];
        for (i, occlusion) in [Occlusion::Off, Occlusion::On].into_iter().enumerate() {
            let settings = Settings {
                occlusion,
                ..settings
            };
            counts[i] = self.0[i].draw(view, &settings).unwrap().counts;
            pictures.push(self.0[i].read(view).unwrap());
        }
        if pictures[0].covered_pixels() > 0 {
            pictures::SAME_BITS.assert_same(&pictures[0], &pictures[1], what);
        } else {
            // One of the scenes is empty.
            assert!(pictures[0] == pictures[1], "{what}");
        }
        let [off, on] = counts;
        // What is smaller than a pixel and contains no center is left out in any case.
        assert!(off.hidden == 0 || settings.threshold_px <= 1.0, "{what}");
        assert!(on.splats <= off.splats, "{what}");
        assert!(on.triangles <= off.triangles, "{what}");
        // Of splats of a pixel nodes are dropped with what is below them. Else what is left out is counted; some of it would
        // have been left out for having no area.
        if settings.threshold_px > 1.0 {
            assert!(
                on.splats + on.hidden >= off.splats + off.hidden,
                "{what}: {counts:?}"
            );
            assert_eq!(on.triangles, off.triangles, "{what}");
        }
        counts
    }
}

/// The same on the device and on the mirror, on an orbit forward and back.
#[test]
fn no_bit_of_a_picture_changes_on_an_orbit() {
    let Some(device) = Device::open() else { return };
    let backends = [Backend::Device(device.gpu().clone()), Backend::Reference];
    for (shape, culling) in [
        (GeneratedShape::Statue, Culling::Auto),
        (GeneratedShape::Torus, Culling::Off),
    ] {
        let model = generated(shape, 100_000);
        let mut hidden = 0;
        for backend in &backends {
            let is_mirror = matches!(backend, Backend::Reference);
            let mut pair = Pair::new(backend, &model, (150, 130));
            // By compute as well, which the host stands for elsewhere.
            let by_compute = (Method::Pop, SplatKind::Square, Path::Compute);
            for (method, splat, path) in LOOKS.into_iter().chain([by_compute]) {
                if is_mirror && path != Path::Auto {
                    continue;
                }
                for threshold_px in [1.0, 2.5] {
                    let settings = Settings {
                        method,
                        splat,
                        path,
                        threshold_px,
                        culling,
                        ..Settings::default()
                    };
                    let azimuths = if is_mirror {
                        [10.0; 1].to_vec()
                    } else {
                        vec![10.0, 13.0, 10.0]
                    };
                    for azimuth in azimuths {
                        let view = orbit(&model, (150, 130), azimuth, 20.0, 1.0);
                        let what = format!(
                            "{} {shape:?} {culling:?} {method:?} {splat:?} {path:?} {threshold_px} {azimuth}",
                            backend.name()
                        );
                        let [_, on] = pair.assert_same(&view, settings, &what);
                        hidden += on.hidden;
                    }
                }
            }
        }
        assert!(hidden > 50_000, "{shape:?}: {hidden}");
    }
}

/// Every scene that methods fail at: thin plates, sheets close behind one another, cameras inside, points, slivers, what
/// crosses the near plane, large coordinates.
#[test]
fn no_bit_of_any_scene_changes() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    let mut hidden = 0;
    for entry in scenes::ALL {
        let scene = entry.make();
        let model = build(scene.mesh);
        let view = scene.camera.view(model.origin).unwrap();
        let mut pair = Pair::new(&backend, &model, (view.width, view.height));
        for (method, splat, path) in LOOKS {
            let settings = Settings {
                method,
                splat,
                path,
                threshold_px: scene.threshold_px,
                ..Settings::default()
            };
            let what = format!("{} {method:?} {splat:?} {path:?}", entry.name);
            hidden += pair.assert_same(&view, settings, &what)[1].hidden;
        }
    }
    assert!(hidden > 10_000, "{hidden}");
}

#[test]
fn no_bit_changes_from_inside_mirrored_far_away_and_orthographic() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    let model = generated(GeneratedShape::Statue, 150_000);
    let size = (150, 130);
    let mut pair = Pair::new(&backend, &model, size);
    let mut mirrored = orbit(&model, size, 30.0, 20.0, 1.0);
    mirrored.scale[0] = -mirrored.scale[0];
    mirrored.offset[0] = -mirrored.offset[0];
    let inside = Camera::look_at(
        size,
        DVec3::new(0.0, 0.0, 0.66),
        DVec3::new(0.4, 0.2, 0.0),
        DVec3::Y,
        1.0,
        [0.01, 5.0],
    );
    let mut views = vec![
        ("mirrored", mirrored),
        ("inside", inside.view(model.origin).unwrap()),
        ("far", orbit(&model, size, 30.0, 20.0, 0.05)),
        ("near", orbit(&model, size, 30.0, 20.0, 12.0)),
    ];
    let mut parallel = orbit(&model, size, 30.0, 20.0, 1.0);
    parallel.is_perspective = false;
    parallel.scale = [0.9 / model.orbit_radius; 2];
    parallel.offset = [0.1, -0.05];
    views.push(("orthographic", parallel));
    for (name, view) in views {
        for (method, splat, path) in LOOKS {
            let settings = Settings {
                method,
                splat,
                path,
                culling: Culling::Off,
                ..Settings::default()
            };
            let what = format!("{name} {method:?} {splat:?} {path:?}");
            pair.assert_same(&view, settings, &what);
        }
    }
}

#[test]
fn no_bit_of_scans_and_clouds_changes() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    let mut cloud = surfel::generate::mesh(
        &surfel::generate::ShapeSpec::with_triangles(GeneratedShape::Statue, 100_000).unwrap(),
    );
    cloud.triangles.clear();
    let mut models = vec![("cloud".to_owned(), build(cloud))];
    models.extend(scans(&[
        "thesis/horse.ply",
        "meshes/ankylosaurus_mesh.ply.gz",
    ]));
    for (name, model) in &models {
        let mut pair = Pair::new(&backend, model, (200, 200));
        let mut hidden = 0;
        for fill in [0.3, 1.0] {
            let view = orbit(model, (200, 200), 200.0, -10.0, fill);
            for (method, splat, path) in LOOKS {
                let settings = Settings {
                    method,
                    splat,
                    path,
                    ..Settings::default()
                };
                let what = format!("{name} {method:?} {splat:?} {path:?} {fill}");
                hidden += pair.assert_same(&view, settings, &what)[1].hidden;
            }
        }
        assert!(hidden > 1000, "{name}: {hidden}");
    }
}

/// What is left out is the same on device and mirror, and where it cannot be told, nothing is.
#[test]
fn splats_that_cover_what_cannot_be_told_hide_nothing() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 60_000);
    let view = orbit(&model, (100, 100), 30.0, 20.0, 1.0);
    let backends = [Backend::Device(device.gpu().clone()), Backend::Reference];
    let counts = |splat, blend, occlusion| {
        let settings = Settings {
            splat,
            blend,
            occlusion,
            ..Settings::default()
        };
        backends.each_ref().map(|backend| {
            let mut engine =
                Engine::new(backend, &model, (100, 100), PictureOutputs::default()).unwrap();
            engine.draw(&view, &settings).unwrap().counts
        })
    };
    for (splat, blend) in [
        (SplatKind::Ellipse, None),
        (SplatKind::Gauss, None),
        (SplatKind::Visibility, None),
        (SplatKind::Filtered, None),
        (SplatKind::Square, Some(Blend::TwoPass)),
    ] {
        for counts in counts(splat, blend, Occlusion::On) {
            assert_eq!(counts.hidden, 0, "{splat:?}");
        }
    }
    let [on_device, mirrored] = counts(SplatKind::Square, None, Occlusion::On);
    assert_eq!(on_device.hidden, mirrored.hidden);
    assert_eq!(on_device.splats, mirrored.splats);
    let [auto, _] = counts(SplatKind::Square, None, Occlusion::Auto);
    assert_eq!(auto, on_device);
    let [off, _] = counts(SplatKind::Square, None, Occlusion::Off);
    assert!(
        2 * on_device.splats < off.splats,
        "{on_device:?} of {off:?}"
    );
}

/// Up to a pixel splats are samples: nothing that triangles cover stays open, and outlines come nearer to theirs, whether
/// what is hidden is left out or not.
#[test]
fn up_to_a_pixel_splats_cover_what_triangles_cover() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    let covered = |model: &Model, settings: Settings, view: &View| -> Vec<bool> {
        let size = (view.width, view.height);
        let outputs = PictureOutputs {
            depth: true,
            normal: false,
            values: false,
        };
        let mut engine = Engine::new(&backend, model, size, outputs).unwrap();
        engine.draw(view, &settings).unwrap();
        let image = engine.read(view).unwrap();
        image.depth.iter().map(|z| z.is_finite()).collect()
    };
    let count = |a: &[bool], b: &[bool]| a.iter().zip(b).filter(|(a, b)| **a && !**b).count();
    for shape in [GeneratedShape::Statue, GeneratedShape::Torus] {
        let model = generated(shape, 60_000);
        let view = orbit(&model, (150, 150), 30.0, 20.0, 0.4);
        let of = |method, splat, threshold_px, occlusion, path| {
            let settings = Settings {
                method,
                splat,
                threshold_px,
                occlusion,
                path,
                ..Settings::default()
            };
            covered(&model, settings, &view)
        };
        let triangles = of(
            Method::Triangles,
            SplatKind::Square,
            1.0,
            Occlusion::Auto,
            Path::Auto,
        );
        for splat in [SplatKind::Square, SplatKind::Disc] {
            let extra = [0.2, 1.0, 2.0].map(|threshold_px| {
                let [on, off, raster] = [
                    (Occlusion::On, Path::Auto),
                    (Occlusion::Off, Path::Auto),
                    (Occlusion::On, Path::Raster),
                ]
                .map(|(occlusion, path)| of(Method::Pop, splat, threshold_px, occlusion, path));
                assert_eq!(count(&triangles, &on), 0, "{shape:?} {splat:?}: holes");
                assert!(on == off && on == raster, "{shape:?} {splat:?}");
                count(&on, &triangles)
            });
            // By half a side at most, and more at corners.
            assert!(
                2 * extra[0] < extra[1] && extra[1] < extra[2] && extra[1] > 20,
                "{shape:?}: {extra:?}"
            );
        }
    }
}

fn footprints(side_px: f32) -> SplatFootprints {
    SplatFootprints {
        side_px,
        hides: true,
        are_discs: false,
        large_leaves: false,
        is_cloud: false,
    }
}

/// A square of `cells` x `cells` x 2 triangles in the plane z, of half side `half`.
fn plate(cells: u32, half: f32, z: f32) -> Mesh {
    let at = |i: u32| (2.0 * i as f32 / cells as f32 - 1.0) * half;
    let mut mesh = Mesh::default();
    for j in 0..=cells {
        mesh.positions
            .extend((0..=cells).map(|i| Vec3::new(at(i), at(j), z)));
    }
    for j in 0..cells {
        for i in 0..cells {
            let a = j * (cells + 1) + i;
            let (b, c, d) = (a + 1, a + cells + 1, a + cells + 2);
            mesh.triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    mesh
}

fn append(mesh: &mut Mesh, more: &Mesh) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend_from_slice(&more.positions);
    let corners = more.triangles.iter().map(|t| t.map(|i| i + first));
    mesh.triangles.extend(corners);
}

fn before(size: u32) -> View {
    let camera = Camera::look_at(
        (size, size),
        DVec3::new(0.0, 0.0, 3.0),
        DVec3::ZERO,
        DVec3::Y,
        0.8,
        [0.1, 20.0],
    );
    camera.view(DVec3::ZERO).unwrap()
}

/// Where every leaf and node of a cut lies.
fn depths(model: &Model, cut: &Cut) -> Vec<f32> {
    let tree = &model.tree;
    let nodes = cut.nodes.iter().map(|&id| tree.nodes[id as usize].center.z);
    let rows = cut
        .strips
        .iter()
        .map(|run| tree.nodes[run.node as usize].center.z);
    let leaves = cut.leaves.iter().chain(&cut.triangles);
    let leaves = leaves.map(|&id| tree.leaves[id as usize].center.z);
    nodes.chain(rows).chain(leaves).collect()
}

/// Closed form: a dense plate that fills the view stands before a dense sphere and another plate: all that is left is the
/// plate. Where the plate has no area, all is left.
#[test]
fn nothing_is_left_behind_a_plate_that_fills_the_view() {
    let mut mesh = surfel::generate::mesh(
        &surfel::generate::ShapeSpec::with_triangles(GeneratedShape::Sphere, 60_000).unwrap(),
    );
    mesh.normals.clear();
    mesh.colors.clear();
    append(&mut mesh, &plate(150, 4.0, -2.0));
    let behind = build(mesh.clone());
    append(&mut mesh, &plate(300, 2.0, 1.5));
    let model = build(mesh);
    let view = before(100);
    let settings = surfel::cut::CutSettings {
        threshold_px: 3.0,
        ..surfel::cut::CutSettings::default()
    };
    let mut selector = CutSelector::with_threads(1);
    let (mut all, mut seen) = (Cut::default(), Cut::default());
    let undrawn = ZeroAreaSet::new(&model);
    select(&model, &view, &settings, &mut all);
    selector.select_seen(
        &model,
        &view,
        &settings,
        (footprints(3.0), &undrawn),
        &mut seen,
    );
    assert!(depths(&model, &all).iter().filter(|z| **z < 1.4).count() > 1000);
    let left = depths(&model, &seen);
    assert!(left.len() > 1000, "the plate is there");
    assert!(
        left.iter().all(|z| *z > 1.4),
        "{}",
        left.iter().filter(|z| **z < 1.4).count()
    );

    // The same plate, each triangle three times one corner: it is in the cut, nothing is drawn for it, it hides nothing.
    let mut flat = plate(300, 2.0, 1.5);
    for triangle in &mut flat.triangles {
        *triangle = [triangle[0]; 3];
    }
    let mut mesh = surfel::generate::mesh(
        &surfel::generate::ShapeSpec::with_triangles(GeneratedShape::Sphere, 60_000).unwrap(),
    );
    mesh.normals.clear();
    mesh.colors.clear();
    append(&mut mesh, &plate(150, 4.0, -2.0));
    append(&mut mesh, &flat);
    let model = build(mesh);
    let undrawn = ZeroAreaSet::new(&model);
    assert_ne!(undrawn, ZeroAreaSet::new(&behind));
    let backend = Backend::Reference;
    let mut pair = Pair::new(&backend, &model, (100, 100));
    let look = Settings {
        threshold_px: 3.0,
        ..Settings::default()
    };
    let [off, _] = pair.assert_same(&view, look, "a plate without area");
    assert!(off.splats > 1000);
}

/// However many threads there are, and whatever was drawn before.
#[test]
fn what_is_left_depends_on_nothing_but_the_view() {
    // Several layers a pixel, so that nodes are hidden as a whole.
    let model = generated(GeneratedShape::Statue, 2_000_000);
    let undrawn = ZeroAreaSet::new(&model);
    let cut_of = |selector: &mut CutSelector, azimuth: f64, side_px: f32| {
        let view = orbit(&model, (300, 300), azimuth, 20.0, 1.0);
        let settings = Settings {
            threshold_px: side_px,
            ..Settings::default()
        };
        let with = cut_key::cut_settings(&settings, &model);
        let mut cut = Cut::default();
        selector.select_seen(
            &model,
            &view,
            &with,
            (footprints(side_px), &undrawn),
            &mut cut,
        );
        // Of what contains no pixel's center nothing is looked at in either.
        let seen = SplatFootprints {
            hides: false,
            ..footprints(side_px)
        };
        let mut all = Cut::default();
        selector.select_seen(&model, &view, &with, (seen, &undrawn), &mut all);
        let count = |cut: &Cut| {
            let rows: u32 = cut.strips.iter().map(|run| run.splats()).sum();
            (cut.nodes.len() + cut.leaves.len()) as u64 + u64::from(rows)
        };
        if side_px > 1.0 {
            assert_eq!(cut.stats.behind, 0);
            assert_eq!(
                count(&cut) + cut.stats.hidden,
                count(&all) + all.stats.hidden
            );
            assert_eq!(cut.stats.visited, all.stats.visited);
            assert_eq!(
                cut.triangles.len() as u64 + cut.stats.between,
                all.triangles.len() as u64 + all.stats.between
            );
        } else {
            // The surface is rough, so nodes behind others are dropped, and nothing below them is looked at.
            assert!(cut.stats.behind > 100, "{:?}", cut.stats);
            assert!(cut.stats.visited < all.stats.visited);
            assert!(count(&cut) + cut.stats.hidden < count(&all) + all.stats.hidden);
        }
        let mut nodes = all.nodes.iter();
        assert!(cut.nodes.iter().all(|id| nodes.any(|other| other == id)));
        let mut all = all.triangles.iter();
        assert!(cut.triangles.iter().all(|id| all.any(|other| other == id)));
        assert!(cut.nodes.is_sorted() && cut.leaves.is_sorted());
        assert!(cut.strips.is_sorted_by_key(|run| run.node));
        cut
    };
    for side_px in [1.0, 2.0] {
        let expected = cut_of(&mut CutSelector::with_threads(1), 40.0, side_px);
        assert!(expected.stats.hidden > 10_000);
        for threads in [2, 3, 8] {
            let mut selector = CutSelector::with_threads(threads);
            for azimuth in [40.0, 41.0, 220.0, 40.0] {
                let cut = cut_of(&mut selector, azimuth, side_px);
                if azimuth == 40.0 {
                    assert_eq!(cut.nodes, expected.nodes, "{threads} threads");
                    assert_eq!(cut.strips, expected.strips, "{threads} threads");
                    assert_eq!(cut.leaves, expected.leaves, "{threads} threads");
                    // How many nodes are found to be behind others, and with them triangles, depends on how threads get on.
                    if side_px > 1.0 {
                        assert_eq!(cut, expected, "{threads} threads");
                    }
                }
            }
        }
    }
}

/// Of a row of splats only those are left that are seen: the torus has needles.
#[test]
fn rows_lose_the_splats_that_are_hidden() {
    let model = generated(GeneratedShape::Torus, 400_000);
    let undrawn = ZeroAreaSet::new(&model);
    let view = orbit(&model, (300, 300), 40.0, 20.0, 1.0);
    let with = cut_key::cut_settings(&Settings::default(), &model);
    let (mut cut, mut all) = (Cut::default(), Cut::default());
    let seen = (footprints(1.0), &undrawn);
    CutSelector::default().select_seen(&model, &view, &with, seen, &mut cut);
    select(&model, &view, &with, &mut all);
    assert!(all.strips.iter().all(|row| row.splats() == row.count));
    let partly = |row: &&surfel::cut::StripRun| row.splats() < row.count;
    let partial = cut.strips.iter().filter(partly).count();
    assert!(partial > 100, "{partial} of {} rows", cut.strips.len());
    assert!(cut.strips.iter().all(|row| row.splats() > 0));
}
