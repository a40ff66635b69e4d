//! Paged files drawn from their pages: every backend as the reference draws them, whole pictures as of the joined model, and
//! coarser ones without a hole while pages are missing.

use crate::common::pictures::{self, PictureOracle};
use crate::common::{Device, generated, orbit, orthographic};
use glam::DVec3;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use surfel::generate::{GeneratedShape, ShapeSpec};
use surfel::image::{Image, PictureAccumulator, jittered};
use surfel::math::camera::{Camera, View};
use surfel::pages::file::PagedFile;
use surfel::pages::join::whole_model;
use surfel::pages::source::{ByteSource, MemorySource};
use surfel::pages::write::{PagedOptions, to_bytes, to_bytes_with_patches};
use surfel::patches::{ErrorTolerances, PatchRules};
use surfel::progress::SilentProgress;
use surfel::render::engine::{Backend, Engine};
use surfel::render::paged_model::{FilePrefix, PagedModel, PagedModelOptions};
use surfel::render::{Culling, Method, Occlusion, Path, Settings, SplatKind};
use surfel::tree::{self, BuildOptions, Model};

const SIZE: (u32, u32) = (240, 200);

const SMALL_PAGES: PagedOptions = PagedOptions {
    page_leaves: 256,
    colors: None,
};

/// A statue with colors, or the cloud of its vertices.
fn statue(triangles: u64, is_cloud: bool) -> Model {
    let spec = ShapeSpec::with_triangles(GeneratedShape::Statue, triangles).unwrap();
    let mut mesh = surfel::generate::mesh(&spec);
    let shade = |x: f32| (x * 80.0 + 128.0) as u8;
    let colors = mesh.positions.iter();
    mesh.colors = colors
        .map(|p| [shade(p.x), shade(p.y), shade(p.z), 255])
        .collect();
    if is_cloud {
        mesh.triangles.clear();
    }
    // Far from the world's zero.
    mesh.origin = DVec3::new(4.0e5, 5.0e6, 100.0);
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

fn paged(model: &Model) -> PagedFile {
    let bytes = to_bytes(model, &SMALL_PAGES).unwrap();
    let file = PagedFile::open(Arc::new(MemorySource::new("t.surfel", bytes))).unwrap();
    assert!(file.header().page_count > 60);
    file
}

fn opened(file: &PagedFile, memory_bytes: u64) -> PagedModel {
    let options = PagedModelOptions {
        memory_bytes,
        ..PagedModelOptions::default()
    };
    PagedModel::open(file.clone(), options).unwrap()
}

const ENOUGH: u64 = 1 << 30;

fn settings_of(splat: SplatKind, threshold_px: f32) -> Settings {
    Settings {
        splat,
        threshold_px,
        background: [0.1, 0.2, 0.3],
        ..Settings::default()
    }
}

fn picture(
    backend: &Backend,
    pages: PagedModel,
    view: &View,
    settings: &Settings,
) -> Option<(Image, Vec<String>)> {
    let stand_in = pages.stand_in().clone();
    let outputs = pictures::with_depth(false);
    let engine = Engine::new(backend, &stand_in, SIZE, outputs).unwrap();
    let mut engine = match backend {
        Backend::Reference => engine.with_subpixel_bits(crate::common::subpixel_bits()),
        _ => engine,
    };
    engine.set_pages(0, pages);
    let image = engine.render(view, settings).ok()?;
    Some((image, engine.take_page_messages()))
}

fn views(model: &Model) -> [(&'static str, View); 4] {
    let mut part = orbit(model, SIZE, 30.0, 20.0, 1.3);
    part.offset = [0.4, -0.3];
    [
        ("whole", orbit(model, SIZE, 40.0, 25.0, 1.0)),
        ("near", orbit(model, SIZE, 200.0, -15.0, 6.0)),
        ("part", part),
        ("orthographic", orthographic(model, SIZE)),
    ]
}

fn ways() -> Vec<(Settings, PictureOracle)> {
    use SplatKind::{Disc, Ellipse, Filtered, Gauss, Square};
    let splats = pictures::REFERENCE_SNAPPED_SPLATS;
    vec![
        (settings_of(Square, 1.0), pictures::REFERENCE_LAYERS),
        (settings_of(Square, 4.5), splats),
        (settings_of(Disc, 3.0), splats),
        (settings_of(Ellipse, 4.0), splats),
        (settings_of(Gauss, 4.0), pictures::REFERENCE_BLENDED),
        (settings_of(Filtered, 2.0), pictures::REFERENCE_FILTERED),
    ]
}

/// Draws every way by a backend, all pages there and with memory for few of them, and holds it to the reference.
fn hold_to_reference(backend: &Backend, path: Path) -> usize {
    let mut drawn = 0;
    for is_cloud in [false, true] {
        let model = statue(40_000, is_cloud);
        let file = paged(&model);
        for (name, view) in views(&model) {
            for (settings, oracle) in ways() {
                for memory in [ENOUGH, 1] {
                    let settings = Settings { path, ..settings };
                    let what = format!("{name}, cloud {is_cloud}, {memory}, {settings:?}");
                    let own = picture(backend, opened(&file, memory), &view, &settings);
                    let Some((own, messages)) = own else {
                        continue;
                    };
                    assert!(messages.is_empty(), "{messages:?}");
                    let plain = Settings {
                        path: Path::Auto,
                        ..settings
                    };
                    let wanted = picture(&Backend::Reference, opened(&file, memory), &view, &plain);
                    oracle.assert_same(&wanted.unwrap().0, &own, &what);
                    drawn += 1;
                }
            }
        }
    }
    drawn
}

#[test]
fn the_processor_draws_pages_as_the_reference_does() {
    // It has no fuzzy splats.
    assert_eq!(hold_to_reference(&Backend::Cpu, Path::Auto), 2 * 4 * 5 * 2);
}

#[test]
fn a_device_draws_pages_as_the_reference_does() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Vulkan(device.gpu().clone());
    for &path in device.paths() {
        let drawn = hold_to_reference(&backend, path);
        // Compute has no fuzzy splats of several parts.
        let kinds = if path == Path::Compute { 5 } else { 6 };
        assert_eq!(drawn, 2 * 4 * kinds * 2, "{path:?}");
    }
}

/// Makes a file with records of error patches, in small pages.
fn paged_with_patches(model: &Model) -> PagedFile {
    let bytes = to_bytes_with_patches(model, &SMALL_PAGES, &SilentProgress).unwrap();
    PagedFile::open(Arc::new(MemorySource::new("t.surfel", bytes))).unwrap()
}

/// Settings that draw patches within a tolerance, squares of a pixel beside them.
fn by_error(path: Path, tolerance_px: f32) -> Settings {
    Settings {
        path,
        patches: Some(PatchRules {
            tolerances: ErrorTolerances::within(tolerance_px),
            ..PatchRules::default()
        }),
        ..settings_of(SplatKind::Square, 1.0)
    }
}

#[test]
fn pages_are_drawn_by_error_as_the_joined_model_is() {
    let model = statue(40_000, false);
    let file = paged_with_patches(&model);
    let joined = whole_model(&file, &SilentProgress).unwrap();
    let mut fewer = 0;
    for (name, view) in views(&joined) {
        for tolerance_px in [0.5, 2.0] {
            let settings = by_error(Path::Auto, tolerance_px);
            let (own, messages) =
                picture(&Backend::Cpu, opened(&file, ENOUGH), &view, &settings).unwrap();
            assert!(messages.is_empty(), "{messages:?}");
            let outputs = pictures::with_depth(false);
            let wanted = pictures::draw(&Backend::Cpu, &joined, &view, &settings, outputs).unwrap();
            let (off, missing) = differences(&own, &wanted);
            let covered = wanted.color.iter().filter(|c| c[3] > 0).count();
            // Nodes at a limit of the cut may fall to the other side, as zeros are others.
            let what = format!("{name}, {tolerance_px}: {off} of {covered}, {missing} missing");
            assert!(
                covered > 5_000 && off <= covered / 100 && missing <= 2,
                "{what}"
            );
            // Fewer pages are needed than by size, and no hole appears while they are missing.
            let by_size = settings_of(SplatKind::Square, 1.0);
            let pages = |settings: &Settings| {
                let mut pages = opened(&file, ENOUGH);
                assert!(
                    pages
                        .load(&view, settings, &SilentProgress)
                        .unwrap()
                        .is_empty()
                );
                pages.resident_pages()
            };
            fewer += usize::from(pages(&settings) < pages(&by_size));
            let (few, _) = picture(&Backend::Cpu, opened(&file, 1), &view, &settings).unwrap();
            let (_, missing) = differences(&few, &own);
            assert!(missing <= 2, "{what}");
        }
    }
    assert!(fewer >= 2, "{fewer}");
}

#[test]
fn patches_of_pages_are_drawn_alike_by_all_and_refused_where_there_are_none() {
    let model = statue(40_000, false);
    let (file, plain) = (paged_with_patches(&model), paged(&model));
    let device = Device::open();
    let backends = [
        Some(Backend::Cpu),
        device
            .as_ref()
            .map(|own| Backend::Vulkan(own.gpu().clone())),
    ];
    for backend in backends.iter().flatten() {
        for (name, view) in views(&model) {
            for memory in [ENOUGH, 1] {
                let path = match backend {
                    Backend::Vulkan(_) => Path::Raster,
                    _ => Path::Auto,
                };
                let settings = by_error(path, 1.0);
                let own = picture(backend, opened(&file, memory), &view, &settings);
                let wanted = by_error(Path::Auto, 1.0);
                let wanted = picture(&Backend::Reference, opened(&file, memory), &view, &wanted);
                let (wanted, own) = (wanted.unwrap().0, own.unwrap().0);
                let (off, missing) = differences(&own, &wanted);
                let covered = wanted.color.iter().filter(|c| c[3] > 0).count();
                // Margins end square on the processor and round in the reference, as of whole models.
                let what = format!("{name}, {memory}: {off} of {covered}, {missing} missing");
                assert!(
                    covered > 5_000 && off * 30 < covered && missing <= 2,
                    "{what}"
                );
            }
        }
    }
    let view = orbit(&model, SIZE, 40.0, 25.0, 1.0);
    let mut pages = opened(&plain, ENOUGH);
    let refused = pages.load(&view, &by_error(Path::Auto, 1.0), &SilentProgress);
    assert!(refused.unwrap_err().to_string().contains("--patches"));
}

/// How many pixels differ by more than a few levels, and how many are covered in the second alone.
fn differences(one: &Image, two: &Image) -> (usize, usize) {
    let pixels = || one.color.iter().zip(&two.color);
    let is_off = |(a, b): &(&[u8; 4], &[u8; 4])| (0..3).any(|i| a[i].abs_diff(b[i]) > 4);
    let is_missing = |(a, b): &(&[u8; 4], &[u8; 4])| a[3] == 0 && b[3] > 0;
    (
        pixels().filter(is_off).count(),
        pixels().filter(is_missing).count(),
    )
}

#[test]
fn a_whole_picture_is_that_of_the_joined_model() {
    for is_cloud in [false, true] {
        let file = paged(&statue(60_000, is_cloud));
        let joined = whole_model(&file, &SilentProgress).unwrap();
        for (name, view) in views(&joined) {
            for splat in [SplatKind::Square, SplatKind::Filtered] {
                let settings = Settings {
                    occlusion: Occlusion::Off,
                    ..settings_of(splat, 2.0)
                };
                let (own, _) =
                    picture(&Backend::Cpu, opened(&file, ENOUGH), &view, &settings).unwrap();
                let outputs = pictures::with_depth(false);
                let wanted =
                    pictures::draw(&Backend::Cpu, &joined, &view, &settings, outputs).unwrap();
                let covered = wanted.color.iter().filter(|c| c[3] > 0).count();
                assert!(covered > 5_000);
                // Nodes at a limit of the cut may fall to the other side, as zeros are others. Which triangles are drawn as
                // filtered splats is decided for each page by itself.
                let share = if splat == SplatKind::Filtered {
                    20
                } else {
                    100
                };
                let (off, _) = differences(&own, &wanted);
                assert!(
                    off <= covered / share,
                    "{name}, cloud {is_cloud}, {splat:?}: {off} of {covered}"
                );
            }
        }
    }
}

/// Draws one frame of pages by the processor: the picture, and how many splats and triangles were drawn.
fn counted(file: &PagedFile, view: &View, settings: &Settings) -> (Image, u64) {
    let pages = opened(file, ENOUGH);
    let stand_in = pages.stand_in().clone();
    let outputs = pictures::with_depth(false);
    let mut engine = Engine::new(&Backend::Cpu, &stand_in, SIZE, outputs).unwrap();
    engine.set_pages(0, pages);
    let counts = engine.draw(view, settings).unwrap().counts;
    (engine.read(view).unwrap(), counts.splats + counts.triangles)
}

#[test]
fn what_other_pages_hide_is_left_out_and_no_pixel_changes() {
    let mut fewer = 0;
    for is_cloud in [false, true] {
        let model = statue(60_000, is_cloud);
        let file = paged(&model);
        for (name, view) in views(&model) {
            for threshold_px in [0.3, 3.0, 8.0] {
                // Rears are drawn too, so that there are several layers.
                let off = Settings {
                    occlusion: Occlusion::Off,
                    culling: Culling::Off,
                    ..settings_of(SplatKind::Square, threshold_px)
                };
                let on = Settings {
                    occlusion: Occlusion::On,
                    ..off
                };
                let (all, drawn) = counted(&file, &view, &off);
                let (seen, left) = counted(&file, &view, &on);
                let what = format!("{name}, cloud {is_cloud}, {threshold_px}: {left} of {drawn}");
                assert!(all.color == seen.color, "{what}");
                assert!(left <= drawn, "{what}");
                fewer += usize::from(left < drawn * 9 / 10);
            }
        }
    }
    // Small triangles are all drawn; of large splats upper pages draw some.
    assert!(fewer >= 4, "{fewer}");
}

#[test]
fn samples_that_are_pixels_of_a_larger_picture_are_those_of_shifted_views() {
    let model = statue(60_000, false);
    let file = paged(&model);
    for (name, view) in views(&model) {
        // 1 px of the larger picture, and squares for which there is none.
        for (threshold_px, most) in [(0.125, 60), (0.25, 60), (2.0, 0)] {
            let settings = settings_of(SplatKind::Square, threshold_px);
            let pages = opened(&file, ENOUGH);
            let stand_in = pages.stand_in().clone();
            let outputs = pictures::with_depth(false);
            let mut engine = Engine::new(&Backend::Cpu, &stand_in, SIZE, outputs).unwrap();
            engine.set_pages(0, pages);
            let own = engine.supersample(&view, &settings, 4).unwrap();
            let mut mean = PictureAccumulator::new();
            for i in 0..16 {
                let sample = engine.sample(&jittered(&view, i, 4), &settings).unwrap();
                mean.add(&sample).unwrap();
            }
            let wanted = mean.mean();
            let pixels = || own.color.iter().zip(&wanted.color);
            assert!(pixels().filter(|(own, _)| own[3] > 0.0).count() > 5_000);
            // What lies at a limit may be rounded to the other side.
            let is_off =
                |(a, b): &(&[f32; 4], &[f32; 4])| (0..4).any(|i| (a[i] - b[i]).abs() > 0.5 / 255.0);
            let off = pixels().filter(is_off).count();
            assert!(off <= most, "{name}, {threshold_px}: {off} pixels");
        }
    }
}

#[test]
fn a_prefix_of_the_file_is_a_coarse_whole_picture() {
    let model = statue(60_000, false);
    let file = paged(&model);
    let settings = settings_of(SplatKind::Square, 1.0);
    for (name, view) in views(&model) {
        let drawn = |options: PagedModelOptions| {
            let pages = PagedModel::open(file.clone(), options).unwrap();
            picture(&Backend::Cpu, pages, &view, &settings).unwrap().0
        };
        let (full, _) = picture(&Backend::Cpu, opened(&file, ENOUGH), &view, &settings).unwrap();
        let of_part = |part: f64| PagedModelOptions {
            prefix: Some(FilePrefix::Part(part)),
            ..PagedModelOptions::default()
        };
        let offs = [0.0, 0.1, 0.5, 1.0].map(|part| {
            let (off, missing) = differences(&drawn(of_part(part)), &full);
            assert_eq!(missing, 0, "{name}, {part}");
            off
        });
        // Within 2 percent of the picture.
        let slack = (SIZE.0 * SIZE.1 / 50) as usize;
        let falls = offs.windows(2).all(|two| two[1] <= two[0] + slack);
        assert!(falls && offs[0] > 2_000 && offs[3] == 0, "{name}: {offs:?}");
        // Nobody waits but for the first page.
        let at_once = PagedModelOptions {
            longest_wait: Some(Duration::ZERO),
            ..PagedModelOptions::default()
        };
        let (_, missing) = differences(&drawn(at_once), &full);
        assert_eq!(missing, 0, "{name}");
    }
}

#[test]
fn what_does_not_fit_memory_is_coarser_and_nothing_is_missing() {
    let model = statue(60_000, false);
    let file = paged(&model);
    let mut coarser = 0;
    for (name, view) in views(&model) {
        let settings = settings_of(SplatKind::Square, 1.0);
        let (full, _) = picture(&Backend::Cpu, opened(&file, ENOUGH), &view, &settings).unwrap();
        for memory in [1, 200_000, 600_000] {
            let mut pages = opened(&file, memory);
            assert!(
                pages
                    .load(&view, &settings, &SilentProgress)
                    .unwrap()
                    .is_empty()
            );
            // The first page is always there.
            let first = 120_000;
            assert!(pages.resident_bytes() <= memory.max(first), "{memory}");
            let (own, _) = picture(&Backend::Cpu, pages, &view, &settings).unwrap();
            let (off, missing) = differences(&own, &full);
            coarser += usize::from(off > 2_000);
            assert_eq!(missing, 0, "{name}, {memory}");
        }
    }
    assert!(coarser >= 6, "{coarser}");
}

/// Fails where it is told to.
#[derive(Debug)]
struct FaultySource {
    inner: MemorySource,
    /// Reads of this place and behind fail.
    from: u64,
    is_broken: AtomicBool,
}

impl ByteSource for FaultySource {
    fn name(&self) -> &str {
        self.inner.name()
    }

    fn len(&self) -> u64 {
        self.inner.len()
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> std::io::Result<()> {
        if offset >= self.from && self.is_broken.load(Ordering::Relaxed) {
            return Err(std::io::Error::other("no network"));
        }
        self.inner.read_at(offset, out)
    }
}

#[test]
fn pages_that_cannot_be_read_are_named_and_what_stands_for_them_is_drawn() {
    let model = statue(60_000, false);
    let bytes = to_bytes(&model, &SMALL_PAGES).unwrap();
    let view = orbit(&model, SIZE, 40.0, 25.0, 1.0);
    let settings = settings_of(SplatKind::Square, 1.0);
    let whole = PagedFile::open(Arc::new(MemorySource::new("t.surfel", bytes.clone()))).unwrap();
    let (full, _) = picture(&Backend::Cpu, opened(&whole, ENOUGH), &view, &settings).unwrap();
    // A source that stops in the middle.
    let source = FaultySource {
        from: bytes.len() as u64 * 3 / 4,
        inner: MemorySource::new("t.surfel", bytes.clone()),
        is_broken: AtomicBool::new(true),
    };
    let broken = PagedFile::open(Arc::new(source)).unwrap();
    let (own, messages) =
        picture(&Backend::Cpu, opened(&broken, ENOUGH), &view, &settings).unwrap();
    // One message, however many pages.
    assert!(
        messages.len() == 1 && messages[0].contains("no network"),
        "{messages:?}"
    );
    assert!(messages[0].contains("t.surfel"));
    let (off, missing) = differences(&own, &full);
    assert!(off > 500 && missing == 0, "{off} {missing}");
    // A page whose bytes are others.
    let mut damaged = bytes;
    let at = damaged.len() - 100;
    damaged[at] ^= 1;
    let file = PagedFile::open(Arc::new(MemorySource::new("t.surfel", damaged))).unwrap();
    let mut pages = opened(&file, ENOUGH);
    let both_sides = Settings {
        culling: Culling::Off,
        threshold_px: 0.0,
        ..settings
    };
    let messages = pages.load(&view, &both_sides, &SilentProgress).unwrap();
    assert!(
        messages.len() == 1 && messages[0].contains("checksum"),
        "{messages:?}"
    );
}

#[test]
fn several_files_and_models_are_drawn_together_and_can_be_hidden() {
    let first = statue(40_000, false);
    let mut mesh =
        surfel::generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Torus, 20_000).unwrap());
    mesh.origin = first.origin + DVec3::new(0.25, 0.5, -0.125);
    let second = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    let moved = second
        .clone()
        .moved_to(
            first.origin,
            &mut surfel::mesh::attributes::PointAttributes::default(),
            &SilentProgress,
        )
        .unwrap();
    let files = [paged(&first), paged(&second)];
    let joined = whole_model(&files[0], &SilentProgress).unwrap();
    let view = orbit(&first, SIZE, 40.0, 25.0, 0.7);
    let settings = Settings {
        occlusion: Occlusion::Off,
        ..settings_of(SplatKind::Square, 1.0)
    };
    let device = Device::open();
    let mut backends = vec![Backend::Cpu, Backend::Reference];
    backends.extend(
        device
            .as_ref()
            .map(|device| Backend::Vulkan(device.gpu().clone())),
    );
    for backend in backends {
        let pages = files
            .each_ref()
            .map(|file| opened(file, ENOUGH).moved_to(first.origin).unwrap());
        let stand_ins = pages.each_ref().map(|own| own.stand_in().clone());
        let all: Vec<&Model> = stand_ins.iter().collect();
        let outputs = pictures::with_depth(false);
        let mut engine = Engine::of_models(&backend, &all, SIZE, outputs).unwrap();
        for (index, own) in pages.into_iter().enumerate() {
            engine.set_pages(index, own);
        }
        let mut whole = Engine::of_models(&backend, &[&joined, &moved], SIZE, outputs).unwrap();
        for shown in [[true, true], [false, true], [true, true], [true, false]] {
            for (index, is_shown) in shown.into_iter().enumerate() {
                engine.show(index, is_shown);
                whole.show(index, is_shown);
            }
            let own = engine.render(&view, &settings).unwrap();
            let wanted = whole.render(&view, &settings).unwrap();
            let covered = wanted.color.iter().filter(|c| c[3] > 0).count();
            let (off, _) = differences(&own, &wanted);
            assert!(
                covered > 3_000 && off <= covered / 50,
                "{shown:?} {}: {off} of {covered}",
                backend.name()
            );
        }
    }
}

#[test]
fn methods_that_draw_all_of_a_model_are_refused_by_name() {
    let file = paged(&generated(GeneratedShape::Statue, 30_000));
    let view = orbit(opened(&file, ENOUGH).stand_in(), SIZE, 40.0, 25.0, 1.0);
    for method in [Method::Triangles, Method::Points, Method::Splats] {
        let settings = Settings {
            method,
            ..Settings::default()
        };
        let refused = opened(&file, ENOUGH).load(&view, &settings, &SilentProgress);
        let why = refused.unwrap_err().to_string();
        assert!(why.contains("paged") && why.contains("--method"), "{why}");
    }
}

#[test]
fn inside_a_closed_surface_its_inside_is_drawn() {
    let model = generated(GeneratedShape::Sphere, 60_000);
    let file = paged(&model);
    let settings = settings_of(SplatKind::Square, 1.0);
    for distance in [0.0, 0.5, 3.0] {
        let eye = DVec3::new(0.6, 0.4, 0.69).normalize() * distance;
        let at = eye - DVec3::new(0.5, 0.7, 0.5);
        let camera = Camera::look_at(SIZE, eye, at, DVec3::Y, 0.9, [0.05, 10.0]);
        let view = camera.view(model.origin).unwrap();
        let own = picture(&Backend::Cpu, opened(&file, ENOUGH), &view, &settings);
        let outputs = pictures::with_depth(false);
        let wanted = pictures::draw(&Backend::Cpu, &model, &view, &settings, outputs).unwrap();
        let covered = wanted.color.iter().filter(|c| c[3] > 0).count();
        let (off, missing) = differences(&own.unwrap().0, &wanted);
        assert!(
            covered > 3_000 && off < covered / 50 && missing < 20,
            "{off} {missing}"
        );
    }
}
