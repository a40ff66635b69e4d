//! The rules that hold for every scene, and the verdict on a picture.

use super::colors::FARTHEST_PX;
use super::figures::{FailureCase, FailureFigure};
use super::{FailureLook, FailuresError, rows};
use crate::image::Image;
use crate::render::{Method, SplatKind};

/// What is said of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FailureVerdict {
    /// Within the rules and the rows.
    Pass,
    /// Against a rule, within a row that says how far and why.
    Limit,
    /// Outside of a row, or against a rule without a row.
    Fail,
}

impl FailureVerdict {
    /// As tables have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Limit => "known limit",
            Self::Fail => "FAIL",
        }
    }
}

/// A figure, the range that is stated for it, and the reason.
#[derive(Debug, Clone, PartialEq)]
pub struct FailureBound {
    /// What is bounded.
    pub figure: FailureFigure,
    /// What was measured.
    pub value: f64,
    /// At least and at most.
    pub range: [f64; 2],
    /// The reason.
    pub why: &'static str,
    /// What the value says.
    pub verdict: FailureVerdict,
}

/// The verdict on one picture.
#[derive(Debug, Clone)]
pub struct FailureCell {
    /// The scene.
    pub scene: &'static str,
    /// The way of drawing.
    pub look: &'static str,
    /// Everything measured.
    pub figures: Vec<(FailureFigure, f64)>,
    /// Everything stated.
    pub bounds: Vec<FailureBound>,
    /// The worst of them; [`FailureVerdict::Fail`] where nothing is stated.
    pub verdict: FailureVerdict,
}

impl FailureCell {
    /// A figure, where it was measured.
    pub fn figure(&self, figure: FailureFigure) -> Option<f64> {
        let found = self.figures.iter().find(|(f, _)| *f == figure);
        found.map(|(_, value)| *value)
    }

    /// Why it is no pass, one reason a line; empty for a pass.
    pub fn cause(&self) -> String {
        let mut lines = Vec::new();
        for bound in &self.bounds {
            let [least, most] = bound.range;
            let name = bound.figure.name();
            let line = match bound.verdict {
                FailureVerdict::Pass => continue,
                FailureVerdict::Limit => bound.why.to_owned(),
                FailureVerdict::Fail => format!(
                    "{name} is {:.4}, not {least} to {most}: {}",
                    bound.value, bound.why
                ),
            };
            if !lines.contains(&line) {
                lines.push(line);
            }
        }
        if self.bounds.is_empty() {
            lines.push("no bound is stated".into());
        }
        lines.join("\n")
    }
}

/// Mean distance of colors from the range that the truth has around them, levels: half of what is seen as a step.
const STRAY: f64 = 4.0;
/// Percentage of pixels whose color may lie farther than 32 levels outside of it.
const ASTRAY: f64 = 1.0;

/// How much nearer to the truth a picture may come by being blurred, levels: that of the color at the center.
const MOIRE: f64 = 6.0;

/// How far from where the surface is a look may show it, pixels; infinite where a splat of its own size reaches the near
/// plane.
///
/// A node is at most a threshold t wide, so its center lies at most t/2 from the surface; then comes half of the
/// footprint's largest diameter: a square's diagonal, a disc's diameter. Discs in the plane of the surface hold all of
/// their node around its center: t/2 and t/2 again. A pixel more is the rounding to centers. In `splats`, and in clouds,
/// t is the largest leaf where that is larger.
pub fn reach_px(case: &FailureCase, look: &FailureLook) -> f64 {
    let has_own_size = look.settings.method == Method::Splats
        || (look.settings.method == Method::Pop && case.model.kind().is_points());
    let mut t = f64::from(case.splat_px(look).max(1.0));
    if has_own_size {
        t = t.max(case.largest_px);
    }
    let half = 0.5f64.sqrt();
    1.0 + match (look.settings.method, look.settings.splat) {
        (Method::Triangles, _) => 0.0,
        // Vertices lie on the surface.
        (Method::Points, _) => t * half,
        (_, SplatKind::Square | SplatKind::Filtered) => t * (0.5 + half),
        _ => t,
    }
}

/// The ranges that hold where no row says otherwise, with the reasons.
pub fn rules(
    case: &FailureCase,
    look: &FailureLook,
) -> Vec<(FailureFigure, [f64; 2], &'static str)> {
    let mut rules = Vec::new();
    let reach = reach_px(case, look);
    if reach < FARTHEST_PX {
        rules.push((
            FailureFigure::Reach,
            [0.0, reach],
            "half a node and half a footprint from the surface, and a pixel",
        ));
    }
    if case.truth.is_some() {
        let has_estimate = look.settings.method != Method::Triangles
            && matches!(look.settings.splat, SplatKind::Filtered | SplatKind::Gauss);
        rules.extend([
            if has_estimate {
                (
                    FailureFigure::Missing,
                    [0.0, case.cut_px.max(case.outline_px)],
                    "coverage is an estimate: pixels of the outline may fall short of half",
                )
            } else {
                (
                    FailureFigure::Missing,
                    [0.0, case.cut_px],
                    "only pixels that an outline cuts may be missing",
                )
            },
            (
                FailureFigure::Holes,
                [0.0; 2],
                "a surface without gaps is drawn without gaps",
            ),
            (
                FailureFigure::Lost,
                [0.0, (case.covered_px / 1000.0).floor()],
                "what covers a quarter of a pixel shows within a pixel, but for one in a thousand",
            ),
        ]);
        // Of two surfaces in one place neither is the right one.
        if case.expected.gap != Some(0.0) {
            rules.extend([
                (
                    FailureFigure::Stray,
                    [0.0, STRAY],
                    "colors are those of the surface near by",
                ),
                (
                    FailureFigure::Astray,
                    [0.0, ASTRAY],
                    "colors are those of the surface near by",
                ),
                (
                    FailureFigure::Moire,
                    [0.0, MOIRE],
                    "no pattern that is not there: blurred over a node it is not much nearer to the truth",
                ),
            ]);
        }
    }
    if let (true, Some(squares)) = (case.model.kind().is_points(), case.expected.squares_px)
        && look.settings.draws_splats()
    {
        rules.push((
            FailureFigure::Covered,
            [0.75 * squares, squares],
            "a square, or the disc in it, for every point",
        ));
    }
    if look.settings.method == Method::Triangles && case.model.kind().is_points() {
        rules.push((FailureFigure::Covered, [0.0; 2], "a cloud has no triangles"));
    } else if let (Some(color), true) = (case.expected.color, case.has_center) {
        // Rounding in several places, and the light of a splat some pixels away.
        rules.extend((0..3).map(|c| {
            let value = f64::from(color[c]);
            (
                FailureFigure::Center(c),
                [value - 6.0, value + 6.0],
                "the closed form of the center's color",
            )
        }));
    }
    rules
}

impl FailureCase {
    /// Measures a picture of `look` and holds it to the rules and the rows.
    ///
    /// # Errors
    /// When the picture has another size than the scene.
    pub fn judge(&self, look: &FailureLook, picture: &Image) -> Result<FailureCell, FailuresError> {
        let figures = self.measure(picture, reach_px(self, look))?;
        let rules = rules(self, look);
        let mut bounds = Vec::new();
        for &(figure, value) in &figures {
            let rule = rules.iter().find(|(f, ..)| *f == figure);
            let is_right =
                rule.is_none_or(|(_, [least, most], _)| (*least..=*most).contains(&value));
            let stated: Vec<_> = rows::of(self.entry.name, look.name, figure).collect();
            if stated.is_empty()
                && let Some(&(_, range, why)) = rule
            {
                bounds.push(FailureBound {
                    figure,
                    value,
                    range,
                    why,
                    verdict: if is_right {
                        FailureVerdict::Pass
                    } else {
                        FailureVerdict::Fail
                    },
                });
            }
            bounds.extend(stated.into_iter().map(|row| {
                let [least, most] = row.range;
                let verdict = match ((least..=most).contains(&value), is_right || row.is_bound) {
                    (false, _) => FailureVerdict::Fail,
                    (true, true) => FailureVerdict::Pass,
                    (true, false) => FailureVerdict::Limit,
                };
                FailureBound {
                    figure,
                    value,
                    range: row.range,
                    why: row.why,
                    verdict,
                }
            }));
        }
        let has = |v: FailureVerdict| bounds.iter().any(|b| b.verdict == v);
        let verdict = if bounds.is_empty() || has(FailureVerdict::Fail) {
            FailureVerdict::Fail
        } else if has(FailureVerdict::Limit) {
            FailureVerdict::Limit
        } else {
            FailureVerdict::Pass
        };
        Ok(FailureCell {
            scene: self.entry.name,
            look: look.name,
            figures,
            bounds,
            verdict,
        })
    }
}
