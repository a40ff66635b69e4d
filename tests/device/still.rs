//! A camera that rests: what is kept from frame to frame is what would be made again, and nothing that is asked for is
//! missed.

use crate::common::{Device, generated, is_software, orbit};
use glam::Vec3;
use surfel::cut::SizeMetric;
use surfel::generate::GeneratedShape;
use surfel::gpu::DeviceOptions;
use surfel::image::Image;
use surfel::math::camera::{HeadlightSource, View};
use surfel::math::section_box::SectionBox;
use surfel::pack::lit_sphere::LitSphere;
use surfel::pack::{ColorBy, Lamp, Phong, SurfaceLighting};
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::stats::FrameTimes;
use surfel::render::stats::KeptWork;
use surfel::render::vulkan::renderer::VulkanRenderer;
use surfel::render::vulkan::scene::DeviceScene;
use surfel::render::{
    AmbientOcclusion, Blend, Culling, CutTraversal, EyeDome, Method, Occlusion, Path,
    Reconstruction, Settings, Shading, SplatKind, SumFormat,
};
use surfel::tree::Model;

const SIZE: (u32, u32) = (160, 160);

/// Frames of one model by one renderer that keeps what it may.
struct Stand<'m> {
    model: &'m Model,
    scene: DeviceScene,
    renderer: VulkanRenderer,
}

impl<'m> Stand<'m> {
    fn new(device: &Device, model: &'m Model) -> Self {
        let mut renderer = renderer(device);
        renderer.keep_lists(true);
        let scene = DeviceScene::new(device.gpu(), model).unwrap();
        Self {
            model,
            scene,
            renderer,
        }
    }

    /// One that keeps nothing, to compare with.
    fn plain(device: &Device, model: &'m Model) -> Self {
        let mut stand = Self::new(device, model);
        stand.renderer.keep_lists(false);
        stand
    }

    fn draw(&mut self, view: &View, settings: &Settings) -> FrameTimes {
        self.renderer
            .draw(self.model, &mut self.scene, view, settings)
            .unwrap()
    }

    fn render(&mut self, view: &View, settings: &Settings) -> Image {
        self.draw(view, settings);
        self.renderer.read(view).unwrap()
    }
}

fn renderer(device: &Device) -> VulkanRenderer {
    let outputs = PictureOutputs {
        depth: true,
        normal: false,
        values: false,
    };
    VulkanRenderer::new(device.gpu(), SIZE.0, SIZE.1, outputs, true).unwrap()
}

/// By a renderer that has drawn nothing before.
fn fresh(device: &Device, model: &Model, view: &View, settings: &Settings) -> Image {
    let mut renderer = renderer(device);
    let mut scene = DeviceScene::new(device.gpu(), model).unwrap();
    renderer.draw(model, &mut scene, view, settings).unwrap();
    renderer.read(view).unwrap()
}

fn of_splat(splat: SplatKind, threshold_px: f32) -> Settings {
    Settings {
        splat,
        threshold_px,
        ..Settings::default()
    }
}

/// Every kind of list, by both paths, small triangles among them.
fn looks() -> Vec<Settings> {
    let compute = Settings {
        path: Path::Compute,
        ..of_splat(SplatKind::Square, 0.7)
    };
    vec![
        compute,
        Settings {
            path: Path::Raster,
            ..compute
        },
        Settings {
            method: Method::Splats,
            ..of_splat(SplatKind::Disc, 4.0)
        },
        of_splat(SplatKind::Filtered, 1.0),
        of_splat(SplatKind::Gauss, 2.0),
        of_splat(SplatKind::Visibility, 3.0),
    ]
}

#[test]
fn a_still_camera_is_not_cut_and_packed_again() {
    let Some(device) = Device::open() else { return };
    let Some(pretending) = Device::open_with(DeviceOptions {
        pretend_noncoherent: true,
        ..DeviceOptions::default()
    }) else {
        return;
    };
    let model = generated(GeneratedShape::Statue, 50_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 2.0);
    for device in [&device, &pretending] {
        for look in looks() {
            let what = format!("{:?} {:?}", look.splat, look.path);
            let mut stand = Stand::new(device, &model);
            let first = stand.draw(&view, &look);
            assert_eq!(first.kept, KeptWork::Nothing, "{what}");
            assert!(first.counts.nodes_visited > 0 && first.counts.draw_list_bytes > 0);
            // The other slot of the ring.
            let second = stand.draw(&view, &look);
            assert_ne!(second.kept, KeptWork::Lists, "{what}");
            // Triangles that become filtered splats are taken out of the cut.
            if look.splat != SplatKind::Filtered {
                assert_eq!(second.kept, KeptWork::Cut, "{what}");
                assert_eq!(stand.renderer.nodes_visited(), first.counts.nodes_visited);
            }
            let visited = stand.renderer.nodes_visited();
            for _ in 0..3 {
                let times = stand.draw(&view, &look);
                assert_eq!(times.kept, KeptWork::Lists, "{what}");
                assert_eq!(times.counts, first.counts, "{what}");
                // The first has another block where the device makes its lists of ids.
                let blocks = first.uploaded_bytes - first.counts.draw_list_bytes;
                let fewer = blocks - times.uploaded_bytes;
                assert!(fewer <= 256, "{what}: only uniform blocks");
                assert!(!is_software(device) || fewer == 0, "{what}");
            }
            assert_eq!(stand.renderer.nodes_visited(), visited, "{what}");
            let wanted = fresh(device, &model, &view, &look);
            assert!(
                wanted.color.iter().any(|c| c[3] > 0),
                "{what}: an empty picture"
            );
            for _ in 0..2 {
                assert!(stand.render(&view, &look) == wanted, "{what}");
            }
        }
    }
}

#[test]
fn nothing_is_kept_unless_it_is_asked_for() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Sphere, 5_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.0);
    let backend = Backend::Device(device.gpu().clone());
    let mut engine = Engine::new(&backend, &model, SIZE, PictureOutputs::default()).unwrap();
    let draw = |engine: &mut Engine<'_>| engine.draw(&view, &Settings::default()).unwrap().kept;
    for _ in 0..4 {
        assert_eq!(draw(&mut engine), KeptWork::Nothing);
    }
    engine.keep_lists(true);
    assert_eq!(draw(&mut engine), KeptWork::Lists);
    engine.keep_lists(false);
    assert_eq!(draw(&mut engine), KeptWork::Nothing);

    let mut plain = renderer(&device);
    let mut scene = DeviceScene::new(device.gpu(), &model).unwrap();
    for round in 1..=4 {
        let times = plain
            .draw(&model, &mut scene, &view, &Settings::default())
            .unwrap();
        assert_eq!(times.kept, KeptWork::Nothing);
        assert_eq!(plain.nodes_visited(), round * times.counts.nodes_visited);
    }
}

/// Settings that differ from `base` in one field each, with its name, and whether the picture of the statue must differ.
fn changes(base: &Settings, held: &View) -> Vec<(&'static str, Settings, bool)> {
    // A new field is missed here at once.
    let Settings {
        method: _,
        splat: _,
        // A method of their own.
        vertex_splats: _,
        patches: _,
        blend: _,
        shading: _,
        sums: _,
        low_pass_px: _,
        reconstruction: _,
        path: _,
        // tests/device/device_cut.rs has that: of what is equally near another may be seen.
        cut_on: _,
        traversal: _,
        // tests/device/by_id.rs has that.
        list_of: _,
        occlusion: _,
        threshold_px,
        depth_offset: _,
        culling: _,
        color_by: _,
        light: _,
        two_sided: _,
        use_colors: _,
        background: _,
        background_bottom: _,
        size: _,
        eye_dome: _,
        eye_dome_strength: _,
        ambient_occlusion: _,
        ambient_occlusion_strength: _,
        ambient_occlusion_reach_px: _,
        // tests/device/photo_look.rs has those: photographs have to be given.
        photos: _,
        marks_uncovered: _,
        cut_view: _,
        section: _,
    } = *base;
    let mut all = Vec::new();
    let mut add = |name, is_seen, change: &dyn Fn(&mut Settings)| {
        let mut settings = *base;
        change(&mut settings);
        all.push((name, settings, is_seen));
    };
    let is = base.splat;
    let is_square = is == SplatKind::Square;
    let is_gauss = is == SplatKind::Gauss;
    let lamp = |azimuth: f64| {
        SurfaceLighting::Phong(Phong {
            lamp: Lamp::FromCamera {
                azimuth,
                elevation: 0.3,
            },
            ..Phong::default()
        })
    };
    // Small triangles are filtered splats already.
    let is_filtered = is == SplatKind::Filtered;
    add("splats", !is_filtered, &|s| s.method = Method::Splats);
    add("triangles", true, &|s| s.method = Method::Triangles);
    add("disc", true, &|s| s.splat = SplatKind::Disc);
    add("ellipse", true, &|s| s.splat = SplatKind::Ellipse);
    add("raster", false, &|s| s.path = Path::Raster);
    add("occlusion on", false, &|s| s.occlusion = Occlusion::On);
    add("occlusion off", false, &|s| s.occlusion = Occlusion::Off);
    add("coherent", false, &|s| s.traversal = CutTraversal::Coherent);
    add("threshold", true, &|s| s.threshold_px = threshold_px + 0.5);
    add("no culling", false, &|s| s.culling = Culling::Off);
    add("by kind", true, &|s| s.color_by = ColorBy::Primitive);
    add("by level", true, &|s| s.color_by = ColorBy::Level);
    add("by depth", true, &|s| s.color_by = ColorBy::Depth);
    add("lamp", true, &|s| s.light = lamp(-1.0));
    add("other lamp", true, &|s| s.light = lamp(1.0));
    add("studio", true, &|s| {
        s.light = SurfaceLighting::Sphere(LitSphere::Studio);
    });
    add("metal", true, &|s| {
        s.light = SurfaceLighting::Sphere(LitSphere::Metal);
    });
    add("darkened", true, &|s| s.eye_dome = EyeDome::On);
    add("more darkened", false, &|s| s.eye_dome_strength = 2.0);
    let occluded = |s: &mut Settings| s.ambient_occlusion = AmbientOcclusion::On;
    add("occluded", true, &occluded);
    add("more occluded", true, &|s| {
        occluded(s);
        s.ambient_occlusion_strength = 3.0;
    });
    add("occluded from near", true, &|s| {
        occluded(s);
        s.ambient_occlusion_reach_px = Some(3.0);
    });
    add("no colors", true, &|s| s.use_colors = false);
    add("background", true, &|s| s.background = [0.2, 0.4, 0.6]);
    add("gradient", true, &|s| {
        s.background_bottom = Some([0.2, 0.4, 0.6]);
    });
    add("metric", true, &|s| s.size = SizeMetric::Nearest);
    add("section", true, &|s| {
        let (low, high) = (Vec3::NEG_INFINITY, Vec3::new(f32::INFINITY, 0.1, 0.0));
        s.section = Some(SectionBox { low, high });
    });
    add("held cut", true, &|s| s.cut_view = Some(*held));
    add("depth offset", !is_square, &|s| s.depth_offset = Some(0.3));
    if !is_filtered {
        add("one side", false, &|s| s.two_sided = false);
    }
    if is_gauss {
        add("deferred", true, &|s| s.shading = Shading::Deferred);
        add("half", false, &|s| s.sums = Some(SumFormat::Half));
        add("low pass", true, &|s| s.low_pass_px = Some(1.5));
    }
    if is_square {
        add("blended", true, &|s| s.blend = Some(Blend::TwoPass));
        for how in [Reconstruction::Gaussian, Reconstruction::PullPush] {
            add("visibility", true, &|s| {
                s.splat = SplatKind::Visibility;
                s.reconstruction = how;
            });
        }
    }
    all
}

/// A statue of many colors.
fn colored() -> Model {
    let spec = surfel::generate::ShapeSpec::with_triangles(GeneratedShape::Statue, 20_000).unwrap();
    let mut mesh = surfel::generate::mesh(&spec);
    mesh.colors = (0..mesh.positions.len())
        .map(|i| [255, (i % 256) as u8, 80, 255])
        .collect();
    surfel::tree::build(
        mesh,
        &surfel::tree::BuildOptions::default(),
        &surfel::progress::SilentProgress,
    )
    .unwrap()
}

#[test]
fn every_change_of_a_setting_is_seen() {
    let Some(device) = Device::open() else { return };
    let model = colored();
    let view = orbit(&model, SIZE, 30.0, 20.0, 0.7);
    let held = orbit(&model, SIZE, 30.0, 20.0, 0.3);
    for base in [
        of_splat(SplatKind::Square, 3.0),
        of_splat(SplatKind::Filtered, 2.0),
        of_splat(SplatKind::Gauss, 2.0),
    ] {
        let mut stand = Stand::new(&device, &model);
        let mut plain = Stand::plain(&device, &model);
        let before = plain.render(&view, &base);
        for (name, changed, is_seen) in changes(&base, &held) {
            let what = format!("{:?}: {name}", base.splat);
            for _ in 0..2 {
                stand.draw(&view, &base);
            }
            let wanted = plain.render(&view, &changed);
            for _ in 0..2 {
                // Draws in the slots of the ring in turn: reading takes one as well.
                stand.draw(&view, &changed);
                assert!(stand.render(&view, &changed) == wanted, "{what}");
            }
            assert!(!is_seen || before != wanted, "{what} shows nothing");
        }
        assert!(stand.render(&view, &base) == before);
    }
}

#[test]
fn every_change_of_the_camera_is_seen() {
    let Some(device) = Device::open() else { return };
    let model = colored();
    let view = orbit(&model, SIZE, 30.0, 20.0, 2.0);
    let mut mirrored = view;
    mirrored.scale[0] = -mirrored.scale[0];
    let parallel = View {
        light: HeadlightSource::Directional,
        ..view
    };
    let near = View {
        near: view.near + 0.75 * (view.far - view.near) / 2.0,
        ..view
    };
    let mut shifted = view;
    shifted.offset[0] += 0.01;
    let moved = orbit(&model, SIZE, 30.2, 20.0, 2.0);
    for look in looks() {
        let mut stand = Stand::new(&device, &model);
        let mut plain = Stand::plain(&device, &model);
        let before = plain.render(&view, &look);
        for (name, other) in [
            ("mirrored", mirrored),
            ("parallel light", parallel),
            ("near plane", near),
            ("shifted", shifted),
            ("moved", moved),
        ] {
            for _ in 0..2 {
                stand.draw(&view, &look);
            }
            let wanted = plain.render(&other, &look);
            assert!(wanted != before, "{name} shows nothing");
            for _ in 0..2 {
                stand.draw(&other, &look);
                assert!(
                    stand.render(&other, &look) == wanted,
                    "{:?}: {name}",
                    look.splat
                );
            }
        }
    }
}

/// Of a held cut the lists are written anew when the camera moves, the cut is not chosen anew; and what changes neither
/// leaves both.
#[test]
fn what_does_not_change_is_not_made_again() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 20_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.0);
    let held = Settings {
        cut_view: Some(view),
        ..Settings::default()
    };
    let mut stand = Stand::new(&device, &model);
    stand.draw(&view, &held);
    for azimuth in [31.0, 32.0] {
        let times = stand.draw(&orbit(&model, SIZE, azimuth, 20.0, 1.0), &held);
        assert_eq!(times.kept, KeptWork::Cut);
    }
    let mut stand = Stand::new(&device, &model);
    let black = Settings {
        path: Path::Auto,
        ..Settings::default()
    };
    for _ in 0..2 {
        stand.draw(&view, &black);
    }
    let background = Settings {
        background: [1.0, 0.0, 0.0],
        ..black
    };
    assert_eq!(stand.draw(&view, &background).kept, KeptWork::Lists);
}

#[test]
fn another_model_and_other_pages_are_seen() {
    let Some(device) = Device::open() else { return };
    let statue = generated(GeneratedShape::Statue, 20_000);
    let sphere = generated(GeneratedShape::Sphere, 20_000);
    let view = orbit(&statue, SIZE, 30.0, 20.0, 2.0);
    for look in looks() {
        let mut stand = Stand::new(&device, &statue);
        for _ in 0..2 {
            stand.draw(&view, &look);
        }
        let wanted = fresh(&device, &statue, &view, &look);
        // The same model in pages: its triangles have other corners.
        let mut pages = DeviceScene::with_page_limits(device.gpu(), &statue, 1_000, 777).unwrap();
        assert!(pages.pages.len() > 1);
        let mut other = DeviceScene::new(device.gpu(), &sphere).unwrap();
        let renderer = &mut stand.renderer;
        for _ in 0..2 {
            renderer.draw(&statue, &mut pages, &view, &look).unwrap();
            assert!(renderer.read(&view).unwrap() == wanted);
            renderer.draw(&sphere, &mut other, &view, &look).unwrap();
            let of_sphere = renderer.read(&view).unwrap();
            assert!(of_sphere == fresh(&device, &sphere, &view, &look));
            assert!(of_sphere != wanted);
        }
        drop(pages);
        // A new scene where an old one was.
        stand.scene = DeviceScene::new(device.gpu(), &statue).unwrap();
        assert_ne!(stand.draw(&view, &look).kept, KeptWork::Lists);
        assert!(stand.render(&view, &look) == wanted);
    }
}

/// A device that was lost is opened again, and scene and renderer are made anew.
#[test]
fn nothing_is_kept_from_another_device() {
    let model = generated(GeneratedShape::Statue, 20_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.0);
    let mut pictures = Vec::new();
    for _ in 0..2 {
        let Some(device) = Device::open() else { return };
        let mut stand = Stand::new(&device, &model);
        let times = stand.draw(&view, &Settings::default());
        assert_eq!(times.kept, KeptWork::Nothing);
        stand.draw(&view, &Settings::default());
        pictures.push(stand.render(&view, &Settings::default()));
    }
    assert!(pictures[0] == pictures[1]);
}

#[cfg(feature = "viewer")]
#[test]
fn what_was_predicted_for_other_settings_is_not_drawn() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 20_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.0);
    let square = of_splat(SplatKind::Square, 2.0);
    let disc = of_splat(SplatKind::Disc, 2.5);
    let mut made = 0;
    for keeps in [false, true] {
        let mut stand = Stand::new(&device, &model);
        stand.renderer.keep_lists(keeps);
        for (foreseen, drawn) in [(square, square), (square, disc), (disc, square)] {
            let ahead = stand
                .renderer
                .predict(&[&model], &stand.scene, &view, &foreseen);
            assert!(ahead.counts.nodes_visited > 0);
            let before = stand.renderer.nodes_visited();
            let times = stand.draw(&view, &drawn);
            let is_same = foreseen == drawn;
            // Lists of an earlier frame need no cut.
            if times.kept != KeptWork::Lists {
                assert_eq!(stand.renderer.nodes_visited() == before, is_same);
                assert_eq!(times.kept, KeptWork::Nothing);
                made += 1;
            }
            let picture = stand.renderer.read(&view).unwrap();
            assert!(picture == fresh(&device, &model, &view, &drawn));
        }
    }
    assert!(made >= 5, "{made} frames were made");
    // Of another size nothing is kept.
    let mut stand = Stand::new(&device, &model);
    for _ in 0..2 {
        stand.draw(&view, &square);
    }
    let wide = orbit(&model, (300, 200), 30.0, 20.0, 1.0);
    stand.renderer.resize(300, 200).unwrap();
    assert_eq!(stand.draw(&wide, &square).kept, KeptWork::Nothing);
    let mut other = VulkanRenderer::new(
        device.gpu(),
        300,
        200,
        PictureOutputs {
            depth: true,
            normal: false,
            values: false,
        },
        true,
    )
    .unwrap();
    other
        .draw(&model, &mut stand.scene, &wide, &square)
        .unwrap();
    assert!(stand.renderer.read(&wide).unwrap() == other.read(&wide).unwrap());
}
