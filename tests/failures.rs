//! What each method does on the scenes that methods fail at: measured numbers against stated bounds.
//!
//! Every scene is drawn by every look of [`looks`]. The rules of [`rule`] hold for all of them; what departs from a rule,
//! and what a scene is there to show, is a row of [`ROWS`] with the reason. A new look is one line; where it breaks a rule
//! the test says which scene and by how much. The reference is 16 samples of triangles a pixel.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::Device;
use glam::DVec3;
use std::sync::OnceLock;
use surfel::image::{FloatImage, Image, Picture, compare};
use surfel::math::camera::View;
use surfel::measure;
use surfel::method::engine::{Backend, Engine};
use surfel::method::renderer::Outputs;
use surfel::method::{Culling, Method, Settings, SplatKind};
use surfel::progress::Silent;
use surfel::scenes::{self, Scene};
use surfel::tree::{self, BuildOptions, Model};

/// A way of drawing; the threshold is the scene's.
struct Look {
    name: &'static str,
    settings: Settings,
    /// The scenes it is for; all if there are none.
    only: &'static [&'static str],
}

fn looks() -> Vec<Look> {
    let usual = Settings::default();
    let look = |name, settings| Look {
        name,
        settings,
        only: &[],
    };
    let filtered = Settings {
        splat: SplatKind::Filtered,
        ..usual
    };
    vec![
        look(
            "triangles",
            Settings {
                method: Method::Triangles,
                ..usual
            },
        ),
        look(
            "points",
            Settings {
                method: Method::Points,
                ..usual
            },
        ),
        look("pop", usual),
        look("filtered", filtered),
        Look {
            only: &["open-behind"],
            ..look(
                "pop, culling on",
                Settings {
                    culling: Culling::On,
                    ..usual
                },
            )
        },
        Look {
            only: &["thin-plate", "inside", "sheets-1"],
            ..look(
                "pop, culling off",
                Settings {
                    culling: Culling::Off,
                    ..usual
                },
            )
        },
        Look {
            only: &["thin-plate", "inside"],
            ..look(
                "filtered, culling off",
                Settings {
                    culling: Culling::Off,
                    ..filtered
                },
            )
        },
        Look {
            only: &["sheets-0.5", "sheets-2", "sheets-4", "sheets-tilted"],
            ..look(
                "filtered, offset 1",
                Settings {
                    depth_offset: Some(1.0),
                    ..filtered
                },
            )
        },
    ]
}

/// A figure of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Figure {
    /// Pixels covered at least by half.
    Covered,
    /// Pixels covered in the reference only.
    Missing,
    /// Pixels covered in the picture only.
    Extra,
    /// Holes inside of the reference's silhouette.
    Holes,
    /// Pixels in them.
    HolePixels,
    /// Largest distance of an extra pixel from one that the reference touches at all, pixels.
    Reach,
    /// Mean difference of a color over object pixels, levels of 255.
    Level,
    /// Sum of the covered fractions, pixels.
    Area,
    /// Red, green, blue right of and above the center, levels.
    Center(usize),
}
use Figure::{Area, Center, Covered, Extra, HolePixels, Holes, Level, Missing, Reach};

/// What a scene and a look have to come to.
struct Row {
    scene: &'static str,
    look: &'static str,
    figure: Figure,
    /// At least and at most.
    range: [f64; 2],
    why: &'static str,
}

const fn row(
    scene: &'static str,
    look: &'static str,
    figure: Figure,
    range: [f64; 2],
    why: &'static str,
) -> Row {
    Row {
        scene,
        look,
        figure,
        range,
        why,
    }
}

#[rustfmt::skip]
static ROWS: &[Row] = &[
    // 962 pixels of outline; the support of a square of 8 pixels is 5.1 on average over the directions.
    row("silhouette", "triangles", Covered, [73_150.0, 74_112.0], "the circle's area and half its outline"),
    row("silhouette", "pop", Extra, [2000.0, 5460.0], "a rim of squares, and half the outline"),
    row("silhouette", "filtered", Extra, [1000.0, 5460.0], "its kernel is the same square"),
    row("horizon", "pop", Extra, [1.0, 240.0 * 3.9], "squares above the horizon, at most half a diagonal"),
    row("cube-edge", "pop", Extra, [500.0, 2500.0], "440 pixels of outline, at most 5.7 wide"),
    row("cube-edge", "pop", Level, [2.0, 12.0], "squares of one face over the next"),
    row("pedestal", "pop", Level, [1.0, 7.0], "squares of the pedestal over the foot of the cube"),
    row("open-behind", "pop, culling on", Missing, [14_400.0; 2], "culling is for closed surfaces"),
    row("open-behind", "pop", Center(0), [203.0, 205.0], "light from both sides"),
    // The near edge is 160 pixels long.
    row("edge-on", "triangles", Covered, [0.0; 2], "a plane through the eye covers nothing"),
    row("edge-on", "points", Covered, [996.0; 2], "166 x 6: the near edge and a square"),
    row("edge-on", "pop", Covered, [900.0, 996.0], "a bar of the threshold's height"),
    row("edge-on", "filtered", Covered, [0.0; 2], "patches seen edge-on are left out"),
    row("thin-plate", "pop", Center(1), [0.0; 2], "the nearer square wins"),
    row("thin-plate", "pop, culling off", Center(1), [0.0; 2], "the nearer square wins"),
    row("thin-plate", "filtered", Center(1), [0.0; 2], "the back is culled"),
    row("thin-plate", "filtered, culling off", Center(1), [95.0, 109.0], "the back is within 3 offsets: half each"),
    row("sheets-0.5", "pop", Center(1), [0.0; 2], "the nearer square wins"),
    row("sheets-0.5", "filtered", Center(1), [95.0, 109.0], "0.5 is below 3: half each"),
    row("sheets-0.5", "filtered, offset 1", Center(1), [95.0, 109.0], "0.5 is below 1: half each"),
    row("sheets-1", "pop", Center(1), [0.0; 2], "the nearer square wins"),
    row("sheets-1", "pop, culling off", Center(1), [0.0; 2], "the nearer square wins"),
    row("sheets-1", "filtered", Center(1), [95.0, 109.0], "1 is below 3: half each"),
    row("sheets-2", "filtered", Center(1), [95.0, 109.0], "2 is below 3: half each"),
    row("sheets-2", "filtered, offset 1", Center(1), [0.0; 2], "2 is above 1: none"),
    row("sheets-4", "filtered", Center(1), [0.0; 2], "4 is above 3: none"),
    row("sheets-4", "filtered, offset 1", Center(1), [0.0; 2], "4 is above 1: none"),
    row("sheets-tilted", "filtered", Center(1), [0.0, 60.0], "open, so the factor is 2, and the gap is 2: on the border"),
    row("sheets-tilted", "filtered, offset 1", Center(1), [0.0; 2], "2 is above 1 at every tilt: none"),
    row("sheets-fine", "triangles", Level, [0.0, 1.0], "triangles do not mix"),
    row("sheets-fine", "pop", Level, [30.0, 80.0], "a node holds both sheets: its color is the mean"),
    row("sheets-fine", "filtered", Level, [30.0, 80.0], "a node holds both sheets, and the offset mixes them"),
    row("overlap", "triangles", Center(0), [204.0; 2], "the first drawn wins"),
    row("overlap", "pop", Level, [3.0, 80.0], "nodes hold both copies"),
    row("overlap", "filtered", Level, [60.0, 75.0], "no gap: half each"),
    row("stack", "triangles", Covered, [0.0; 2], "none of the triangles meets the pixel's center"),
    row("stack", "points", Covered, [1.0; 2], "all squares of one pixel"),
    row("stack", "points", Center(0), [183.0, 185.0], "0.8 of 230, however many"),
    row("stack", "pop", Covered, [1.0; 2], "all squares of one pixel"),
    row("stack", "pop", Center(0), [183.0, 185.0], "0.8 of 230, however many"),
    row("stack", "filtered", Area, [0.0, 0.04], "500 areas of 0.000018 pixels are 0.009; each of 9 pixels shows a level of 255 at least"),
    row("opposite-normals", "points", Center(0), [99.0, 105.0], "each vertex has a whole normal; a square has the light of its center"),
    row("opposite-normals", "pop", Center(0), [99.0, 105.0], "one normal is kept where the mean vanishes"),
    row("opposite-normals", "filtered", Center(0), [0.0, 104.0], "its sums are of faces times vertex normals, which cancel"),
    row("zero-normals", "triangles", Covered, [0.0; 2], "a cloud has no triangles"),
    row("zero-normals", "points", Covered, [15_129.0; 2], "123 x 123: the lattice and a square"),
    row("zero-normals", "points", Center(0), [204.0; 2], "lit as if facing the light"),
    row("zero-normals", "pop", Covered, [15_129.0, 19_044.0], "the lattice and squares of 3 to 18 pixels"),
    row("zero-normals", "pop", Center(0), [204.0; 2], "lit as if facing the light"),
    row("zero-normals", "filtered", Covered, [15_129.0, 19_044.0], "the lattice and squares of 3 to 18 pixels"),
    row("zero-normals", "filtered", Center(0), [204.0; 2], "lit as if facing the light"),
    row("checkerboard", "triangles", Level, [60.0, 110.0], "black or white instead of gray"),
    row("checkerboard", "points", Level, [60.0, 110.0], "black or white instead of gray"),
    row("checkerboard", "pop", Level, [0.0, 2.0], "a node of a pixel holds both"),
    row("checkerboard", "filtered", Level, [0.0, 3.0], "sums over the pixel"),
    row("checkerboard", "filtered", Center(0), [101.0, 103.0], "half of 204"),
    row("noise", "triangles", Level, [3.0, 15.0], "one facet of four in a pixel"),
    row("noise", "pop", Level, [2.0, 15.0], "one node of several in a pixel"),
    row("noise", "filtered", Level, [2.0, 15.0], "sums over facets, where triangles have smooth normals"),
    row("foliage", "triangles", Holes, [0.0, 400.0], "gaps of less than a pixel"),
    row("foliage", "pop", Holes, [0.0, 10.0], "near leaves are triangles, which miss pixel centers"),
    row("foliage", "pop", Extra, [1500.0, 7500.0], "squares of 5 for leaves of 3 pixels, mostly turned away"),
    row("foliage", "filtered", Holes, [0.0, 400.0], "leaves seen edge-on have no weight"),
    row("fence", "triangles", Missing, [1000.0, 3000.0], "wires of 0.4 pixels meet four centers of ten"),
    row("fence", "pop", Covered, [6680.0, 10_020.0], "wires a pixel wide: 2.5 times their area of 3340, and more in part"),
    row("fence", "filtered", Area, [3173.0, 3507.0], "the area of the wires within 5 percent"),
    row("fence", "filtered", Missing, [0.0, 3000.0], "four tenths are less than half"),
    row("under-pixel", "triangles", Area, [0.0; 2], "it meets no pixel center"),
    row("under-pixel", "points", Covered, [1.0, 4.0], "squares of a pixel around vertices in one pixel and at its border"),
    row("under-pixel", "pop", Area, [1.0; 2], "a square is at least a pixel"),
    row("under-pixel", "filtered", Area, [0.0, 0.6], "0.28 is right; a node of the whole ball has no vector area and is left out"),
    row("needles", "pop", Level, [2.0, 12.0], "a row of splats has one normal: bands"),
    row("needles", "filtered", Level, [1.0, 12.0], "a row of splats has one normal: bands"),
    row("obtuse", "pop", Level, [5.0, 30.0], "one normal for all of a triangle or row, 8 pixels long"),
    row("huge-triangle", "pop", Level, [0.5, 4.0], "squares of the small ones over the edge of the large one"),
    row("spikes", "pop", Extra, [500.0, 4000.0], "squares hide the valleys at the rim"),
    row("spikes", "triangles", Holes, [0.0, 100.0], "gaps between spikes at the rim"),
    row("spikes", "pop", Holes, [0.0, 100.0], "gaps between spikes at the rim"),
    row("spikes", "filtered", Holes, [0.0, 100.0], "gaps between spikes at the rim"),
    row("degenerate", "points", Reach, [70.0, 80.0], "vertices of slivers stand up to 73 pixels beside the square"),
    row("degenerate", "pop", Reach, [70.0, 80.0], "small slivers are splats, though they have no area"),
    row("degenerate", "filtered", Reach, [0.0, 5.9], "slivers have no area and no weight"),
    row("coincident-vertices", "points", Extra, [4000.0, 8000.0], "2000 squares of 4 pixels less overlap"),
    row("coincident-vertices", "points", Reach, [40.0, 80.0], "triangles up to 70 pixels from the square's corners"),
    row("coincident-vertices", "pop", Extra, [4000.0, 8000.0], "2000 squares of 4 pixels less overlap"),
    row("coincident-vertices", "pop", Reach, [40.0, 80.0], "triangles up to 70 pixels from the square's corners"),
    row("coincident-vertices", "filtered", Extra, [0.0; 2], "no area, no weight"),
    row("coincident-points", "triangles", Covered, [0.0; 2], "a cloud has no triangles"),
    row("coincident-points", "points", Covered, [25.0; 2], "one square of 5"),
    row("coincident-points", "pop", Covered, [25.0; 2], "no spacing: one square of 5"),
    row("coincident-points", "filtered", Covered, [0.0; 2], "no spacing, so no area"),
    row("duplicate-points", "triangles", Covered, [0.0; 2], "a cloud has no triangles"),
    row("duplicate-points", "points", Covered, [1681.0; 2], "41 x 41 pixels: holes between them"),
    row("duplicate-points", "pop", Covered, [16_508.0, 19_044.0], "120 pixels and squares of 8.5 to 18: no hole"),
    row("duplicate-points", "filtered", Covered, [16_508.0, 19_044.0], "120 pixels and squares of 8.5 to 18: no hole"),
    row("near-points", "triangles", Covered, [0.0; 2], "a cloud has no triangles"),
    row("near-points", "points", Covered, [9.0; 2], "nine pixels"),
    row("near-points", "pop", Covered, [57_600.0; 2], "the whole picture, above the device's largest point too"),
    row("near-points", "filtered", Covered, [57_600.0; 2], "the whole picture"),
    row("beside-view", "triangles", Covered, [0.0; 2], "the triangle is outside"),
    row("beside-view", "points", Covered, [792.0; 2], "18 x 40 and 12 x 6 pixels of the squares around three corners"),
    row("beside-view", "pop", Covered, [600.0; 2], "15 of the square's 40 columns"),
    row("beside-view", "filtered", Covered, [0.0, 600.0], "0 is right; inside of its square a lone splat counts as a whole surface"),
    row("inside", "triangles", Missing, [57_600.0; 2], "closed, so what faces away is culled"),
    row("inside", "triangles", Holes, [1.0; 2], "the whole picture"),
    row("inside", "pop", Missing, [57_600.0; 2], "closed, so what faces away is culled"),
    row("inside", "pop", Holes, [1.0; 2], "the whole picture"),
    row("inside", "filtered", Missing, [57_600.0; 2], "closed, so what faces away is culled"),
    row("inside", "filtered", Holes, [1.0; 2], "the whole picture"),
    row("inside", "pop, culling off", Missing, [0.0; 2], "all of it is there"),
    row("one-point", "triangles", Covered, [0.0; 2], "a cloud has no triangles"),
    row("one-point", "points", Covered, [25.0; 2], "one square of 5"),
    row("one-point", "pop", Covered, [25.0; 2], "one square of 5"),
    row("one-point", "filtered", Covered, [0.0; 2], "no spacing, so no area"),
    row("empty", "triangles", Covered, [0.0; 2], "nothing"),
    row("empty", "points", Covered, [0.0; 2], "nothing"),
    row("empty", "pop", Covered, [0.0; 2], "nothing"),
    row("empty", "filtered", Covered, [0.0; 2], "nothing"),
];

/// The range that holds for a figure where no row says otherwise, with the reason; none where there is no rule.
fn rule(case: &Case, look: &Look, figure: Figure) -> Option<([f64; 2], &'static str)> {
    let t = f64::from(case.threshold_px.max(1.0));
    let reference = case.reference.as_ref()?;
    // Pixels that an outline cuts.
    let cut = reference
        .color
        .iter()
        .filter(|c| c[3] > 0.0 && c[3] < 1.0)
        .count() as f64;
    match (look.settings.method, figure) {
        (Method::Triangles, Missing | Extra) => Some((
            [0.0, cut],
            "one sample can only err where an outline cuts the pixel",
        )),
        (Method::Pop, Missing) if look.settings.splat == SplatKind::Filtered => Some((
            [0.0, cut + 4.0],
            "coverage at the outline is an estimate, and an outline on pixel borders has corners",
        )),
        (Method::Pop, Missing) => Some((
            [0.0, cut],
            "what triangles or splats lose lies on the outline",
        )),
        (Method::Triangles | Method::Pop, Holes) => {
            Some(([0.0; 2], "a surface without gaps is drawn without gaps"))
        }
        // A node is at most t wide, so the center of its square is at most t/2 from the surface, and its corners are
        // t/sqrt(2) from there; a pixel for the rounding to centers.
        (Method::Pop, Reach) => Some((
            [0.0, t * (0.5 + 0.5f64.sqrt()) + 1.0],
            "half a node, half a square's diagonal, a pixel",
        )),
        (Method::Points, Reach) => Some((
            [0.0, t * 0.5f64.sqrt() + 1.0],
            "vertices lie on the surface: half a square's diagonal, a pixel",
        )),
        (Method::Triangles, Reach) => Some((
            [0.0, 1.0],
            "only the center, which is none of the 16 samples, may meet a sliver",
        )),
        _ => None,
    }
}

/// A scene made ready.
struct Case {
    name: &'static str,
    threshold_px: f32,
    model: Model,
    view: View,
    /// Supersampled triangles; none for clouds.
    reference: Option<FloatImage>,
}

/// All scenes, made once for all tests of this file.
fn cases() -> &'static [Case] {
    static CASES: OnceLock<Vec<Case>> = OnceLock::new();
    CASES.get_or_init(|| {
        scenes::ALL
            .iter()
            .map(|entry| {
                let Scene {
                    mesh,
                    camera,
                    threshold_px,
                    ..
                } = entry.make();
                let has_triangles = !mesh.triangles.is_empty();
                let model = tree::build(mesh, &BuildOptions::default(), &Silent).unwrap();
                let view = camera.view(model.origin).unwrap();
                let reference = has_triangles.then(|| {
                    let settings = Settings {
                        method: Method::Triangles,
                        culling: Culling::Off,
                        ..Settings::default()
                    };
                    Engine::new(
                        &Backend::Mirror,
                        &model,
                        (camera.width, camera.height),
                        Outputs::default(),
                    )
                    .unwrap()
                    .supersample(&view, &settings, 4)
                    .unwrap()
                });
                Case {
                    name: entry.name,
                    threshold_px,
                    model,
                    view,
                    reference,
                }
            })
            .collect()
    })
}

/// Largest distance of a pixel that only `picture` covers from the nearest one that `reference` touches.
fn reach(reference: &FloatImage, picture: &Image) -> f64 {
    let width = picture.width as usize;
    let touched: Vec<(f64, f64)> = reference
        .color
        .iter()
        .enumerate()
        .filter(|(i, c)| {
            // Those at the outline are enough.
            let is_inside = |n: usize| reference.color.get(n).is_some_and(|c| c[3] > 0.0);
            c[3] > 0.0
                && !(is_inside(i + 1)
                    && is_inside(i + width)
                    && is_inside(i.wrapping_sub(1))
                    && is_inside(i.wrapping_sub(width)))
        })
        .map(|(i, _)| ((i % width) as f64, (i / width) as f64))
        .collect();
    let mut largest: f64 = 0.0;
    for (i, pixel) in picture.color.iter().enumerate() {
        if pixel[3] >= 128 && reference.color[i][3] == 0.0 {
            let (x, y) = ((i % width) as f64, (i / width) as f64);
            let nearest = touched
                .iter()
                .map(|(tx, ty)| (tx - x).hypot(ty - y))
                .fold(f64::INFINITY, f64::min);
            largest = largest.max(nearest);
        }
    }
    largest
}

/// Every figure that a picture has.
fn figures(case: &Case, picture: &Image) -> Vec<(Figure, f64)> {
    let [width, height] = picture.size();
    let center = picture.color[((height / 2 - 1) * width + width / 2) as usize];
    let area: f64 = picture.color.iter().map(|c| f64::from(c[3]) / 255.0).sum();
    let covered = picture.color.iter().filter(|c| c[3] >= 128).count();
    let mut found = vec![(Covered, covered as f64), (Area, area)];
    found.extend((0..3).map(|c| (Center(c), f64::from(center[c]))));
    if let Some(reference) = &case.reference {
        let shape = measure::coverage(reference, picture).unwrap();
        let difference = compare(reference, picture, 8.0).unwrap();
        found.extend([
            (Missing, shape.missing as f64),
            (Extra, shape.extra as f64),
            (Holes, shape.holes as f64),
            (HolePixels, shape.hole_pixels as f64),
            (Level, 255.0 * difference.object.mean_abs),
        ]);
        // No distance from nothing.
        if reference.color.iter().any(|c| c[3] > 0.0) {
            found.push((Reach, reach(reference, picture)));
        }
    }
    found
}

/// Draws everything and holds every figure to its row or rule.
fn check(backend: &Backend) {
    let mut wrong = Vec::new();
    let mut used = vec![false; ROWS.len()];
    for case in cases() {
        for look in looks() {
            if !look.only.is_empty() && !look.only.contains(&case.name) {
                continue;
            }
            let settings = Settings {
                threshold_px: case.threshold_px,
                ..look.settings
            };
            let size = (case.view.width, case.view.height);
            let drawn = Engine::new(backend, &case.model, size, Outputs::default())
                .unwrap()
                .render(&case.view, &settings);
            let what = format!("{}, {}", case.name, look.name);
            let picture = match drawn {
                Ok(picture) => picture,
                Err(error) => {
                    // The only thing that is refused, and it is refused by name.
                    let is_expected = case.model.triangles.is_empty()
                        && settings.splat == SplatKind::Filtered
                        && error.to_string().contains("point cloud");
                    println!("{what}: refused: {error}");
                    if !is_expected {
                        wrong.push(format!("{what}: {error}"));
                    }
                    continue;
                }
            };
            let found = figures(case, &picture);
            println!("{what}: {found:?}");
            let mut stated = 0;
            for (figure, value) in found {
                let rows = ROWS
                    .iter()
                    .enumerate()
                    .filter(|(_, r)| (r.scene, r.look, r.figure) == (case.name, look.name, figure));
                let mut bounds: Vec<([f64; 2], &str)> = rows
                    .map(|(k, r)| {
                        used[k] = true;
                        (r.range, r.why)
                    })
                    .collect();
                if bounds.is_empty() {
                    bounds.extend(rule(case, &look, figure));
                }
                stated += bounds.len();
                for ([least, most], why) in bounds {
                    if !(least..=most).contains(&value) {
                        wrong.push(format!(
                            "{what}: {figure:?} is {value}, not {least} to {most} ({why})"
                        ));
                    }
                }
            }
            if stated == 0 {
                wrong.push(format!("{what}: no bound is stated"));
            }
        }
    }
    for (row, used) in ROWS.iter().zip(used) {
        if !used {
            wrong.push(format!(
                "the row of {}, {} and {:?} belongs to nothing",
                row.scene, row.look, row.figure
            ));
        }
    }
    assert!(
        wrong.is_empty(),
        "{}:\n{}",
        backend.name(),
        wrong.join("\n")
    );
}

#[test]
fn every_scene_by_every_method_on_the_mirror() {
    check(&Backend::Mirror);
}

#[test]
fn every_scene_by_every_method_on_the_device() {
    let Some(device) = Device::open() else { return };
    check(&Backend::Device(device.gpu().clone()));
}

/// The references are themselves held to the closed forms.
#[test]
fn the_references_are_what_the_closed_forms_say() {
    let mut checked = 0;
    for (case, entry) in cases().iter().zip(scenes::ALL) {
        let (Some(reference), expected) = (&case.reference, entry.make().expected) else {
            continue;
        };
        if let Some(area) = expected.covered_px {
            let found: f64 = reference.color.iter().map(|c| f64::from(c[3])).sum();
            let outline = reference
                .color
                .iter()
                .filter(|c| c[3] > 0.0 && c[3] < 1.0)
                .count() as f64;
            println!("{}: {found} of {area}", case.name);
            // 16 regular samples err by less than 1/16 of a cut pixel on average, and straight edges along the samples by
            // up to an eighth, all to one side.
            assert!(
                (found - area).abs() <= 0.13 * outline + 0.13,
                "{}: covers {found}, expected {area}; {outline} cut pixels",
                case.name
            );
            checked += 1;
        }
        let [width, height] = reference.size();
        let center = reference.color[((height / 2 - 1) * width + width / 2) as usize];
        let is_sampled = case.name != "stack" && case.name != "checkerboard";
        if let (Some(color), true) = (expected.color, is_sampled) {
            for c in 0..3 {
                let found = 255.0 * f64::from(center[c]);
                assert!(
                    (found - f64::from(color[c])).abs() <= 1.5,
                    "{}: {found} is not {color:?}",
                    case.name
                );
            }
            checked += 1;
        }
    }
    assert!(checked > 15, "{checked}");
}

/// The same model far from the origin, and a millionth of its size, gives the picture of the model itself.
#[test]
fn place_and_size_of_a_model_do_not_matter() {
    let draw = |name: &str| {
        let case = cases().iter().find(|c| c.name == name).unwrap();
        let settings = Settings::default();
        let size = (case.view.width, case.view.height);
        Engine::new(&Backend::Mirror, &case.model, size, Outputs::default())
            .unwrap()
            .render(&case.view, &settings)
            .unwrap()
    };
    let (far, small) = (draw("georeferenced"), draw("microscopic"));
    let d = compare(&far, &small, 1.0).unwrap();
    println!("{} pixels differ by more than a level", d.whole.past_level);
    // Other last bits: single pixels on edges.
    assert!(d.object.pixels > 5000 && d.whole.past_level <= d.object.pixels / 200);
    assert!(cases().iter().any(|c| c.model.origin != DVec3::ZERO));
}
