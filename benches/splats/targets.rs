//! Every figure that splats must reach, in one run.

use super::passes::{self, PULL_PUSH_TARGET_MS, least};
use super::{
    FUZZY_TARGET_NS, engine, frames, generated, models, orbit, real, splats, triangles, vertices,
};
use bytemuck::Zeroable;
use std::time::Instant;
use surfel::abi::WeightedSplat;
use surfel::cut::{Cut, CutSelector};
use surfel::generate::{self, GeneratedShape, ShapeSpec};
use surfel::image::{FloatImage, Image, compare};
use surfel::math::camera::View;
use surfel::pack;
use surfel::pack::FuzzyList;
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::cut_key::cut_settings;
use surfel::render::engine::{Backend, Engine, style};
use surfel::render::pack_params::splat_plan;
use surfel::render::reference::{BlendPasses, render_fuzzy};
use surfel::render::{Blend, Method, Reconstruction, Settings, SplatKind};
use surfel::tree::{self, BuildOptions, Model};

/// What was printed so far.
#[derive(Default)]
struct Tally {
    met: u32,
    missed: Vec<String>,
}

enum Target {
    AtMost(f64),
    AtLeast(f64),
    /// Printed for comparison.
    None,
}
use Target::{AtLeast, AtMost};

impl Tally {
    fn row(&mut self, name: &str, value: f64, unit: &str, target: &Target) {
        let (is_met, text) = match target {
            Target::None => {
                println!("{name:<66} {value:>9.3} {unit}");
                return;
            }
            AtMost(most) => (value <= *most, format!("at most {most:.3}")),
            AtLeast(least) => (value >= *least, format!("at least {least:.3}")),
        };
        let verdict = if is_met { "met" } else { "MISSED" };
        println!("{name:<66} {value:>9.3} {unit:<6} {text}: {verdict}");
        if is_met {
            self.met += 1;
        } else {
            self.missed.push(name.to_owned());
        }
    }
}

/// Prints every figure with its target, and which were missed; of the parts whose names contain `only`.
pub(super) fn all(backend: &Backend, only: Option<&str>) {
    let start = Instant::now();
    let mut tally = Tally::default();
    type Part = fn(&Backend, &mut Tally);
    let parts: [(&str, Part); 6] = [
        ("error of gauss, 400 x 400, three views", errors),
        ("holes in 100 views of 200 x 200", holes),
        ("filtered splats at threshold 1", filtered),
        ("one color stays that color", flat),
        ("cost", cost),
        ("the same picture again", identity),
    ];
    for (name, part) in parts {
        if only.is_some_and(|only| !name.contains(only)) {
            continue;
        }
        println!("\n{name}");
        let begun = Instant::now();
        part(backend, &mut tally);
        println!("  ({:.0} s)", begun.elapsed().as_secs_f64());
    }
    println!(
        "\n{} met, {} MISSED, in {:.0} s",
        tally.met,
        tally.missed.len(),
        start.elapsed().as_secs_f64()
    );
    for name in &tally.missed {
        println!("  MISSED: {name}");
    }
}

/// Root of the mean squared error over object pixels, levels of 255.
fn rmse(reference: &FloatImage, picture: &Image) -> f64 {
    let difference = compare(reference, picture, 8.0).expect("pictures of one size");
    255.0 * difference.object.rmse
}

fn psnr(reference: &FloatImage, picture: &Image) -> f64 {
    let difference = compare(reference, picture, 8.0).expect("pictures of one size");
    difference.object.psnr_db
}

fn truth(engine: &mut Engine<'_>, view: &View) -> FloatImage {
    engine
        .supersample(view, &triangles(), 4)
        .expect("a reference")
}

/// From squares to Gaussians the error at least halves; the floor is what one exact sample a pixel errs by.
fn errors(backend: &Backend, tally: &mut Tally) {
    let size = (400, 400);
    for (name, model) in models(None) {
        let mut engine = engine(backend, &model, size);
        let views: Vec<View> = (0..3).map(|k| orbit(&model, size, 0.9, k, 3)).collect();
        let truths: Vec<FloatImage> = views.iter().map(|v| truth(&mut engine, v)).collect();
        let mut mean = |settings: &Settings| {
            let sum: f64 = views
                .iter()
                .zip(&truths)
                .map(|(view, truth)| rmse(truth, &engine.render(view, settings).expect("a frame")))
                .sum();
            sum / views.len() as f64
        };
        let floor = mean(&triangles());
        tally.row(
            &format!("{name}: one exact sample, the floor"),
            floor,
            "levels",
            &Target::None,
        );
        for threshold in [2.0, 3.0] {
            let square = mean(&splats(SplatKind::Square, Blend::Opaque, threshold));
            let gauss = mean(&splats(SplatKind::Gauss, Blend::TwoPass, threshold));
            tally.row(
                &format!("{name}, threshold {threshold}: gauss (squares {square:.2})"),
                gauss,
                "levels",
                &AtMost(square / 2.0),
            );
        }
    }
}

/// A surface that is closed has no holes; one that is not, none that its triangles do not have.
fn holes(backend: &Backend, tally: &mut Tally) {
    let size = (200, 200);
    let kinds = [
        ("square", SplatKind::Square, Blend::Opaque),
        ("disc", SplatKind::Disc, Blend::Opaque),
        ("ellipse", SplatKind::Ellipse, Blend::Opaque),
        ("gauss", SplatKind::Gauss, Blend::TwoPass),
    ];
    let mut all = vec![
        ("sphere", Some(generated(GeneratedShape::Sphere, 100_000))),
        ("statue", Some(generated(GeneratedShape::Statue, 200_000))),
    ];
    for (name, file) in [
        ("horse", "thesis/horse.ply"),
        ("bunny", "meshes/bun_zipper.ply.gz"),
    ] {
        all.push((name, real(file)));
    }
    for (name, model) in all {
        let Some(model) = model else {
            println!("{name} is absent");
            continue;
        };
        let mut engine = engine(backend, &model, size);
        let mut counts = [0u64; 4];
        for k in 0..100 {
            let view = orbit(&model, size, [0.9, 0.4, 2.0][k as usize % 3], k, 100);
            let reference = engine.render(&view, &triangles()).expect("a reference");
            let threshold = 1.0 + (k % 16) as f32;
            for (count, (_, kind, blend)) in counts.iter_mut().zip(kinds) {
                let picture = engine
                    .render(&view, &splats(kind, blend, threshold))
                    .expect("a frame");
                let difference = compare(&reference, &picture, 8.0).expect("pictures of one size");
                *count += difference.hole_pixels;
            }
        }
        let what = if model.is_closed {
            "closed"
        } else {
            "open, against its triangles"
        };
        for ((kind, ..), count) in kinds.iter().zip(counts) {
            tally.row(
                &format!("{name} ({what}), thresholds 1 to 16: {kind}"),
                count as f64,
                "pixels",
                &AtMost(0.0),
            );
        }
    }
}

/// The statue of 8 million triangles at three distances, and smooth models beside one exact sample.
fn filtered(backend: &Backend, tally: &mut Tally) {
    let kind = Settings {
        splat: SplatKind::Filtered,
        ..Settings::default()
    };
    let size = (500, 500);
    let statue = generated(GeneratedShape::Statue, 8_000_000);
    let mut drawn = engine(backend, &statue, size);
    for (fill, target) in [(1.0, 30.0), (0.5, 29.0), (0.125, 28.0)] {
        let view = orbit(&statue, size, fill, 0, 9);
        let truth = truth(&mut drawn, &view);
        let exact = psnr(&truth, &drawn.render(&view, &triangles()).expect("a frame"));
        let picture = drawn.render(&view, &kind).expect("a frame");
        tally.row(
            &format!("statue 8 M, fill {fill} (one exact sample {exact:.1})"),
            psnr(&truth, &picture),
            "dB",
            &AtLeast(target),
        );
    }
    drop(drawn);
    drop(statue);
    let mut smooth = vec![
        ("sphere", Some(generated(GeneratedShape::Sphere, 200_000))),
        ("torus", Some(generated(GeneratedShape::Torus, 500_000))),
    ];
    for (name, file) in [
        ("bunny", "meshes/bun_zipper.ply.gz"),
        ("horse", "thesis/horse.ply"),
    ] {
        smooth.push((name, real(file)));
    }
    let size = (300, 300);
    for (name, model) in smooth {
        let Some(model) = model else {
            println!("{name} is absent");
            continue;
        };
        let mut drawn = engine(backend, &model, size);
        for fill in [1.0, 0.5, 0.125] {
            let view = orbit(&model, size, fill, 0, 9);
            let truth = truth(&mut drawn, &view);
            let exact = psnr(&truth, &drawn.render(&view, &triangles()).expect("a frame"));
            let picture = drawn.render(&view, &kind).expect("a frame");
            // Of two pictures with the same error either may come out ahead by a tenth.
            tally.row(
                &format!("{name}, fill {fill}: no worse than one exact sample"),
                psnr(&truth, &picture),
                "dB",
                &AtLeast(exact - 0.1),
            );
        }
    }
}

/// Largest difference within a picture of a surface of one color, by every kind that is blended.
fn flat(backend: &Backend, tally: &mut Tally) {
    let size = (300, 300);
    for (name, shape) in [
        ("plane", GeneratedShape::Square),
        ("sphere", GeneratedShape::Sphere),
    ] {
        let spec = ShapeSpec::with_triangles(shape, 100_000).expect("a valid size");
        let mut mesh = generate::mesh(&spec);
        // Without normals everything is lit alike.
        mesh.triangles.clear();
        mesh.normals.clear();
        mesh.colors = vec![[200, 150, 100, 255]; mesh.positions.len()];
        let model =
            tree::build(mesh, &BuildOptions::default(), &SilentProgress).expect("the tree builds");
        let mut drawn = engine(backend, &model, size);
        let view = orbit(&model, size, 0.9, 0, 9);
        for kind in [
            SplatKind::Square,
            SplatKind::Disc,
            SplatKind::Ellipse,
            SplatKind::Gauss,
        ] {
            let mut worst = 0;
            for threshold in [1.0, 2.0, 3.0, 8.0] {
                let picture = drawn
                    .render(&view, &splats(kind, Blend::TwoPass, threshold))
                    .expect("a frame");
                let shown = picture.color.iter().filter(|c| c[3] > 0);
                assert!(shown.clone().count() > 10_000, "nothing is shown");
                for color in shown {
                    // 0.8 times the color.
                    let off = [160u8, 120, 80]
                        .iter()
                        .zip(color)
                        .map(|(a, b)| a.abs_diff(*b));
                    worst = worst.max(off.max().unwrap_or(0));
                }
            }
            tally.row(
                &format!("{name}, {kind:?} in two passes, thresholds 1 to 8"),
                f64::from(worst),
                "levels",
                &AtMost(1.0),
            );
        }
    }
}

fn cost(backend: &Backend, tally: &mut Tally) {
    let size = (1024, 768);
    // One vertex for two triangles.
    let model = generated(GeneratedShape::Statue, 1_000_000);
    let mut drawn = engine(backend, &model, size);
    let view = orbit(&model, size, 1.0, 0, 3);
    // A disc of four pixels.
    let settings = vertices(SplatKind::Gauss, Blend::TwoPass, 2.26);
    let runs = frames(&mut drawn, &view, &settings);
    let all: Vec<f64> = runs
        .iter()
        .map(|run| run.passes.iter().map(|p| p.ms).sum())
        .collect();
    let count = runs[0].counts.points as f64;
    tally.row(
        &format!("three fuzzy passes, {count} splats of 4 pixels, a splat"),
        least(&all) * 1e6 / count,
        "ns",
        &AtMost(FUZZY_TARGET_NS),
    );
    drop(drawn);
    let model = generated(GeneratedShape::Statue, 2_000_000);
    let mut drawn = engine(backend, &model, size);
    let view = orbit(&model, size, 1.0, 0, 3);
    for threshold in [1.0, 3.0, 8.0] {
        let found = passes::times(
            &mut drawn,
            &view,
            threshold,
            &[Reconstruction::PullPush],
            11,
        );
        tally.row(
            &format!("pull-push, 1024 x 768, threshold {threshold}"),
            least(&found[0][2]),
            "ms",
            &AtMost(PULL_PUSH_TARGET_MS),
        );
    }
}

/// Two frames are equal to the bit, and the order of the splats does not matter.
fn identity(backend: &Backend, tally: &mut Tally) {
    let size = (300, 300);
    let model = generated(GeneratedShape::Statue, 300_000);
    let view = orbit(&model, size, 0.9, 0, 9);
    let pictures = |settings: &Settings| {
        let mut drawn = engine(backend, &model, size);
        // Another view between, so that nothing is left over from the first frame.
        let first = drawn.render(&view, settings).expect("a frame");
        let other = orbit(&model, size, 0.5, 4, 9);
        drawn.render(&other, settings).expect("a frame");
        (first, drawn.render(&view, settings).expect("a frame"))
    };
    for kind in [
        SplatKind::Square,
        SplatKind::Disc,
        SplatKind::Ellipse,
        SplatKind::Gauss,
        SplatKind::Visibility,
        SplatKind::Filtered,
    ] {
        let settings = Settings {
            splat: kind,
            threshold_px: 3.0,
            ..Settings::default()
        };
        let (first, second) = pictures(&settings);
        let differing = first
            .color
            .iter()
            .zip(&second.color)
            .filter(|(a, b)| a != b);
        tally.row(
            &format!("{kind:?}: the frame again"),
            differing.count() as f64,
            "pixels",
            &AtMost(0.0),
        );
    }
    tally.row(
        "gauss, 20 orders of its splats (mirror)",
        f64::from(order_sensitivity(&model, &view)),
        "levels",
        &AtMost(1.0),
    );
}

/// Largest difference that the order of splats makes in two passes, levels.
fn order_sensitivity(model: &Model, view: &View) -> u8 {
    let settings = Settings {
        method: Method::Splats,
        ..splats(SplatKind::Gauss, Blend::TwoPass, 3.0)
    };
    let (mut selector, mut cut) = (CutSelector::default(), Cut::default());
    selector.select(model, view, &cut_settings(&settings, model), &mut cut);
    let plan = splat_plan(&settings, f32::INFINITY);
    let mut list = vec![WeightedSplat::zeroed(); pack::splats::count(&cut, &plan)];
    let packed = pack::splats::pack(model, &cut, view, &plan, &mut list);
    list.truncate(packed.points);
    let style = style(&settings, model);
    let picture = |splats: &[WeightedSplat]| {
        let list = FuzzyList {
            splats,
            has_coverage: settings.sums_coverage(true),
            ..FuzzyList::default()
        };
        render_fuzzy(
            view,
            &list,
            &style,
            BlendPasses::Two,
            PictureOutputs::default(),
        )
        .image
    };
    let first = picture(&list);
    let mut state = 1u64;
    let mut worst = 0;
    for _ in 0..20 {
        // Fisher and Yates, with a linear congruential generator.
        for i in (1..list.len()).rev() {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            list.swap(i, (state >> 33) as usize % (i + 1));
        }
        let other = picture(&list);
        for (a, b) in first.color.iter().zip(&other.color) {
            let off = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max();
            worst = worst.max(off.unwrap_or(0));
        }
    }
    worst
}
