//! The picture oracles of `tests/common/pictures.rs`, each seen to fail: an oracle that cannot say no proves nothing.

use crate::common::pictures::{self, PictureOracle, PictureRule, PixelAspect};
use crate::common::{generated, orbit};
use surfel::generate::GeneratedShape;
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::pack::{ALBEDO, Phong, SurfaceLighting};
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Blend, Culling, Settings, SplatKind};
use surfel::tree::Model;

const SIZE: (u32, u32) = (160, 140);

/// A picture of the reference renderer, with depths and normals.
fn reference(model: &Model, view: &View, settings: &Settings) -> Image {
    let outputs = pictures::with_depth(true);
    pictures::draw(&Backend::Reference, model, view, settings, outputs).unwrap()
}

/// Opaque discs among triangles.
fn usual() -> Settings {
    Settings {
        splat: SplatKind::Disc,
        threshold_px: 3.0,
        background: [0.1, 0.2, 0.3],
        ..Settings::default()
    }
}

/// Judges, and sees that the panic of [`PictureOracle::assert_same`] and the verdict agree.
fn says_no(oracle: &PictureOracle, wanted: &Image, got: &Image) -> bool {
    let verdict = oracle.judge(wanted, got);
    let panics = std::panic::catch_unwind(|| oracle.assert_same(wanted, got, "watched"));
    assert_eq!(verdict.is_err(), panics.is_err(), "{verdict:?}");
    verdict.is_err()
}

/// One constant of the reference itself is another one, by a twentieth: every oracle has to say no.
#[test]
fn every_oracle_sees_another_constant_of_the_reference() {
    let model = generated(GeneratedShape::Statue, 20_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.0);
    let drawn = |albedo| {
        let outputs = pictures::with_depth(true);
        let engine = Engine::new(&Backend::Reference, &model, SIZE, outputs).unwrap();
        let mut engine = engine.with_wrong_albedo(albedo);
        engine.render(&view, &usual()).unwrap()
    };
    let wanted = drawn(ALBEDO);
    assert!(wanted == reference(&model, &view, &usual()));
    let got = drawn(0.95 * ALBEDO);
    for oracle in pictures::ALL {
        let oracle = oracle.seen_in(&view);
        assert!(!says_no(&oracle, &wanted, &wanted), "{}", oracle.name);
        assert!(says_no(&oracle, &wanted, &got), "{}", oracle.name);
    }
}

/// One of the reference's inputs is another one: every oracle has to say no.
#[test]
fn every_oracle_sees_another_input_of_the_reference() {
    let model = generated(GeneratedShape::Statue, 20_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 1.0);
    let blended = Settings {
        splat: SplatKind::Gauss,
        blend: Some(Blend::TwoPass),
        // The far side is there as well, for the offset to let through.
        culling: Culling::Off,
        ..usual()
    };
    let mut shifted = view;
    shifted.offset[0] += 4.0 / SIZE.0 as f32;
    let changes = [
        (
            "splat size",
            usual(),
            view,
            Settings {
                threshold_px: 6.0,
                ..usual()
            },
        ),
        (
            "depth offset",
            blended,
            view,
            Settings {
                depth_offset: Some(1000.0),
                ..blended
            },
        ),
        (
            "background",
            usual(),
            view,
            Settings {
                background: [0.1, 0.2, 0.31],
                ..usual()
            },
        ),
        (
            "light",
            usual(),
            view,
            Settings {
                light: SurfaceLighting::Phong(Phong::default()),
                ..usual()
            },
        ),
        ("view, by two pixels", usual(), shifted, usual()),
    ];
    for (name, before, changed_view, after) in changes {
        let wanted = reference(&model, &view, &before);
        let got = reference(&model, &changed_view, &after);
        for oracle in pictures::ALL {
            let oracle = oracle.seen_in(&view);
            let what = format!("{}, {name}", oracle.name);
            assert!(
                wanted.covered_pixels() as usize > oracle.more_than,
                "{what}: the picture is too empty"
            );
            assert!(!says_no(&oracle, &wanted, &wanted), "{what}: the same");
            assert!(says_no(&oracle, &wanted, &got), "{what}: not seen");
        }
    }
}

/// The aspects that a rule counts, one by one.
fn leaves(aspect: PixelAspect) -> Vec<PixelAspect> {
    match aspect {
        PixelAspect::Any(aspects) => aspects.iter().flat_map(|&one| leaves(one)).collect(),
        one => vec![one],
    }
}

/// Changes pixel `i` in one aspect: just past what the rule calls different, or else just within it.
fn plant(aspect: PixelAspect, is_past: bool, footprint: f32, image: &mut Image, i: usize) {
    let share = |limit: f32| limit * if is_past { 1.2 } else { 0.8 };
    let level = |value: u8, limit: u8| {
        let by = limit + u8::from(is_past);
        value.checked_sub(by).unwrap_or(value.saturating_add(by))
    };
    let depth = image.depth[i];
    match aspect {
        PixelAspect::Color(limit) => image.color[i][1] = level(image.color[i][1], limit),
        PixelAspect::Coverage(limit) => image.color[i][3] = level(image.color[i][3], limit),
        PixelAspect::DepthBits if is_past => image.depth[i] = f32::from_bits(depth.to_bits() ^ 1),
        PixelAspect::DepthShare(limit) => image.depth[i] += share(limit) * depth,
        PixelAspect::DepthFootprint(limit) => image.depth[i] += share(limit) * footprint,
        // Of a pixel without any step to its neighbors, see [`flat_picture`].
        PixelAspect::DepthSlope => image.depth[i] += share(2e-5) * depth,
        PixelAspect::NormalBits if is_past => {
            image.normal[i][0] = f32::from_bits(image.normal[i][0].to_bits() ^ 1);
        }
        PixelAspect::Normal(limit) => image.normal[i][0] += share(limit),
        PixelAspect::DepthBits | PixelAspect::NormalBits => {}
        PixelAspect::Any(_) => unreachable!("of a leaf"),
    }
}

/// A picture of a plane, all of it covered, each pixel as deep as its neighbors.
fn flat_picture() -> Image {
    Image {
        depth: vec![2.5; (SIZE.0 * SIZE.1) as usize],
        normal: vec![[0.0, 0.6, 0.8]; (SIZE.0 * SIZE.1) as usize],
        ..Image::filled(SIZE.0, SIZE.1, [120, 90, 200, 255])
    }
}

/// Whether the verdict calls this rule broken.
fn is_broken(oracle: &PictureOracle, rule: usize, wanted: &Image, got: &Image) -> bool {
    let (Ok(line) | Err(line)) = oracle.judge(wanted, got);
    line.split("; ").nth(rule + 1).unwrap().ends_with("BROKEN")
}

/// Every rule of every oracle: as many pixels as are allowed pass, one more does not; and what is within the tolerance
/// passes everywhere.
#[test]
fn every_rule_breaks_at_its_own_number() {
    let model = generated(GeneratedShape::Sphere, 200);
    let view = orbit(&model, SIZE, 0.0, 0.0, 1.0);
    let footprint = view.far / view.focal_px();
    let wanted = flat_picture();
    let mut count = 0;
    for oracle in pictures::ALL {
        let oracle = oracle.seen_in(&view);
        for (index, PictureRule { aspect, allowed }) in oracle.rules.iter().enumerate() {
            let allowed = allowed.of(&wanted);
            for leaf in leaves(*aspect) {
                let what = format!("{}: {leaf:?}, {allowed} allowed", oracle.name);
                let with = |pixels: usize, is_past: bool| {
                    let mut got = wanted.clone();
                    (0..pixels).for_each(|i| plant(leaf, is_past, footprint, &mut got, i));
                    got
                };
                let is_broken = |got| is_broken(&oracle, index, &wanted, &got);
                assert!(!is_broken(with(allowed, true)), "{what}: too strict");
                assert!(is_broken(with(allowed + 1, true)), "{what}: not seen");
                assert!(
                    !is_broken(with(wanted.color.len(), false)),
                    "{what}: sees less than it says"
                );
                assert!(says_no(&oracle, &wanted, &with(allowed + 1, true)));
                count += 1;
            }
        }
    }
    assert!(count > 60, "{count} rules");
}

#[test]
fn pictures_that_prove_nothing_are_refused() {
    let model = generated(GeneratedShape::Sphere, 200);
    let view = orbit(&model, SIZE, 0.0, 0.0, 1.0);
    let full = flat_picture();
    let mut empty = full.clone();
    empty.color.iter_mut().for_each(|color| color[3] = 0);
    let mut holes = full.clone();
    holes.depth[7] = f32::INFINITY;
    let mut wrong = full.clone();
    wrong.normal[7] = [f32::NAN; 3];
    let bare = Image {
        depth: Vec::new(),
        ..full.clone()
    };
    let mut narrow = full.clone();
    (narrow.width, narrow.height) = (SIZE.1, SIZE.0);
    for oracle in pictures::ALL {
        let oracle = oracle.seen_in(&view);
        assert!(says_no(&oracle, &empty, &empty), "{}", oracle.name);
        assert!(says_no(&oracle, &full, &bare), "{}", oracle.name);
        assert!(says_no(&oracle, &full, &narrow), "{}", oracle.name);
        assert!(says_no(&oracle, &full, &empty), "{}", oracle.name);
    }
    let oracle = pictures::SAME_BITS;
    assert!(says_no(&oracle, &full, &holes) && says_no(&oracle, &full, &wrong));
    // A depth for a footprint, in no view.
    let oracle = pictures::COMPUTE_AS_RASTER;
    let judged = std::panic::catch_unwind(|| oracle.judge(&full, &full));
    assert!(judged.is_err());
}
