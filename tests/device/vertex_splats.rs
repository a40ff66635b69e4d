//! Splats from vertices: processor and device draw what the reference draws, and what nobody draws is refused by name.

mod shapes;

use self::shapes::{cube, fan, flat_cube, motley, sheet};
use crate::common::Device;
use glam::{DVec3, Vec3};
use surfel::image::Image;
use surfel::math::camera::{Camera, View};
use surfel::oriented::radius::RadiusRule;
use surfel::oriented::resample::{SampleChoice, SamplePattern};
use surfel::oriented::splats::{LevelLeaf, SplatRules};
use surfel::pack::{ColorBy, Phong, SurfaceLighting};
use surfel::render::engine::{Backend, Engine};
use surfel::render::{
    Blend, Culling, Method, Path, PictureOutputs, Reconstruction, Settings, Shading, SplatKind,
};
use surfel::tree::Model;

fn view(model: &Model, azimuth: f64) -> View {
    let center = model.orbit_center.as_dvec3();
    let radius = f64::from(model.orbit_radius);
    let camera = Camera::orbit((240, 200), center, radius, azimuth, 0.5, 0.8);
    camera.view(DVec3::ZERO).unwrap()
}

fn settings(rules: SplatRules) -> Settings {
    Settings {
        method: Method::Splats,
        vertex_splats: Some(rules),
        ..Settings::default()
    }
}

fn cut(degrees: f64) -> SplatRules {
    SplatRules {
        clip: Some(degrees.to_radians()),
        ..SplatRules::default()
    }
}

/// Engines of a model on one backend, without normals and with them, kept from picture to picture: a device makes its
/// pipelines once.
struct KeptEngines<'m> {
    backend: Backend,
    model: &'m Model,
    made: [Option<Engine<'m>>; 2],
}

impl<'m> KeptEngines<'m> {
    fn new(backend: &Backend, model: &'m Model) -> Self {
        Self {
            backend: backend.clone(),
            model,
            made: [None, None],
        }
    }

    fn draw(&mut self, view: &View, settings: &Settings) -> Image {
        // Compute sums no normals.
        let normal = settings.path != Path::Compute || !is_blended(settings);
        let engine = self.made[usize::from(normal)].get_or_insert_with(|| {
            let outputs = PictureOutputs {
                depth: true,
                normal,
                ..PictureOutputs::default()
            };
            let size = (view.width, view.height);
            Engine::new(&self.backend, self.model, size, outputs).unwrap()
        });
        engine.render(view, settings).unwrap()
    }
}

fn draw(backend: &Backend, model: &Model, view: &View, settings: &Settings) -> Image {
    KeptEngines::new(backend, model).draw(view, settings)
}

fn is_blended(settings: &Settings) -> bool {
    settings.splat == SplatKind::Gauss || settings.blend == Some(Blend::TwoPass)
}

/// Pixels that differ by more than two levels, in coverage, or by more than a thousandth of the distance.
fn differing(a: &Image, b: &Image) -> usize {
    let differs = |i: &usize| {
        let (p, q) = (a.color[*i], b.color[*i]);
        let levels = (0..3).any(|k| p[k].abs_diff(q[k]) > 2);
        let [near, far] = [a.depth[*i], b.depth[*i]];
        levels || p[3] != q[3] || (near - far).abs() > 1e-3 * near.min(far)
    };
    (0..a.color.len()).filter(differs).count()
}

/// Holds a backend to the pictures of the reference: in every light, of cut and whole splats, from several sides.
fn assert_as_reference(own: &Backend, path: Path) {
    for (model, name) in [
        (cube(), "cube"),
        (flat_cube(), "flat cube"),
        (sheet(), "sheet"),
    ] {
        let whole = SplatRules {
            radius: RadiusRule::Dietz,
            angle_test: Some(0.3),
            ..SplatRules::default()
        };
        let [mut exact, mut drawn] =
            [&Backend::Reference, own].map(|backend| KeptEngines::new(backend, &model));
        for rules in [cut(20.0), cut(5.0), whole, SplatRules::default()] {
            for azimuth in [0.3, 2.0, 4.5] {
                let view = view(&model, azimuth);
                for look in [
                    settings(rules),
                    Settings {
                        light: SurfaceLighting::Phong(Phong::default()),
                        ..settings(rules)
                    },
                    Settings {
                        culling: Culling::Off,
                        color_by: ColorBy::Normal,
                        ..settings(rules)
                    },
                ] {
                    let reference = exact.draw(&view, &look);
                    let own = drawn.draw(&view, &Settings { path, ..look });
                    let covered = reference.color.iter().filter(|c| c[3] > 0).count();
                    let count = differing(&reference, &own);
                    assert!(covered > 2000, "{name}: {covered}");
                    // Where splats cross, the last bit of a depth decides.
                    assert!(
                        count * 200 < covered,
                        "{name} {rules:?}: {count} of {covered}"
                    );
                }
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

/// From within a box polygons reach behind the eye, where the device clips them.
#[test]
fn a_device_draws_what_reaches_behind_the_eye() {
    let Some(device) = Device::open() else { return };
    let model = flat_cube();
    assert_splats_alone(&model, cut(5.0), 24);
    let vulkan = Backend::Vulkan(device.gpu().clone());
    for target in [DVec3::X, DVec3::new(0.2, 0.9, 0.0), DVec3::ONE] {
        let eye = DVec3::new(0.5, 0.4, 0.6);
        let camera = Camera::look_at((240, 200), eye, target, DVec3::Z, 1.2, [0.05, 10.0]);
        let view = camera.view(DVec3::ZERO).unwrap();
        let inside = Settings {
            culling: Culling::Off,
            ..settings(cut(5.0))
        };
        let reference = draw(&Backend::Reference, &model, &view, &inside);
        let covered = reference.color.iter().filter(|c| c[3] > 0).count();
        assert_eq!(covered, 240 * 200);
        for &path in device.paths() {
            let own = draw(&vulkan, &model, &view, &Settings { path, ..inside });
            assert!(differing(&reference, &own) * 200 < covered, "{path:?}");
        }
    }
}

/// Holds that splats draw a model, so many of them and without any triangle: else a picture says nothing of them.
fn assert_splats_alone(model: &Model, rules: SplatRules, count: u64) {
    let outputs = PictureOutputs::default();
    let mut engine = Engine::new(&Backend::Cpu, model, (240, 200), outputs).unwrap();
    let drawn = engine.draw(&view(model, 0.3), &settings(rules)).unwrap();
    let counts = drawn.counts;
    assert_eq!((counts.splats, counts.triangles), (count, 0), "{rules:?}");
}

#[test]
fn a_cube_of_eight_vertices_looks_as_its_triangles_do() {
    let model = flat_cube();
    assert_splats_alone(&model, cut(5.0), 24);
    for azimuth in [0.3, 1.1, 2.0, 4.5] {
        let view = view(&model, azimuth);
        let triangles = Settings {
            method: Method::Triangles,
            ..Settings::default()
        };
        let exact = draw(&Backend::Reference, &model, &view, &triangles);
        let splats = draw(&Backend::Reference, &model, &view, &settings(cut(5.0)));
        // Rules for pixels on an edge are not the same.
        let count = differing(&exact, &splats);
        assert!(count < 60, "{azimuth}: {count}");
        let uncut = SplatRules {
            is_uncut: true,
            ..cut(5.0)
        };
        let uncut = draw(&Backend::Reference, &model, &view, &settings(uncut));
        assert!(
            differing(&exact, &uncut) > 2000,
            "cuts are what makes it so"
        );
        let whole = draw(
            &Backend::Reference,
            &model,
            &view,
            &settings(SplatRules::default()),
        );
        assert!(differing(&exact, &whole) > 2000);
    }
}

/// Blended and visibility splats from vertices of these rules, of every kind.
fn blended_looks(rules: SplatRules) -> Vec<Settings> {
    let of = |splat, shading| Settings {
        splat,
        shading,
        ..settings(rules)
    };
    let mut looks = vec![
        of(SplatKind::Gauss, Shading::PerSplat),
        of(SplatKind::Gauss, Shading::Deferred),
        Settings {
            blend: Some(Blend::TwoPass),
            light: SurfaceLighting::Phong(Phong::default()),
            ..of(SplatKind::Disc, Shading::PerSplat)
        },
    ];
    for reconstruction in [
        Reconstruction::Gaussian,
        Reconstruction::Density,
        Reconstruction::PullPush,
    ] {
        looks.push(Settings {
            reconstruction,
            ..of(SplatKind::Visibility, Shading::PerSplat)
        });
    }
    looks
}

/// Holds a backend to the blended and visibility splats of the reference: the same pixels but where a depth decides.
fn assert_blended_as_reference(own: &Backend, path: Path) {
    assert_splats_alone(&flat_cube(), cut(20.0), 24);
    assert_splats_alone(&fan(0.02), cut(20.0), 61);
    let size = (240, 200);
    let mut wrong = Vec::new();
    for (model, name) in [
        (flat_cube(), "cube"),
        (fan(0.02), "fan"),
        (sheet(), "sheet"),
        (motley(), "motley"),
    ] {
        let mut views = vec![
            ("front", view(&model, 0.3)),
            ("side", view(&model, 2.0)),
            ("parallel", crate::common::orthographic(&model, size)),
        ];
        // From within a box, which reaches behind the eye.
        for target in [DVec3::X, DVec3::ONE] {
            let eye = DVec3::new(0.5, 0.4, 0.6);
            let camera = Camera::look_at(size, eye, target, DVec3::Z, 1.2, [0.05, 10.0]);
            views.push(("inside", camera.view(DVec3::ZERO).unwrap()));
        }
        views.truncate(if name == "cube" { 5 } else { 3 });
        // Not whole discs: a cube's are seen edge-on, where the depth of a pixel is anything. But those of other colors than
        // their neighbors, which mix as weights have it.
        let all = match name {
            "motley" => vec![SplatRules::default()],
            _ => vec![cut(20.0), cut(3.0)],
        };
        let [mut exact, mut drawn] =
            [&Backend::Reference, own].map(|backend| KeptEngines::new(backend, &model));
        for rules in all {
            let is_drawn =
                |look: &Settings| path != Path::Compute || look.shading == Shading::PerSplat;
            for look in blended_looks(rules).into_iter().filter(is_drawn) {
                for (place, view) in &views {
                    let look = Settings {
                        culling: match *place {
                            "inside" => Culling::Off,
                            _ => look.culling,
                        },
                        ..look
                    };
                    let reference = exact.draw(view, &look);
                    let own = drawn.draw(view, &Settings { path, ..look });
                    let covered = reference.color.iter().filter(|c| c[3] > 0).count();
                    let count = differing(&reference, &own) + turned(&reference, &own);
                    assert!(covered > 2000, "{name}: {covered}");
                    if count * 100 >= covered {
                        wrong.push(format!("{name} {place} {look:?}: {count} of {covered}"));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Pixels whose normals are not the same, where both have some.
fn turned(a: &Image, b: &Image) -> usize {
    let normals = a.normal.iter().zip(&b.normal);
    let differs =
        |(a, b): &(&[f32; 3], &[f32; 3])| (Vec3::from(**a) - Vec3::from(**b)).length() > 0.02;
    normals.filter(differs).count()
}

#[test]
fn the_processor_blends_and_reconstructs_as_the_reference_does() {
    assert_blended_as_reference(&Backend::Cpu, Path::Auto);
}

#[test]
fn a_device_blends_and_reconstructs_as_the_reference_does() {
    let Some(device) = Device::open() else { return };
    assert_blended_as_reference(&Backend::Vulkan(device.gpu().clone()), Path::Raster);
}

#[test]
fn compute_blends_and_reconstructs_as_the_reference_does() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let vulkan = Backend::Vulkan(device.gpu().clone());
    assert_blended_as_reference(&vulkan, Path::Compute);
    // It sums no normals.
    let deferred = Settings {
        splat: SplatKind::Gauss,
        shading: Shading::Deferred,
        path: Path::Compute,
        ..settings(cut(5.0))
    };
    let model = cube();
    let mut engine = Engine::new(&vulkan, &model, (240, 200), PictureOutputs::default()).unwrap();
    let error = engine.render(&view(&model, 0.3), &deferred).unwrap_err();
    assert!(error.to_string().contains("--splat-shading"), "{error}");
}

/// Looks that darken what lies deep read the depth that a picture has: where splats stand beside triangles, a depth that is
/// pushed away by their reach would be a pit.
#[test]
fn blended_splats_have_the_depth_of_the_surface() {
    let model = fan(0.15);
    assert_splats_alone(&model, cut(20.0), 61);
    let view = view(&model, 0.3);
    let opaque = settings(cut(20.0));
    let blended = Settings {
        splat: SplatKind::Gauss,
        ..opaque
    };
    for backend in [Backend::Reference, Backend::Cpu] {
        let [a, b] = [&opaque, &blended].map(|look| draw(&backend, &model, &view, look).depth);
        let seen = a
            .iter()
            .zip(&b)
            .filter(|(a, b)| a.is_finite() && b.is_finite());
        // Pushed by 0.01 of a radius of 1 over a cosine of at least 0.2; what faces may lie apart is 0.3 of the radius.
        let far = seen.clone().filter(|(a, b)| (*a - *b).abs() > 0.1).count();
        assert!(seen.clone().count() > 5_000);
        assert!(50 * far < seen.count(), "{far} pixels lie deeper");
    }
}

/// Blended splats have the coverage of opaque ones, and on flat faces their colors.
#[test]
fn blended_splats_of_a_cube_look_as_opaque_ones_do() {
    let model = flat_cube();
    assert_splats_alone(&model, cut(5.0), 24);
    let view = view(&model, 0.3);
    let opaque = draw(&Backend::Reference, &model, &view, &settings(cut(5.0)));
    for splat in [SplatKind::Gauss, SplatKind::Visibility] {
        let look = Settings {
            splat,
            ..settings(cut(5.0))
        };
        let drawn = draw(&Backend::Reference, &model, &view, &look);
        let levels = |i: &usize| {
            let (p, q) = (opaque.color[*i], drawn.color[*i]);
            p[3] != q[3] || (0..3).any(|k| p[k].abs_diff(q[k]) > 2)
        };
        // Where faces meet both are shown.
        let differing = (0..opaque.color.len()).filter(levels).count();
        assert!(differing < 400, "{splat:?}: {differing}");
    }
}

/// Even splats of every pattern show what the triangles do, by every backend.
#[test]
fn even_splats_of_a_cube_look_as_its_triangles_do() {
    let model = flat_cube();
    let view = view(&model, 1.1);
    let triangles = Settings {
        method: Method::Triangles,
        ..Settings::default()
    };
    let exact = draw(&Backend::Reference, &model, &view, &triangles);
    for pattern in [
        SamplePattern::Lattice,
        SamplePattern::Poisson,
        SamplePattern::Rays,
    ] {
        let even = |spacing| {
            settings(SplatRules {
                samples: Some(SampleChoice { pattern, spacing }),
                ..cut(5.0)
            })
        };
        for backend in [Backend::Reference, Backend::Cpu] {
            let splats = draw(&backend, &model, &view, &even(Some(0.11)));
            let count = differing(&exact, &splats);
            assert!(count < 120, "{pattern:?}: {count}");
            let uncut = settings(SplatRules {
                clip: None,
                samples: Some(SampleChoice {
                    pattern,
                    spacing: Some(0.11),
                }),
                ..SplatRules::default()
            });
            let uncut = differing(&exact, &draw(&backend, &model, &view, &uncut));
            assert!(
                uncut > 2 * count.max(120),
                "{pattern:?}: {uncut}, cuts matter"
            );
        }
        let outputs = PictureOutputs::default();
        let mut engine = Engine::new(&Backend::Cpu, &model, (240, 200), outputs).unwrap();
        let usual = engine.draw(&view, &even(None)).unwrap().counts.splats;
        assert!((4..80).contains(&usual), "{pattern:?}: {usual}");
        let error = engine.render(&view, &even(Some(1e-6))).unwrap_err();
        assert!(error.to_string().contains("larger spacing"), "{error}");
    }
}

/// From afar the tree draws few discs, which cover what all splats cover.
#[test]
fn levels_draw_less_from_afar_and_leave_nothing_bare() {
    let model = sheet();
    let levels = |leaf| Settings {
        threshold_px: 4.0,
        culling: Culling::Off,
        ..settings(SplatRules {
            levels: Some(leaf),
            ..cut(5.0)
        })
    };
    for leaf in [LevelLeaf::Splats, LevelLeaf::Triangles] {
        let center = model.orbit_center.as_dvec3();
        let camera = Camera::orbit(
            (240, 200),
            center,
            f64::from(model.orbit_radius),
            0.3,
            0.5,
            0.04,
        );
        let view = camera.view(DVec3::ZERO).unwrap();
        let all = settings(cut(5.0));
        let outputs = PictureOutputs::default();
        let mut engine = Engine::new(&Backend::Cpu, &model, (240, 200), outputs).unwrap();
        let few = engine.draw(&view, &levels(leaf)).unwrap().counts;
        let many = engine.draw(&view, &all).unwrap().counts;
        assert!(
            few.splats + few.triangles < (many.splats + many.triangles) / 2,
            "{few:?} {many:?}"
        );
        let whole = draw(&Backend::Cpu, &model, &view, &all);
        let coarse = draw(&Backend::Cpu, &model, &view, &levels(leaf));
        let bare = |i: &usize| whole.color[*i][3] > 0 && coarse.color[*i][3] == 0;
        assert_eq!((0..whole.color.len()).filter(bare).count(), 0);
    }
}

#[test]
fn what_is_not_drawn_is_refused_by_name() {
    let model = cube();
    let view = view(&model, 0.3);
    let outputs = PictureOutputs::default();
    for (look, word) in [
        (
            Settings {
                splat: SplatKind::Filtered,
                ..settings(cut(5.0))
            },
            "--splat gauss",
        ),
        (
            Settings {
                splat: SplatKind::Disc,
                blend: Some(Blend::DepthRange),
                ..settings(cut(5.0))
            },
            "--blend two-pass",
        ),
        (
            Settings {
                shading: Shading::Deferred,
                ..settings(cut(5.0))
            },
            "--splat gauss",
        ),
        (
            Settings {
                color_by: ColorBy::Overdraw,
                ..settings(cut(5.0))
            },
            "--color-by",
        ),
        (
            Settings {
                color_by: ColorBy::Level,
                ..settings(cut(5.0))
            },
            "tree",
        ),
    ] {
        for backend in [Backend::Reference, Backend::Cpu] {
            let mut engine = Engine::new(&backend, &model, (240, 200), outputs).unwrap();
            let error = engine.render(&view, &look).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
