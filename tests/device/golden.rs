//! Pictures of every technique by every executor against pictures that were looked at and kept (`assets/golden`).
//!
//! The oracle says that device and mirror agree; only these say that all still draw what they drew. One golden is shared
//! by all executors that draw a case (`tests/device/golden/catalog.rs`), and is blessed by the rasterizer, not by the
//! host. A golden that is missing or of another size fails. `SURFEL_BLESS=1 cargo test --test device golden::` writes
//! those that are missing or past the tolerance: look at each before committing it. A failure leaves what was wanted,
//! what was got and eight times the difference in `target/golden-failures`.

pub(super) mod catalog;

use crate::common::Device;
use crate::common::pictures::{
    GOLDEN_DEVICE, GOLDEN_DEVICE_CUT, GOLDEN_PATCHES, GOLDEN_REFERENCE, PictureOracle,
};
use catalog::{GoldenCase, PictureExecutor, cases};
use std::path::{Path, PathBuf};
use surfel::generate::{GeneratedShape, ShapeSpec};
use surfel::gpu::device::DeviceKind;
use surfel::gpu::{DeviceOptions, Error};
use surfel::image::{FloatImage, Image, difference_picture};
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::cost::model::DrawCosts;
use surfel::render::engine::{Backend, Engine};
use surfel::tree::{self, BuildOptions, Model};

const SIDE: u32 = 128;

fn models() -> Vec<(&'static str, Model)> {
    let build = |spec: ShapeSpec| {
        let mesh = surfel::generate::mesh(&spec);
        tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
    };
    vec![
        (
            "statue",
            build(ShapeSpec::with_triangles(GeneratedShape::Statue, 20_000).unwrap()),
        ),
        (
            "torus",
            build(ShapeSpec::with_grid(GeneratedShape::Torus, 200, 50).unwrap()),
        ),
        ("scan", crate::common::scans(&[]).remove(0).1),
    ]
}

fn goldens() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/golden")
}

/// `target/golden-failures`, wherever the target folder is.
fn failures() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
        .parent()
        .unwrap()
        .join("golden-failures")
}

/// Compares a picture with its golden in `folder`; why it fails, if it does.
fn judge(
    folder: &Path,
    name: &str,
    got: &Image,
    oracle: PictureOracle,
    left: &Path,
) -> Result<String, String> {
    let file = folder.join(format!("{name}.png"));
    let leave = |suffix: &str, image: &Image| {
        std::fs::create_dir_all(left).unwrap();
        image
            .save_png_with_coverage(&left.join(format!("{name}-{suffix}.png")))
            .unwrap();
    };
    let Ok(wanted) = FloatImage::load(&file) else {
        leave("got", got);
        return Err(format!(
            "{name}: no golden {}; SURFEL_BLESS=1 writes it, then look at it",
            file.display()
        ));
    };
    let wanted = wanted.to_image();
    let why = match oracle.judge(&wanted, got) {
        Ok(line) => return Ok(format!("{name}: {line}")),
        Err(why) => why,
    };
    leave("wanted", &wanted);
    leave("got", got);
    if let Ok(difference) = difference_picture(&wanted, got, 8.0) {
        leave("difference", &difference);
    }
    Err(format!("{name}: {why}; see {}", left.display()))
}

/// Whether these passes are those of an executor of a device.
fn is_by(executor: PictureExecutor, passes: &[&str]) -> bool {
    let has = |name| passes.contains(&name);
    let by_compute = [
        "compute.clear",
        "fuzzy.clear",
        "filtered.clear",
        "visibility.clear",
        "polygons.clear",
    ];
    let is_by_compute = by_compute.iter().any(|name| has(name));
    match executor {
        PictureExecutor::Hardware => !is_by_compute && !passes.is_empty(),
        PictureExecutor::Compute => is_by_compute,
        PictureExecutor::Host | PictureExecutor::Reference => passes.is_empty(),
    }
}

/// The picture of a case, or `None` where the executor refuses it as the catalog says.
fn draw(
    engine: &mut Engine<'_>,
    model: &Model,
    case: &GoldenCase,
    by: PictureExecutor,
) -> Result<Option<Image>, String> {
    let [azimuth, elevation, fill] = case.orbit;
    let view = crate::common::orbit(model, (SIDE, SIDE), azimuth, elevation, fill);
    let drawn = engine.draw(&view, &by.insist(&case.settings));
    let refusal = case.refusal(by);
    let times = match (drawn, refusal) {
        (Ok(times), _) => times,
        (Err(Error::Unsupported { why, .. }), Some(refusal)) if why.contains(refusal.words) => {
            return Ok(None);
        }
        (Err(error), _) => return Err(format!("{}, {by:?}: {error}", case.name)),
    };
    let passes: Vec<&str> = times.passes.iter().map(|pass| pass.name).collect();
    // Triangles alone are the rasterizer's by every path.
    let has_splats = times.counts.splats > 0 || by == PictureExecutor::Host;
    if has_splats && is_by(by, &passes) == refusal.is_some() {
        return Err(format!(
            "{}, {by:?}: {refusal:?}, drawn by {passes:?}",
            case.name
        ));
    }
    match refusal {
        Some(_) => Ok(None),
        None => Ok(Some(engine.read(&view).unwrap())),
    }
}

/// Draws every case by one executor and compares.
fn draws_the_goldens(backend: &Backend, by: PictureExecutor, oracle: PictureOracle) {
    let is_blessing = std::env::var("SURFEL_BLESS").is_ok_and(|v| v == "1");
    let left = failures().join(format!("{by:?}"));
    let (mut wrong, mut drawn) = (Vec::new(), 0);
    for (model_name, model) in models() {
        let mut engine =
            Engine::new(backend, &model, (SIDE, SIDE), PictureOutputs::default()).unwrap();
        for case in cases()
            .into_iter()
            .filter(|case| case.is_kept_of(model_name))
        {
            let name = format!("{model_name}-{}", case.name);
            let image = match draw(&mut engine, &model, &case, by) {
                Ok(Some(image)) => image,
                Ok(None) => {
                    println!("{name}: refused, {}", case.refusal(by).unwrap().words);
                    continue;
                }
                Err(why) => {
                    wrong.push(why);
                    continue;
                }
            };
            drawn += 1;
            let are_patches = case.name.starts_with("patches") && by == PictureExecutor::Host;
            let oracle = if are_patches { GOLDEN_PATCHES } else { oracle };
            let mut verdict = judge(&goldens(), &name, &image, oracle, &left);
            if is_blessing && verdict.is_err() && case.blessed_by() == Some(by) {
                std::fs::create_dir_all(goldens()).unwrap();
                let file = goldens().join(format!("{name}.png"));
                image.save_png_with_coverage(&file).unwrap();
                println!("{name} is written");
                verdict = judge(&goldens(), &name, &image, oracle, &left);
            }
            match verdict {
                Ok(row) => println!("{row}"),
                Err(why) => wrong.push(why),
            }
        }
    }
    println!("{drawn} pictures by {by:?}");
    assert!(wrong.is_empty(), "{by:?}: {wrong:#?}");
    assert!(drawn >= 16, "{by:?}: {drawn}");
}

fn all_names() -> Vec<String> {
    let mut names: Vec<String> = ["statue", "torus", "scan"]
        .iter()
        .flat_map(|model| {
            let kept = cases().into_iter().filter(|case| case.is_kept_of(model));
            kept.map(move |case| format!("{model}-{}.png", case.name))
        })
        .collect();
    names.sort();
    names
}

#[test]
fn the_rasterizer_draws_the_goldens() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Vulkan(device.gpu().clone());
    draws_the_goldens(&backend, PictureExecutor::Hardware, GOLDEN_DEVICE);
}

#[test]
fn compute_draws_the_goldens() {
    let Some(device) = Device::open() else { return };
    if !device.gpu().info().has_int64_atomics {
        println!("no 64-bit atomics: what compute draws is not tested");
        return;
    }
    let backend = Backend::Vulkan(device.gpu().clone());
    draws_the_goldens(&backend, PictureExecutor::Compute, GOLDEN_DEVICE);
}

/// What is chosen for a device with memory of its own: lists of ids, cuts on the device, drawn by compute. A software device
/// is told that it is one, and that it cuts sooner than the host.
#[test]
fn what_a_graphics_card_is_asked_for_are_the_goldens() {
    let options = DeviceOptions {
        narrowed: Some(|info| info.kind = DeviceKind::Discrete),
        ..DeviceOptions::default()
    };
    let Some(device) = Device::open_with(options) else {
        return;
    };
    let backend = Backend::Vulkan(device.gpu().clone());
    let cuts_sooner = DrawCosts {
        node_ns: Some(4.0),
        device_node_ns: Some(1.0),
        ..DrawCosts::default()
    };
    let left = failures().join("Card");
    let (mut by_ids, mut by_cut, mut wrong) = (0, 0, Vec::new());
    for (model_name, model) in models() {
        for costs in [None, Some(cuts_sooner)] {
            let mut engine =
                Engine::new(&backend, &model, (SIDE, SIDE), PictureOutputs::default()).unwrap();
            engine.set_costs(costs);
            for case in cases() {
                let refused = case.refusal(PictureExecutor::Hardware).is_some();
                if refused || !case.is_kept_of(model_name) {
                    continue;
                }
                let [azimuth, elevation, fill] = case.orbit;
                let view = crate::common::orbit(&model, (SIDE, SIDE), azimuth, elevation, fill);
                let times = engine.draw(&view, &case.settings).unwrap();
                let has = |name: &str| times.passes.iter().any(|pass| pass.name.starts_with(name));
                by_ids += usize::from(has("lists."));
                by_cut += usize::from(has("cut.tree"));
                let image = engine.read(&view).unwrap();
                let name = format!("{model_name}-{}", case.name);
                let oracle = match has("cut.tree") {
                    true => GOLDEN_DEVICE_CUT,
                    false => GOLDEN_DEVICE,
                };
                let verdict = judge(&goldens(), &name, &image, oracle, &left);
                wrong.extend(verdict.err());
            }
        }
    }
    println!("{by_ids} pictures of lists of ids, {by_cut} of cuts on the device");
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(by_ids >= 20 && by_cut >= 10, "{by_ids}, {by_cut}");
}

#[test]
fn the_processor_draws_the_goldens() {
    draws_the_goldens(&Backend::Cpu, PictureExecutor::Host, GOLDEN_DEVICE);
}

#[test]
fn the_mirror_draws_the_goldens() {
    draws_the_goldens(
        &Backend::Reference,
        PictureExecutor::Reference,
        GOLDEN_REFERENCE,
    );
}

#[test]
fn every_golden_has_a_case_and_is_small() {
    let mut found: Vec<String> = std::fs::read_dir(goldens())
        .unwrap()
        .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| name.ends_with(".png"))
        .collect();
    found.sort();
    assert_eq!(found, all_names());
    for name in found {
        let bytes = goldens().join(&name).metadata().unwrap().len();
        assert!(bytes <= 64 << 10, "{name} has {bytes} bytes");
    }
}

/// The judge itself: it must be able to say no.
#[test]
fn differences_past_the_tolerance_are_seen() {
    let folder = tempfile::tempdir().unwrap();
    let left = folder.path().join("left");
    let wanted = Image::filled(SIDE, SIDE, [100, 100, 100, 255]);
    let judged =
        |image: &Image, oracle: PictureOracle| judge(folder.path(), "a", image, oracle, &left);
    assert!(
        judged(&wanted, GOLDEN_DEVICE)
            .unwrap_err()
            .contains("no golden")
    );
    assert!(
        !folder.path().join("a.png").exists(),
        "a missing golden is not written"
    );
    wanted
        .save_png_with_coverage(&folder.path().join("a.png"))
        .unwrap();
    judged(&wanted, GOLDEN_DEVICE).unwrap();
    let changed = |count: u64, color: [u8; 4]| {
        let mut image = wanted.clone();
        (0..count).for_each(|i| image.color[37 * i as usize] = color);
        image
    };
    for oracle in [GOLDEN_DEVICE, GOLDEN_REFERENCE] {
        let n = oracle.rules[0].allowed.of(&wanted) as u64;
        judged(&changed(10_000 / 37, [100, 101, 99, 255]), oracle).unwrap();
        judged(&changed(n, [100, 102, 100, 255]), oracle).unwrap();
        judged(&changed(n + 1, [100, 102, 100, 255]), oracle).unwrap_err();
        judged(&changed(n, [100, 100, 100, 0]), oracle).unwrap();
        judged(&changed(n + 1, [100, 100, 100, 0]), oracle).unwrap_err();
    }
    std::fs::remove_dir_all(&left).unwrap();
    judged(&changed(200, [0, 0, 0, 255]), GOLDEN_DEVICE).unwrap_err();
    for suffix in ["wanted", "got", "difference"] {
        let image = FloatImage::load(&left.join(format!("a-{suffix}.png"))).unwrap();
        assert_eq!((image.width, image.height), (SIDE, SIDE), "{suffix}");
    }
    let narrow = Image::filled(SIDE, SIDE - 1, [100, 100, 100, 255]);
    judged(&narrow, GOLDEN_DEVICE).unwrap_err();
}
