//! Patches of a cut by error, in whole frames: every backend draws what the reference draws, closed models have no holes, and
//! without tolerances pictures are those of the cut by size.

use crate::common::{Device, generated, orbit, scans};
use surfel::generate::GeneratedShape;
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::pack::{ColorBy, Phong, SurfaceLighting};
use surfel::patches::{ErrorTolerances, PatchCounts, PatchRules};
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Culling, Method, Path, PictureOutputs, Settings, SplatKind};
use surfel::tree::Model;

const SIZE: (u32, u32) = (200, 160);

fn rules(rim_px: f32, inside_px: f32, shade_levels: f32) -> PatchRules {
    PatchRules {
        tolerances: ErrorTolerances {
            rim_px,
            inside_px,
            shade_levels,
        },
        is_strict: false,
        tiny_polygons: false,
        covers_rims: false,
    }
}

/// With polygons below a pixel.
fn and_tiny(rules: PatchRules) -> PatchRules {
    PatchRules {
        tiny_polygons: true,
        ..rules
    }
}

fn settings(rules: PatchRules) -> Settings {
    Settings {
        patches: Some(rules),
        ..Settings::default()
    }
}

fn engine<'m>(backend: &Backend, model: &'m Model) -> Engine<'m> {
    let outputs = PictureOutputs {
        depth: true,
        normal: true,
        ..PictureOutputs::default()
    };
    Engine::new(backend, model, SIZE, outputs).unwrap()
}

/// Pixels that differ by more than 3 levels, in coverage, or by more than a thousandth of the distance.
fn differing(a: &Image, b: &Image) -> usize {
    let differs = |i: &usize| {
        let (p, q) = (a.color[*i], b.color[*i]);
        let levels = (0..3).any(|k| p[k].abs_diff(q[k]) > 3);
        let [near, far] = [a.depth[*i], b.depth[*i]];
        levels || p[3] != q[3] || (near - far).abs() > 1e-3 * near.min(far)
    };
    (0..a.color.len()).filter(differs).count()
}

/// Pixels that `exact` covers and `image` does not.
fn holes(exact: &Image, image: &Image) -> usize {
    let both = exact.color.iter().zip(&image.color);
    both.filter(|(exact, own)| exact[3] > 0 && own[3] == 0)
        .count()
}

fn models() -> Vec<(&'static str, Model)> {
    let mut models = vec![
        ("sphere", generated(GeneratedShape::Sphere, 20_000)),
        ("torus", generated(GeneratedShape::Torus, 20_000)),
        ("statue", generated(GeneratedShape::Statue, 30_000)),
    ];
    models.push(("scan", scans(&[]).remove(0).1));
    models
}

fn views(model: &Model) -> [View; 3] {
    [(30.0, 20.0, 1.0), (200.0, -40.0, 0.4), (100.0, 70.0, 2.5)]
        .map(|(azimuth, elevation, fill)| orbit(model, SIZE, azimuth, elevation, fill))
}

/// In every light and color.
fn looks(rules: PatchRules) -> [Settings; 6] {
    let usual = settings(rules);
    [
        usual,
        settings(and_tiny(rules)),
        Settings {
            light: SurfaceLighting::Phong(Phong::default()),
            ..usual
        },
        Settings {
            color_by: ColorBy::Normal,
            culling: Culling::Off,
            ..usual
        },
        Settings {
            color_by: ColorBy::Primitive,
            ..usual
        },
        Settings {
            color_by: ColorBy::Level,
            splat: SplatKind::Disc,
            ..usual
        },
    ]
}

fn assert_as_reference(backend: &Backend, path: Path) {
    for (name, model) in models() {
        let (mut own, mut reference) =
            (engine(backend, &model), engine(&Backend::Reference, &model));
        for view in views(&model) {
            for look in looks(rules(0.25, 0.5, 32.0)) {
                let times = own.draw(&view, &Settings { path, ..look }).unwrap();
                assert!(times.counts.splats > 50, "{name}: {:?}", times.counts);
                let image = own.read(&view).unwrap();
                let exact = reference.render(&view, &look).unwrap();
                let covered = exact.color.iter().filter(|c| c[3] > 0).count();
                let count = differing(&exact, &image);
                // Margins end square on the processor and round in the reference, and where two patches are equally near the
                // last bit of a depth decides: up to 2.7 percent of the pixels of a statue of 1,400.
                assert!(
                    count * 30 < covered,
                    "{name}, {:?}: {count} of {covered}",
                    look.color_by
                );
                assert!(
                    holes(&exact, &image) <= 2,
                    "{name}: {}",
                    holes(&exact, &image)
                );
            }
        }
    }
}

#[test]
fn the_processor_draws_what_the_reference_draws() {
    assert_as_reference(&Backend::Cpu, Path::Auto);
}

#[test]
fn a_device_draws_what_the_reference_draws() {
    let Some(device) = Device::open() else { return };
    assert_as_reference(&Backend::Vulkan(device.gpu().clone()), Path::Raster);
}

#[test]
fn compute_draws_what_the_reference_draws() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    assert_as_reference(&Backend::Vulkan(device.gpu().clone()), Path::Compute);
}

/// Every pixel of the exact picture is covered, on all backends, from near and far.
#[test]
fn closed_models_have_no_holes() {
    let device = Device::open();
    let mut backends = vec![Backend::Reference, Backend::Cpu];
    backends.extend(device.iter().map(|d| Backend::Vulkan(d.gpu().clone())));
    let triangles = Settings {
        method: Method::Triangles,
        ..Settings::default()
    };
    for (name, model) in models().into_iter().take(3) {
        let mut exact = engine(&Backend::Reference, &model);
        let mut engines: Vec<_> = backends.iter().map(|b| engine(b, &model)).collect();
        for round in 0..12 {
            let turn = f64::from(round);
            let fill = [0.3, 1.0, 3.0][round as usize % 3];
            let view = orbit(&model, SIZE, 47.0 * turn, 80.0 * turn.sin(), fill);
            let whole = exact.render(&view, &triangles).unwrap();
            for (engine, backend) in engines.iter_mut().zip(&backends) {
                let mut rules = rules(0.5, 1.0, 60.0);
                rules.tiny_polygons = round % 2 == 1;
                let own = engine.render(&view, &settings(rules)).unwrap();
                // One pixel of a torus far off is missed by all (docs/METHODS.md).
                let most = usize::from(name == "torus" && round == 3);
                let found = holes(&whole, &own);
                assert!(
                    found <= most,
                    "{name}, view {round}: {found} by {backend:?}"
                );
            }
        }
    }
}

#[test]
fn without_tolerances_no_bit_changes() {
    let device = Device::open();
    let mut backends = vec![Backend::Reference, Backend::Cpu];
    backends.extend(device.iter().map(|d| Backend::Vulkan(d.gpu().clone())));
    for (name, model) in models() {
        for backend in &backends {
            let mut engine = engine(backend, &model);
            for view in views(&model) {
                let usual = engine.render(&view, &Settings::default()).unwrap();
                for none in [rules(0.0, 0.0, 0.0), rules(-1.0, 0.0, 24.0)] {
                    let same = engine.render(&view, &settings(none)).unwrap();
                    assert_eq!(usual, same, "{name}");
                }
            }
        }
    }
}

/// Tighter tolerances are nearer to the triangles, and patches are fewer than what they stand for.
#[test]
fn tolerances_bound_the_error() {
    let model = generated(GeneratedShape::Torus, 200_000);
    let mut own = engine(&Backend::Cpu, &model);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.0);
    let triangles = Settings {
        method: Method::Triangles,
        ..Settings::default()
    };
    let exact = own.render(&view, &triangles).unwrap();
    let by_size = own.draw(&view, &Settings::default()).unwrap().counts;
    let mean = |image: &Image| {
        let off = image.color.iter().zip(&exact.color);
        let sum: u32 = off.map(|(a, b)| u32::from(a[0].abs_diff(b[0]))).sum();
        f64::from(sum) / exact.color.len() as f64
    };
    let mut errors = Vec::new();
    for (e, shade) in [(0.1, 4.0), (0.5, 32.0), (2.0, 64.0)] {
        let times = own.draw(&view, &settings(rules(e, e, shade))).unwrap();
        assert!(
            times.counts.nodes_visited * 4 < by_size.nodes_visited,
            "{:?}",
            times.counts
        );
        errors.push(mean(&own.read(&view).unwrap()));
    }
    assert!(errors[0] < errors[1] && errors[1] < errors[2], "{errors:?}");
    assert!(errors[0] < 1.0, "{errors:?}");
}

/// Every backend counts the same patches by size, all that it draws, and the same refusals; none without tolerances.
#[test]
fn patches_and_refusals_are_counted() {
    let device = Device::open();
    let mut backends = vec![Backend::Cpu, Backend::Reference];
    backends.extend(device.iter().map(|d| Backend::Vulkan(d.gpu().clone())));
    let model = generated(GeneratedShape::Statue, 40_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.0);
    let mut first = None;
    for backend in &backends {
        let mut engine = engine(backend, &model);
        let counts = |settings: &Settings, engine: &mut Engine<'_>| {
            let times = engine.draw(&view, settings).unwrap();
            (times.counts.patches, times.counts.splats)
        };
        let (none, _) = counts(&settings(rules(0.0, 0.0, 8.0)), &mut engine);
        assert_eq!(none, PatchCounts::default(), "{backend:?}");
        let (patches, splats) = counts(&settings(rules(0.5, 1.0, 32.0)), &mut engine);
        assert!(
            patches.patches() > 100 && patches.patches() <= splats,
            "{backend:?} {patches:?}"
        );
        assert!(
            patches.refused.rim + patches.refused.inside > 100,
            "{patches:?}"
        );
        assert_eq!(*first.get_or_insert(patches), patches, "{backend:?}");
    }
}

/// Polygons below a pixel are nearer to the triangles than squares of a pixel.
#[test]
fn tiny_polygons_are_nearer_to_the_triangles() {
    let model = generated(GeneratedShape::Statue, 200_000);
    let mut own = engine(&Backend::Cpu, &model);
    for (azimuth, fill) in [(30.0, 0.3), (140.0, 0.15)] {
        let view = orbit(&model, SIZE, azimuth, 20.0, fill);
        let triangles = Settings {
            method: Method::Triangles,
            ..Settings::default()
        };
        let exact = own.render(&view, &triangles).unwrap();
        let usual = rules(0.5, 1.0, 48.0);
        let [squares, polygons] = [usual, and_tiny(usual)].map(|rules| {
            let image = own.render(&view, &settings(rules)).unwrap();
            let off = image.color.iter().zip(&exact.color);
            off.map(|(a, b)| u32::from(a[0].abs_diff(b[0])))
                .sum::<u32>()
        });
        assert!(
            f64::from(polygons) < 0.97 * f64::from(squares),
            "{polygons} {squares}"
        );
    }
}

#[test]
fn what_is_not_drawn_is_refused_by_name() {
    let model = generated(GeneratedShape::Sphere, 2_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.0);
    let usual = settings(PatchRules::default());
    for (look, word) in [
        (
            Settings {
                splat: SplatKind::Gauss,
                ..usual
            },
            "--splat",
        ),
        (
            Settings {
                color_by: ColorBy::Overdraw,
                ..usual
            },
            "--color-by",
        ),
    ] {
        for backend in [Backend::Reference, Backend::Cpu] {
            let mut engine =
                Engine::new(&backend, &model, SIZE, PictureOutputs::default()).unwrap();
            let error = engine.render(&view, &look).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
