//! Frames of a window: by the processor into pictures that the device shows, or by the device.

use crate::common::{Device, generated, orbit};
use surfel::generate::GeneratedShape;
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::patches::PatchRules;
use surfel::render::engine::{Backend, Engine, smooth_threshold};
use surfel::render::stats::{FrameTimes, KeptWork};
use surfel::render::vulkan::renderer::present::ShownFrame;
use surfel::render::vulkan::scene::DeviceScene;
use surfel::render::window_renderer::{ShownModel, WindowBackend, WindowRenderer};
use surfel::render::{Method, Path, PictureOutputs, Settings, SplatKind};
use surfel::tree::Model;

const SIZE: (u32, u32) = (160, 120);

/// A window's renderer and a model.
struct Window<'m> {
    model: &'m Model,
    scene: DeviceScene,
    renderer: WindowRenderer,
}

impl<'m> Window<'m> {
    fn new(device: &Device, model: &'m Model, backend: WindowBackend) -> Self {
        let mut renderer = WindowRenderer::new(device.gpu(), backend).unwrap();
        renderer.resize(SIZE.0, SIZE.1).unwrap();
        let scene = DeviceScene::new(device.gpu(), model).unwrap();
        Self {
            model,
            scene,
            renderer,
        }
    }

    fn draw(&mut self, view: &View, settings: &Settings) -> FrameTimes {
        let shown = ShownModel {
            models: &[self.model],
            scene: &mut self.scene,
            pages: &mut [],
        };
        let submitted = self.renderer.submit(shown, view, settings, nowhere());
        self.renderer.finish(submitted.unwrap()).unwrap()
    }

    fn picture(&mut self, view: &View, settings: &Settings) -> Image {
        self.draw(view, settings);
        self.renderer.read(view).unwrap()
    }
}

fn nowhere() -> ShownFrame<'static> {
    ShownFrame {
        onto: None,
        overlay: None,
        inset: 0,
    }
}

fn of_splat(splat: SplatKind, threshold_px: f32) -> Settings {
    Settings {
        splat,
        threshold_px,
        ..Settings::default()
    }
}

/// The pictures that the processor draws, and one that it does not.
fn looks() -> [Settings; 3] {
    [
        of_splat(SplatKind::Square, 1.0),
        of_splat(SplatKind::Disc, 3.0),
        of_splat(SplatKind::Filtered, 2.0),
    ]
}

/// As the command line draws it.
fn engine_picture(model: &Model, backend: &Backend, view: &View, settings: &Settings) -> Image {
    let outputs = PictureOutputs::default();
    let mut engine = Engine::new(backend, model, SIZE, outputs).unwrap();
    engine.render(view, settings).unwrap()
}

#[test]
fn frames_of_the_processor_are_its_pictures_and_kept_while_the_camera_rests() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 30_000);
    let views = [20.0, 70.0].map(|azimuth| orbit(&model, SIZE, azimuth, 20.0, 1.5));
    let mut window = Window::new(&device, &model, WindowBackend::Cpu);
    for look in looks() {
        for view in &views {
            let what = format!("{:?}", look.splat);
            let wanted = engine_picture(&model, &Backend::Cpu, view, &look);
            assert!(wanted.color.iter().filter(|p| p[3] > 0).count() > 1000);
            assert_eq!(window.draw(view, &look).kept, KeptWork::Nothing, "{what}");
            for _ in 0..3 {
                let times = window.draw(view, &look);
                assert_eq!(times.kept, KeptWork::Lists, "{what}");
                assert!(window.renderer.read(view).unwrap() == wanted, "{what}");
            }
            // Under another overlay, or none, it is the same.
            let again = window.renderer.submit_again(nowhere()).unwrap();
            window.renderer.finish(again).unwrap();
            let shown = window.renderer.read_shown(None).unwrap();
            assert!(shown.color == wanted.color, "{what}");
        }
    }
}

#[test]
fn frames_of_both_backends_follow_each_other() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 20_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.5);
    let mut window = Window::new(&device, &model, WindowBackend::Auto);
    let gauss = of_splat(SplatKind::Gauss, 2.0);
    let of_device = Backend::Device(device.gpu().clone());
    for _ in 0..2 {
        for look in looks().iter().flat_map(|look| [*look, gauss]) {
            let wanted = engine_picture(&model, &of_device, &view, &look);
            let found = window.picture(&view, &look);
            assert!(found == wanted, "{:?}", look.splat);
        }
    }
    // Without a model there is the background alone.
    let submitted = window.renderer.submit_background([0.0; 3], nowhere());
    window.renderer.finish(submitted.unwrap()).unwrap();
    let shown = window.renderer.read_shown(None).unwrap();
    assert!(shown.color.iter().all(|pixel| *pixel == [0; 4]));
}

#[test]
fn who_is_insisted_on_draws_or_says_why_not() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 20_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.5);
    let square = of_splat(SplatKind::Square, 2.0);
    let mut window = Window::new(&device, &model, WindowBackend::Vulkan);
    let times = window.draw(&view, &square);
    assert!(!times.passes.is_empty() && times.host.drawing_ms == 0.0);
    let of_device = Backend::Vulkan(device.gpu().clone());
    let wanted = engine_picture(&model, &of_device, &view, &square);
    assert!(window.renderer.read(&view).unwrap() == wanted);
    let mut window = Window::new(&device, &model, WindowBackend::Cpu);
    assert!(window.draw(&view, &square).host.drawing_ms > 0.0);
    let shown = ShownModel {
        models: &[&model],
        scene: &mut window.scene,
        pages: &mut [],
    };
    let gauss = of_splat(SplatKind::Gauss, 2.0);
    let refused = window.renderer.submit(shown, &view, &gauss, nowhere());
    let why = refused.unwrap_err().to_string();
    assert!(
        why.contains("processor") && why.contains("filtered"),
        "{why}"
    );
}

#[test]
fn what_was_predicted_is_drawn_of_the_same_settings_alone() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 20_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.0);
    let [square, disc, _] = looks();
    let mut window = Window::new(&device, &model, WindowBackend::Cpu);
    for (predicted, drawn) in [(square, square), (square, disc), (disc, square)] {
        let shown = ShownModel {
            models: &[&model],
            scene: &mut window.scene,
            pages: &mut [],
        };
        let ahead = window.renderer.predict(shown, &view, &predicted);
        assert!(ahead.counts.nodes_visited > 0 && ahead.counts.splats > 0);
        assert!(ahead.by_compute && !ahead.is_free);
        let times = window.draw(&view, &drawn);
        if predicted == drawn {
            let shown_counts = [times.counts.splats, times.counts.triangles];
            assert_eq!(shown_counts, [ahead.counts.splats, ahead.counts.triangles]);
        }
        assert_eq!(times.kept, KeptWork::Nothing);
        let wanted = engine_picture(&model, &Backend::Cpu, &view, &drawn);
        assert!(window.renderer.read(&view).unwrap() == wanted);
    }
}

#[test]
fn the_surface_under_the_cursor_is_as_far_as_its_pixel_says() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 30_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.5);
    let outputs = PictureOutputs {
        depth: true,
        ..PictureOutputs::default()
    };
    let of_device = Backend::Vulkan(device.gpu().clone());
    let mut engine = Engine::new(&of_device, &model, SIZE, outputs).unwrap();
    let square = looks()[0];
    let mut covered = 0;
    // By the processor, the rasterizer, compute and without a tree, in turn.
    for (backend, method, path) in [
        (WindowBackend::Cpu, Method::Pop, Path::Auto),
        (WindowBackend::Vulkan, Method::Pop, Path::Raster),
        (WindowBackend::Vulkan, Method::Pop, Path::Compute),
        (WindowBackend::Auto, Method::Triangles, Path::Auto),
        (WindowBackend::Auto, Method::Pop, Path::Auto),
    ] {
        if !device.paths().contains(&path) && path == Path::Compute {
            continue;
        }
        let settings = Settings {
            method,
            path,
            ..square
        };
        let wanted = engine.render(&view, &settings).unwrap();
        let mut window = Window::new(&device, &model, backend);
        window.draw(&view, &settings);
        for y in (0..SIZE.1).step_by(8) {
            for x in (0..SIZE.0).step_by(8) {
                let known = wanted.depth[(y * SIZE.0 + x) as usize];
                let found = window.renderer.distance_near(&view, [x, y]).unwrap();
                if known.is_finite() {
                    // Where triangles meet in a pixel either may win.
                    let off = found.map(|found| (found - known).abs() / known);
                    assert!(off.is_some_and(|off| off < 1e-3), "{x} {y}: {off:?}");
                    covered += 1;
                }
            }
        }
        for beside in [[0, 0], [SIZE.0, 60], [10, 5000]] {
            let found = window.renderer.distance_near(&view, beside).unwrap();
            assert_eq!(found, None, "{beside:?}");
        }
    }
    assert!(covered > 200, "{covered}");
}

#[test]
fn a_window_that_changes_its_size_goes_on() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 20_000);
    let mut window = Window::new(&device, &model, WindowBackend::Cpu);
    for (width, height) in [(160, 120), (90, 200), (1, 1), (160, 120)] {
        window.renderer.resize(width, height).unwrap();
        let view = orbit(&model, (width, height), 30.0, 20.0, 1.5);
        for look in looks() {
            let picture = window.picture(&view, &look);
            assert_eq!((picture.width, picture.height), (width, height));
            let outputs = PictureOutputs::default();
            let size = (width, height);
            let mut engine = Engine::new(&Backend::Cpu, &model, size, outputs).unwrap();
            assert!(picture == engine.render(&view, &look).unwrap());
        }
    }
}

/// What patches are drawn into is as large as the window, by the rasterizer and by compute, with stepped rims and covered ones.
#[test]
fn patches_of_a_window_that_changes_its_size_go_on() {
    let Some(device) = Device::with_compute() else {
        return;
    };
    let model = generated(GeneratedShape::Torus, 30_000);
    let mut window = Window::new(&device, &model, WindowBackend::Vulkan);
    for path in [Path::Raster, Path::Compute] {
        for (width, height) in [SIZE, (320, 200), (90, 140)] {
            window.renderer.resize(width, height).unwrap();
            let view = orbit(&model, (width, height), 30.0, 20.0, 1.0);
            for covers_rims in [false, true] {
                let look = Settings {
                    path,
                    patches: Some(PatchRules {
                        covers_rims,
                        ..PatchRules::default()
                    }),
                    ..Settings::default()
                };
                let backend = Backend::Vulkan(device.gpu().clone());
                let outputs = PictureOutputs::default();
                let size = (width, height);
                let mut engine = Engine::new(&backend, &model, size, outputs).unwrap();
                let wanted = engine.render(&view, &look).unwrap();
                let what = format!("{path:?} {width} x {height}");
                assert!(window.picture(&view, &look).color == wanted.color, "{what}");
            }
        }
    }
}

/// Mean difference of all pixels, levels of 255.
fn mean_levels(one: &Image, two: &Image) -> f64 {
    let pixels = one.color.iter().zip(&two.color);
    let sum: u32 = pixels
        .flat_map(|(a, b)| (0..3).map(|i| u32::from(a[i].abs_diff(b[i]))))
        .sum();
    f64::from(sum) / (3 * one.color.len()) as f64
}

#[test]
fn a_resting_picture_becomes_the_mean_of_samples() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 60_000);
    let [here, there] = [20.0, 70.0].map(|azimuth| orbit(&model, SIZE, azimuth, 20.0, 0.8));
    for (backend, engine) in [
        (WindowBackend::Cpu, Backend::Cpu),
        (WindowBackend::Vulkan, Backend::Vulkan(device.gpu().clone())),
    ] {
        let mut window = Window::new(&device, &model, backend);
        for look in [
            of_splat(SplatKind::Square, 1.0),
            of_splat(SplatKind::Disc, 2.0),
        ] {
            let what = format!("{backend:?} {:?}", look.splat);
            let single = window.picture(&here, &look);
            let mut shown_after = Vec::new();
            let mut samples = 0;
            while window.renderer.can_be_smoother(&look) {
                let shown = ShownModel {
                    models: &[window.model],
                    scene: &mut window.scene,
                    pages: &mut [],
                };
                samples += 1;
                if window.renderer.add_sample(shown, &here, &look).unwrap() {
                    shown_after.push(samples);
                    let again = window.renderer.submit_again(nowhere()).unwrap();
                    window.renderer.finish(again).unwrap();
                }
                assert!(samples <= 64, "{what}");
            }
            assert!(
                shown_after.starts_with(&[4, 16]) && shown_after.last() == Some(&samples),
                "{what}: {shown_after:?}"
            );
            let smooth = window.renderer.read(&here).unwrap();
            assert!(window.renderer.read_shown(None).unwrap().color == smooth.color);
            let reference = Settings {
                method: Method::Triangles,
                splat: SplatKind::Square,
                threshold_px: 1.0,
                ..look
            };
            let outputs = PictureOutputs::default();
            let mut engine = Engine::new(&engine, &model, SIZE, outputs).unwrap();
            let mean = engine.supersample(&here, &reference, 8).unwrap().to_image();
            let (own, before) = (mean_levels(&smooth, &mean), mean_levels(&single, &mean));
            if look.splat == SplatKind::Square {
                assert!(own < 1.0 && own < before / 3.0, "{what}: {own} of {before}");
            } else {
                assert!(own <= before, "{what}: {own} of {before}");
            }
            // It is the picture of surfel render: of the same samples, by the same rule.
            let threshold = smooth_threshold(&look, true).unwrap_or(look.threshold_px);
            let rendered = Settings {
                threshold_px: threshold,
                ..look
            };
            let rendered = engine.smooth(&here, &rendered).unwrap().to_image();
            let off = mean_levels(&smooth, &rendered);
            assert!(off < 0.02, "{what}: {off}");
            // Another view, and the same again, begin with one sample.
            let other = window.picture(&there, &look);
            assert!(other != smooth && window.renderer.can_be_smoother(&look));
            assert!(window.picture(&here, &look) == single, "{what}");
        }
    }
    let window = Window::new(&device, &model, WindowBackend::Auto);
    for look in [
        of_splat(SplatKind::Visibility, 2.0),
        of_splat(SplatKind::Filtered, 2.0),
        Settings {
            color_by: surfel::pack::ColorBy::Depth,
            ..Settings::default()
        },
    ] {
        assert!(!window.renderer.can_be_smoother(&look));
    }
}
