//! What each method does on the scenes that methods fail at: measured numbers against the bounds of
//! `surfel::stability`, which `surfel stability` prints.
//!
//! Every scene is drawn by every look. A new look is one line in the library; where it breaks a rule the test says
//! which scene, by how much, and what the rule is.

use crate::common::Device;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::OnceLock;
use surfel::cut::{self, Cut};
use surfel::image::{PixelSource, compare};
use surfel::render::PictureOutputs;
use surfel::render::Settings;
use surfel::render::cut_key::cut_settings;
use surfel::render::engine::{Backend, Engine};
use surfel::scenes;
use surfel::stability::{FailureCase, FailureCell, FailureVerdict, looks, rows};

/// All scenes, made once for all tests of this file.
fn cases() -> &'static [FailureCase] {
    static CASES: OnceLock<Vec<FailureCase>> = OnceLock::new();
    CASES.get_or_init(|| {
        let made = scenes::ALL.par_iter();
        made.map(|entry| FailureCase::new(entry, &Backend::Reference).unwrap())
            .collect()
    })
}

fn line(cell: &FailureCell) -> String {
    let figures: Vec<String> = cell
        .figures
        .iter()
        .map(|(figure, value)| format!("{} {value:.2}", figure.name()))
        .collect();
    let (scene, look) = (cell.scene, cell.look);
    format!(
        "{scene}, {look}: {:?}; {}",
        cell.verdict,
        figures.join(", ")
    )
}

/// Draws everything and holds every figure to its row or rule.
fn check(backend: &Backend) {
    let looks = looks();
    let judge = |case: &FailureCase| -> Vec<FailureCell> {
        let mut engine = case.engine(backend).unwrap();
        let looks = looks.iter().filter(|look| look.is_for(case));
        looks
            .map(|look| {
                let picture = case.draw(&mut engine, look).unwrap();
                case.judge(look, &picture).unwrap()
            })
            .collect()
    };
    let cells: Vec<FailureCell> = match backend {
        Backend::Reference => cases().par_iter().flat_map(judge).collect(),
        _ => cases().iter().flat_map(judge).collect(),
    };
    let mut wrong = Vec::new();
    let count = |verdict| cells.iter().filter(|c| c.verdict == verdict).count();
    for cell in &cells {
        println!("{}", line(cell));
        if cell.verdict == FailureVerdict::Fail {
            wrong.push(format!("{}, {}: {}", cell.scene, cell.look, cell.cause()));
        } else if cell.verdict == FailureVerdict::Limit {
            println!("    limit: {}", cell.cause());
        }
    }
    let limits = count(FailureVerdict::Limit);
    println!("{} cells, {limits} known limits", cells.len());
    for row in rows::ROWS {
        let is_named = row.scenes.split(' ').all(|s| scenes::find(s).is_some())
            && row
                .looks
                .split('|')
                .all(|l| looks.iter().any(|look| look.name == l));
        let is_used =
            |c: &FailureCell| row.is_of(c.scene, c.look) && c.figure(row.figure).is_some();
        if !is_named || !cells.iter().any(is_used) {
            wrong.push(format!("the row belongs to nothing: {row:?}"));
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
    check(&Backend::Reference);
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
    for case in cases() {
        let (Some(reference), expected) = (&case.truth, case.expected) else {
            continue;
        };
        let name = case.entry.name;
        if let Some(area) = expected.covered_px {
            let found: f64 = reference.color.iter().map(|c| f64::from(c[3])).sum();
            let outline = reference
                .color
                .iter()
                .filter(|c| c[3] > 0.0 && c[3] < 1.0)
                .count() as f64;
            println!("{name}: {found} of {area}");
            // 16 regular samples err by less than 1/16 of a cut pixel on average, and straight edges along the samples by
            // up to an eighth, all to one side.
            assert!(
                (found - area).abs() <= 0.13 * outline + 0.13,
                "{name}: covers {found}, expected {area}; {outline} cut pixels"
            );
            checked += 1;
        }
        let [width, height] = reference.size();
        let center = reference.color[((height / 2 - 1) * width + width / 2) as usize];
        let is_sampled = name != "stack" && name != "checkerboard";
        if let (Some(color), true) = (expected.color, is_sampled) {
            for c in 0..3 {
                let found = 255.0 * f64::from(center[c]);
                assert!(
                    (found - f64::from(color[c])).abs() <= 1.5,
                    "{name}: {found} is not {color:?}"
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
        let case = cases().iter().find(|c| c.entry.name == name).unwrap();
        let settings = Settings::default();
        let size = (case.view.width, case.view.height);
        Engine::new(
            &Backend::Reference,
            &case.model,
            size,
            PictureOutputs::default(),
        )
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

/// Where nodes hold both sheets, the range of the rows is that of what they hold: counted here leaf by leaf, in the nodes
/// that are small enough to be one splat. No picture has a say.
#[test]
fn the_colors_of_mixed_nodes_are_counted_in_the_tree() {
    let case = cases()
        .iter()
        .find(|c| c.entry.name == "sheets-fine")
        .unwrap();
    let model = &case.model;
    let settings = Settings {
        threshold_px: case.threshold_px,
        ..Settings::default()
    };
    let mut cut = Cut::default();
    cut::select(model, &case.view, &cut_settings(&settings, model), &mut cut);
    let drawn = || {
        cut.nodes
            .iter()
            .copied()
            .chain(cut.strips.iter().map(|row| row.node))
    };
    // Every triangle is of one sheet, and all are of one size.
    let is_red = |leaf: u32| {
        let [r, g, b] = model.triangles[leaf as usize].map(|i| model.vertices[i as usize].color);
        assert!(r[..3] == g[..3] && g[..3] == b[..3] && r[0].min(r[1]) == 0);
        r[0] > 0
    };
    let (mut least, mut most, mut leaves) = (f64::INFINITY, 0.0f64, 0);
    for node in drawn() {
        let below = model.tree.leaf_range(node);
        let all = below.len() as f64;
        leaves += below.len();
        let red = 204.0 * below.filter(|leaf| is_red(*leaf)).count() as f64 / all;
        (least, most) = (least.min(red), most.max(red));
    }
    println!(
        "{} nodes of {leaves} leaves: red from {least:.2} to {most:.2}",
        drawn().count()
    );
    assert_eq!(
        (leaves, cut.leaves.len(), cut.triangles.len()),
        (model.triangles.len(), 0, 0)
    );
    let [low, high] = rows::BOTH_SHEETS_RANGE;
    // Colors of nodes are whole numbers of 255, and the light at the rim is 0.3 levels less.
    assert!(least - 2.0 < low && low <= least - 0.7, "{least}");
    assert!(most + 0.7 <= high && high < most + 2.0, "{most}");
    // As much of green as there is not of red.
    assert!((low + high - 204.0).abs() < 1.0);
}
