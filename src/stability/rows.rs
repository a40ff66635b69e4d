//! What single scenes have to come to, with the reasons.

use super::FailureFigure;
use FailureFigure::{
    Area, Astray, Center, Covered, Extra, Holes, Level, Lost, Missing, Moire, Reach, Stray,
};

/// What a scene and its looks have to come to, where the rules say nothing, too little, or what a method cannot keep.
#[derive(Debug, Clone, Copy)]
pub struct FailureRow {
    /// Names of scenes, separated by blanks.
    pub scenes: &'static str,
    /// Names of looks, separated by `|`.
    pub looks: &'static str,
    /// What is bounded.
    pub figure: FailureFigure,
    /// At least and at most.
    pub range: [f64; 2],
    /// The reason.
    pub why: &'static str,
    /// Whether it takes the place of the rule, which does not hold there: then `why` derives the range, and what is
    /// within it is no limit.
    pub is_bound: bool,
}

impl FailureRow {
    /// Tells whether it is about a picture.
    pub fn is_of(&self, scene: &str, look: &str) -> bool {
        self.scenes.split(' ').any(|s| s == scene) && self.looks.split('|').any(|l| l == look)
    }
}

/// The rows about a figure of a picture.
pub fn of(
    scene: &str,
    look: &str,
    figure: FailureFigure,
) -> impl Iterator<Item = &'static FailureRow> {
    ROWS.iter()
        .filter(move |row| row.figure == figure && row.is_of(scene, look))
}

const fn row(
    scenes: &'static str,
    looks: &'static str,
    figure: FailureFigure,
    range: [f64; 2],
    why: &'static str,
) -> FailureRow {
    FailureRow {
        scenes,
        looks,
        figure,
        range,
        why,
        is_bound: false,
    }
}

/// A row that takes the place of the rule.
const fn bound(
    scenes: &'static str,
    looks: &'static str,
    figure: FailureFigure,
    range: [f64; 2],
    why: &'static str,
) -> FailureRow {
    FailureRow {
        is_bound: true,
        ..row(scenes, looks, figure, range, why)
    }
}

/// Reason beside what the near plane cuts of a surface.
const BEFORE_NEAR: &str =
    "splats whose center is before the near plane are left out: half a splat beside the cut";

/// `pop` with every kind of splat.
const SPLATS: &str = "pop|disc|ellipse|gauss|visibility|filtered";
const WHOLE: &str =
    "whole discs of vertices reach beyond the edges, and show where their planes cross";
const SPARSE: &str = "vertices farther apart than the square leave holes";
const HIDDEN_VERTICES: &str =
    "nothing is culled: vertices of faces that look away show beyond the rim";
const EDGE: &str = "a node over an edge has the mean normal of both faces, brighter than either";
const FLAT_BOX: &str = "at a flat angle the rectangle of a large leaf is lower than its triangle";
/// The sheets are 1.5 pixels apart and cut into cells of 1.05, and a node of up to 6 pixels is one splat by definition.
/// It holds about as much of one as of the other, (102, 102, 0), and shows what it holds.
const BOTH_SHEETS: &str = "both sheets lie in a node of the threshold's size, so its mean is what is asked for: as much of each as there are triangles of it in the node";
/// Least and most red of those nodes: 204 times 2 / 7 and 5 / 7, and a level of rounding; as much green. Where a
/// sheet is not cut in the same places as the other, nodes are uneven: `tests/device/failures.rs` counts them, leaf by
/// leaf.
pub const BOTH_SHEETS_RANGE: [f64; 2] = [57.0, 147.0];
/// All triangles of these scenes face away from the eye.
const CULLED: &str = "all of it faces away, and the option asks to drop that: nothing is left";
const BANDS: &str = "leaves are up to 20 times as long as wide: in a disc around each one of 20 cells shows, in bands";
/// Within an offset of m r all weights count: red over red and green is 1 / (1 + (z / (z + g))^2), 0.5 for g far below z.
const HALF_EACH: &str =
    "the gap is half the offset, and what lies within the offset is mixed by definition: half each";
const SIDES: &str = "splats of the sides, which are seen edge-on and dark, stand in front";
const FACETS: &str = "a splat is lit by its facet alone, and of several in a pixel one shows";

/// Every row, scene by scene.
#[rustfmt::skip]
pub static ROWS: &[FailureRow] = &[
    // 962 pixels of outline; the support of a square of 8 pixels is 5.1 on average over the directions.
    row("silhouette", "triangles", Covered, [73_150.0, 74_112.0], "the circle's area and half its outline"),
    row("silhouette", "pop", Extra, [2000.0, 5460.0], "a rim of squares, and half the outline"),
    row("silhouette", "filtered", Extra, [1000.0, 5460.0], "its kernel is the same square"),
    row("horizon", "pop", Extra, [1.0, 240.0 * 3.9], "squares above the horizon, at most half a diagonal"),
    row("horizon", "patches", Level, [0.0, 2.0], "hulls of scattered cells do not lie over what is between"),
    row("cube-edge", "pop", Extra, [500.0, 2500.0], "440 pixels of outline, at most 5.7 wide"),
    row("cube-edge", "pop", Level, [2.0, 12.0], "squares of one face over the next"),
    row("pedestal", "pop", Level, [1.0, 7.0], "squares of the pedestal over the foot of the cube"),
    row("open-behind", "pop", Center(0), [203.0, 205.0], "light from both sides"),
    // The near edge is 160 pixels long.
    row("edge-on", "triangles", Covered, [0.0; 2], "a plane through the eye covers nothing"),
    row("edge-on", "points", Covered, [996.0; 2], "166 x 6: the near edge and a square"),
    row("edge-on", "pop", Covered, [900.0, 996.0], "a bar of the threshold's height"),
    row("edge-on", "filtered", Covered, [0.0; 2], "patches seen edge-on are left out"),
    row("thin-plate", "pop", Center(1), [0.0; 2], "the nearer square wins"),
    row("thin-plate", "pop, culling off", Center(1), [0.0; 2], "the nearer square wins"),
    row("thin-plate", "filtered", Center(1), [0.0; 2], "the back is culled"),
    row("thin-plate", "filtered, culling off", Center(1), [0.0; 2], "flat and facing: its offset is a seventh of half a side"),
    row("sheets-0.5", "pop", Center(1), [0.0; 2], "the nearer square wins"),
    row("sheets-1", "pop", Center(1), [0.0; 2], "the nearer square wins"),
    row("sheets-1", "pop, culling off", Center(1), [0.0; 2], "the nearer square wins"),
    row("sheets-0.5 sheets-1 sheets-2", "filtered|filtered, offset 1", Center(1), [0.0; 2], "flat and facing: its offset is a seventh of half a side"),
    row("sheets-4", "filtered", Center(1), [0.0; 2], "4 is above 3: none"),
    row("sheets-4", "filtered, offset 1", Center(1), [0.0; 2], "4 is above 1: none"),
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
    row("opposite-normals", "points", Center(0), [99.0, 105.0], "each vertex has a whole normal; a square has the light of its center"),
    row("opposite-normals", "pop", Center(0), [99.0, 105.0], "one normal is kept where the mean vanishes"),
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
    row("foliage", "pop", Extra, [1500.0, 7500.0], "squares of 5 for leaves of 3 pixels, mostly turned away"),
    row("fence", "triangles", Missing, [1000.0, 3000.0], "wires of 0.4 pixels meet four centers of ten"),
    row("fence", "pop", Covered, [6680.0, 10_020.0], "wires a pixel wide: 2.5 times their area of 3340, and more in part"),
    row("fence", "filtered|gauss", Area, [3173.0, 3507.0], "the area of the wires within 5 percent"),
    row("fence", "filtered", Missing, [0.0, 3000.0], "four tenths are less than half"),
    row("under-pixel", "triangles", Area, [0.0; 2], "it meets no pixel center"),
    row("under-pixel", "points", Covered, [1.0, 4.0], "squares of a pixel around vertices in one pixel and at its border"),
    row("under-pixel", "pop", Area, [1.0; 2], "a square is at least a pixel"),
    row("under-pixel", "filtered", Area, [0.0, 0.6], "0.28 is right; a node of the whole ball has no vector area and is left out"),
    row("needles", "pop", Level, [2.0, 12.0], "a row of splats has one normal: bands"),
    row("needles", "filtered", Level, [1.0, 12.0], "a row of splats has one normal: bands"),
    row("needles", "disc|ellipse|gauss|visibility", Level, [1.0, 12.0], "a row of splats has one normal: bands"),
    row("obtuse", "disc|ellipse|gauss|visibility", Level, [1.0, 30.0], "one normal for all of a triangle or row, 8 pixels long"),
    row("cube-edge", "disc", Extra, [300.0, 2500.0], "440 pixels of outline, at most 4 wide"),
    row("cube-edge", "ellipse|gauss|visibility", Extra, [0.0, 700.0], "440 pixels of outline: a node over an edge stands out by a pixel or two"),
    row("horizon", "ellipse|gauss|visibility", Extra, [0.0, 60.0], "discs in the plane lie on it up to the horizon"),
    row("beside-view", "ellipse|gauss|visibility", Covered, [0.0; 2], "the disc is as large as the triangle, which is outside"),
    row("obtuse", "pop", Level, [5.0, 30.0], "one normal for all of a triangle or row, 8 pixels long"),
    row("huge-triangle", "pop", Level, [0.5, 4.0], "squares of the small ones over the edge of the large one"),
    row("spikes", "pop", Extra, [500.0, 4000.0], "squares hide the valleys at the rim"),
    row("degenerate", "points", Reach, [70.0, 80.0], "vertices of slivers stand up to 73 pixels beside the square"),
    row("degenerate", "filtered", Reach, [0.0, 5.9], "slivers have no area and no weight"),
    row("coincident-vertices", "points", Extra, [4000.0, 8000.0], "2000 squares of 4 pixels less overlap"),
    row("coincident-vertices", "points", Reach, [40.0, 80.0], "triangles up to 70 pixels from the square's corners"),
    row("coincident-vertices", "filtered", Extra, [0.0; 2], "no area, no weight"),
    row("coincident-points", "points", Covered, [25.0; 2], "one square of 5"),
    row("coincident-points", "pop|filtered|splats-filtered", Covered, [25.0; 2], "no spacing: one square of 5"),
    row("coincident-points", "pop|filtered|splats-filtered", Area, [24.9, 25.0], "one square of 5, on whole pixels"),
    row("duplicate-points", "points", Covered, [1681.0; 2], "41 x 41 pixels: holes between them"),
    row("duplicate-points", "pop", Covered, [16_508.0, 19_044.0], "120 pixels and squares of 8.5 to 18: no hole"),
    row("duplicate-points", "filtered", Covered, [16_508.0, 19_044.0], "120 pixels and squares of 8.5 to 18: no hole"),
    row("beside-view", "triangles", Covered, [0.0; 2], "the triangle is outside"),
    row("beside-view", "points", Covered, [792.0; 2], "18 x 40 and 12 x 6 pixels of the squares around three corners"),
    row("beside-view", "pop", Covered, [600.0; 2], "15 of the square's 40 columns"),
    row("beside-view", "filtered", Covered, [0.0, 600.0], "0 is right; inside of its square a lone splat counts as a whole surface"),
    row("inside", "pop, culling off", Missing, [0.0; 2], "all of it is there"),
    row("one-point", "points", Covered, [25.0; 2], "one square of 5"),
    row("one-point", "pop", Covered, [25.0; 2], "one square of 5"),
    row("empty", "triangles", Covered, [0.0; 2], "nothing"),
    row("empty", "points", Covered, [0.0; 2], "nothing"),
    row("empty", "pop", Covered, [0.0; 2], "nothing"),
    row("empty", "filtered", Covered, [0.0; 2], "nothing"),

    // What is no limit of a method, beyond the rules.
    row("silhouette", "disc", Extra, [1500.0, 4400.0], "half a node and half a disc around 962 pixels of outline, less where they overlap"),
    row("silhouette", "ellipse|visibility", Extra, [0.0, 700.0], "discs in the plane of the surface stand out by a tenth of their radius, and the outline is 962 pixels long"),
    row("silhouette", "gauss", Extra, [0.0, 300.0], "coverage from areas: a third of the outline is rounded up at most"),
    row("silhouette", "gauss", Area, [73_150.0, 74_112.0], "the circle's area and half its outline"),
    row("edge-on", "disc", Covered, [0.0, 996.0], "a bar of the threshold's height"),
    row("edge-on", "ellipse|gauss|visibility", Covered, [0.0, 166.0 * 3.0], "tilted by at most a tenth: a bar of a pixel or two"),
    row("sheets-1", "gauss", Center(1), [0.0; 2], "1 is not below 1"),
    row("stack", "disc|ellipse|visibility", Covered, [1.0; 2], "all splats of one pixel"),
    row("stack", "disc|ellipse|visibility|gauss", Center(0), [183.0, 185.0], "0.8 of 230, however many"),
    row("stack", "gauss", Area, [0.0, 1.0], "at least 0.001 each"),
    row("stack", "filtered", Area, [0.0, 0.04], "500 areas of 0.000018 pixels are 0.009; each of 9 pixels shows a level of 255 at least"),
    row("checkerboard", "disc|ellipse|gauss|visibility", Level, [0.0, 3.0], "a node of a pixel holds both"),
    row("under-pixel", "disc|ellipse|visibility", Area, [1.0; 2], "a splat is at least a pixel"),
    row("under-pixel", "gauss", Area, [0.0, 1.2], "front, sides and back: the ball's surface is four times its picture, 0.28"),
    row("degenerate", "pop|disc|ellipse|gauss|visibility", Reach, [0.0, 5.9], "what has no area is left out"),
    row("coincident-vertices", "pop|disc|ellipse|gauss|visibility", Extra, [0.0; 2], "what has no area is left out"),
    row("beside-view", "disc", Covered, [0.0, 600.0], "the part of the disc that is inside, less than that of the square"),
    row("near-points", "pop|disc|ellipse|gauss|visibility|filtered|splats-filtered", Covered, [57_600.0; 2], "the whole picture, above the device's largest point too"),
    row("near-points", "ellipse", Center(0), [123.0, 125.0], "of domes each shows its middle: 0.8 of 155"),
    row("near-points", "pop|disc", Center(0), [37.0, 39.0], "of equals the first drawn wins: the first point, 0.8 of 55 under the angle to its center"),
    row("inside", "triangles|pop|disc|ellipse|gauss|visibility|filtered", Covered, [57_600.0; 2], "a closed surface around the eye is not culled"),

    // Limits: what breaks a rule, how far, and why.
    row("horizon", "points", Missing, [9000.0, 14_000.0], SPARSE),
    row("horizon", "points", Holes, [1.0, 60.0], SPARSE),
    row("horizon", "points", Lost, [6500.0, 11_500.0], SPARSE),
    row("horizon", "splats-filtered", Missing, [0.0, 22_000.0], FLAT_BOX),
    row("horizon", "splats-filtered", Holes, [0.0, 100.0], FLAT_BOX),
    row("horizon", "splats-filtered", Lost, [0.0, 13_000.0], FLAT_BOX),
    row("cube-corner", "points", Missing, [2800.0, 4800.0], SPARSE),
    row("cube-corner", "points", Lost, [2800.0, 4800.0], SPARSE),
    row("pedestal", "points", Missing, [1300.0, 2400.0], SPARSE),
    row("pedestal", "points", Lost, [1200.0, 2300.0], SPARSE),
    row("pedestal", "points", Stray, [10.0, 25.0], SPARSE),
    row("cube-corner", "vertices, whole", Astray, [1.0, 2.0], WHOLE),
    row("cube-corner", "vertices, whole", Moire, [6.0, 30.0], WHOLE),
    row("pedestal", "vertices, whole", Astray, [1.0, 3.5], WHOLE),
    row("statue-on-plinth", "vertices, whole", Holes, [1.0, 6.0], WHOLE),
    row("statue-on-plinth", "vertices, whole", Moire, [6.0, 8.0], WHOLE),
    row("statue-on-plinth", "points", Missing, [1500.0, 3000.0], SPARSE),
    row("statue-on-plinth", "points", Lost, [1400.0, 2900.0], SPARSE),
    row("pedestal", "points", Astray, [10.0, 20.0], SPARSE),
    row("cube-edge", "points", Stray, [4.0, 10.0], HIDDEN_VERTICES),
    row("cube-edge", "points", Astray, [2.0, 8.0], HIDDEN_VERTICES),
    row("thin-plate", "points", Stray, [20.0, 45.0], HIDDEN_VERTICES),
    row("thin-plate", "points", Astray, [10.0, 25.0], HIDDEN_VERTICES),
    row("thin-plate", "pop, culling off", Stray, [4.0, 20.0], "squares of the sides and the back stick out at the rim where nothing is culled"),
    row("thin-plate", "pop, culling off", Astray, [1.0, 10.0], "squares of the sides and the back stick out at the rim where nothing is culled"),
    row("cube-edge", "ellipse|gauss|filtered", Astray, [0.0, 6.0], EDGE),
    row("pedestal", "ellipse", Astray, [0.0, 3.0], EDGE),
    bound("open-behind", "pop, culling on", Missing, [14_400.0; 2], CULLED),
    bound("open-behind", "pop, culling on", Lost, [14_400.0; 2], CULLED),
    bound("open-behind", "pop, culling on", Center(0), [0.0; 2], CULLED),
    bound("open-behind", "pop, culling on", Center(1), [0.0; 2], CULLED),
    bound("open-behind", "pop, culling on", Center(2), [0.0; 2], CULLED),
    bound("inside", "pop, culling on", Missing, [57_600.0; 2], CULLED),
    bound("inside", "pop, culling on", Lost, [57_600.0; 2], CULLED),
    bound("inside", "pop, culling on", Holes, [1.0; 2], CULLED),
    row("inside", "splats-disc", Missing, [1.0, 120.0], "off the axis a ball's picture is an ellipse, longer than the disc that stands for it"),
    row("inside", "splats-disc", Holes, [1.0, 120.0], "off the axis a ball's picture is an ellipse, longer than the disc that stands for it"),
    bound("sheets-0.5", "gauss", Center(0), [95.0, 109.0], HALF_EACH),
    bound("sheets-0.5", "gauss", Center(1), [95.0, 109.0], HALF_EACH),
    bound("sheets-0.5", "gauss", Stray, [90.0, 115.0], HALF_EACH),
    bound("sheets-0.5", "gauss", Astray, [90.0, 100.0], HALF_EACH),
    bound("sheets-fine", SPLATS, Center(0), BOTH_SHEETS_RANGE, BOTH_SHEETS),
    bound("sheets-fine", SPLATS, Center(1), BOTH_SHEETS_RANGE, BOTH_SHEETS),
    // Green is 0 in all of the truth: a mean of pixels that each have the green of nodes, and every one of that by more than 32.
    bound("sheets-fine", SPLATS, Stray, BOTH_SHEETS_RANGE, BOTH_SHEETS),
    bound("sheets-fine", SPLATS, Astray, [100.0; 2], BOTH_SHEETS),
    row("opposite-normals", "filtered", Center(0), [0.0, 108.0], "its sums are of faces times vertex normals, which cancel"),
    row("opposite-normals", "filtered", Center(1), [0.0, 108.0], "its sums are of faces times vertex normals, which cancel"),
    row("opposite-normals", "filtered", Center(2), [0.0, 108.0], "its sums are of faces times vertex normals, which cancel"),
    row("opposite-normals", "filtered", Stray, [0.0, 90.0], "its sums are of faces times vertex normals, which cancel"),
    row("opposite-normals", "filtered", Astray, [0.0, 100.0], "its sums are of faces times vertex normals, which cancel"),
    row("checkerboard", "triangles|points", Center(0), [0.0, 204.0], "black or white instead of gray"),
    row("checkerboard", "triangles|points", Center(1), [0.0, 204.0], "black or white instead of gray"),
    row("checkerboard", "triangles|points", Center(2), [0.0, 204.0], "black or white instead of gray"),
    row("fence", "triangles", Lost, [4000.0, 8000.0], "wires of 0.4 pixels meet four centers of ten"),
    row("fence", "patches", Lost, [2000.0, 8000.0], "wires of 0.4 pixels, drawn as polygons, meet four centers of ten"),
    row("under-pixel", "triangles", Lost, [1.0; 2], "it meets no pixel center"),
    row("under-pixel", "filtered", Lost, [0.0, 1.0], "a node of the whole ball has no vector area and is left out"),
    row("pillars", "points|splats|splats-disc|splats-visibility", Stray, [25.0, 80.0], SIDES),
    row("pillars", "points|splats|splats-disc|splats-visibility", Astray, [14.0, 40.0], SIDES),
    row("pillars", "points", Moire, [25.0, 60.0], SIDES),
    row("thin-foil", "points", Missing, [13_000.0, 22_000.0], SPARSE),
    row("thin-foil", "points", Holes, [250.0, 700.0], SPARSE),
    row("thin-foil", "points", Stray, [25.0, 50.0], HIDDEN_VERTICES),
    row("thin-foil", "points", Astray, [15.0, 35.0], HIDDEN_VERTICES),
    row("thin-foil", "points", Moire, [20.0, 40.0], SPARSE),
    row("waves", "points", Holes, [5.0, 60.0], SPARSE),
    row("waves", "splats|splats-disc", Moire, [5.0, 16.0], FACETS),
    row("needles", "points", Missing, [5000.0, 8000.0], SPARSE),
    row("needles", "points", Holes, [40.0, 100.0], SPARSE),
    row("needles", "points", Lost, [2400.0, 4300.0], SPARSE),
    row("needles", "points", Astray, [1.0, 6.0], SPARSE),
    row("needles", "gauss", Holes, [0.0, 3.0], "in a corner of the rim a sum of weights falls short of half"),
    row("huge-triangle", "points", Missing, [6000.0, 8000.0], SPARSE),
    row("huge-triangle", "points", Lost, [6000.0, 8000.0], SPARSE),
    row("coincident-vertices", "points", Missing, [9000.0, 14_400.0], "the square has four vertices; the rest are points without area"),
    row("coincident-vertices", "points", Lost, [5500.0, 9500.0], "the square has four vertices; the rest are points without area"),
    row("coincident-vertices", "points", Stray, [150.0, 204.0], "the square has four vertices; the rest are points without area"),
    row("coincident-vertices", "points", Astray, [95.0, 100.0], "the square has four vertices; the rest are points without area"),
    row("duplicate-points", "points", Center(0), [0.0; 2], SPARSE),
    row("duplicate-points", "points", Center(1), [0.0; 2], SPARSE),
    row("duplicate-points", "points", Center(2), [0.0; 2], SPARSE),
    row("near-points", "points", Covered, [9.0; 2], "nine pixels: vertices farther apart than the square leave holes"),
    row("near-plane", "splats-ellipse|splats-gauss|splats-visibility", Missing, [0.0, 1200.0], BEFORE_NEAR),
    row("near-plane", "splats-ellipse|splats-gauss|splats-visibility", Lost, [0.0, 600.0], BEFORE_NEAR),
    row("near-plane", "points", Missing, [11_000.0, 19_000.0], SPARSE),
    row("near-plane", "points", Holes, [15.0, 60.0], SPARSE),
    row("near-plane", "points", Lost, [8500.0, 14_500.0], SPARSE),
    row("inside", "points", Missing, [18_000.0, 30_000.0], SPARSE),
    row("inside", "points", Holes, [1.0, 5.0], SPARSE),
    row("inside", "points", Lost, [2000.0, 5000.0], SPARSE),
    row("georeferenced microscopic", "points", Holes, [1.0, 10.0], SPARSE),
    row("one-triangle", "points", Missing, [7000.0, 7200.0], SPARSE),
    row("one-triangle", "points", Lost, [7100.0, 7320.0], SPARSE),
    row("horizon", "points", Moire, [0.0, 10.0], SPARSE),
    row("horizon", "splats|splats-disc|splats-ellipse", Moire, [5.0, 14.0], BANDS),
    row("thin-plate", "points", Moire, [10.0, 25.0], HIDDEN_VERTICES),
    row("opposite-normals", "filtered", Moire, [0.0, 13.0], "its sums are of faces times vertex normals, which cancel"),
    row("checkerboard", "triangles|points", Moire, [40.0, 70.0], "one sample of each pixel makes a coarse board that is not there"),
    row("noise", "points", Moire, [0.0, 11.0], "one vertex of several in a pixel"),
    row("noise", "splats-ellipse|splats-visibility", Moire, [8.0, 22.0], FACETS),
    row("noise", "splats-ellipse|splats-visibility", Astray, [0.0, 4.0], FACETS),
    row("foliage", "points", Moire, [0.0, 13.0], "squares of 5 pixels for leaves of 3"),
    row("foliage", "filtered|splats-filtered", Holes, [0.0, 90.0], "beside a pixel without a leaf coverage is an estimate: the areas of leaves in all directions may fall short of half"),
    row("foliage", "gauss|splats-gauss", Holes, [0.0, 40.0], "leaves in all directions in a node, or seen edge-on: sums of weights fall short of half"),
    row("under-pixel", "points", Stray, [10.0, 40.0], "the ball's rim is black, and a vertex on it is a whole pixel"),
    row("under-pixel", "points", Astray, [20.0, 50.0], "the ball's rim is black, and a vertex on it is a whole pixel"),
    row("needles", "splats-visibility", Moire, [3.0, 12.0], "one normal for all of a needle"),
];
