//! Whether two charts of the same models say the same: what is on the frontier and in which order, and times relative to
//! triangles.

use super::choice::TRIANGLES;
use super::summary::{SummaryPanel, SummaryPoint};

/// How far apart two ratios of times may be, as a factor: the 15 percent within which they agree.
pub const LARGEST_FACTOR: f64 = 1.15;
/// Errors that differ by less than this share are one: the frontier asks for as much.
const SAME_ERROR: f64 = 1.01;

/// A ratio of times that differs between two charts.
#[derive(Debug, Clone, PartialEq)]
pub struct CountRatio {
    /// Name of the choice.
    pub name: String,
    /// How many times faster than triangles it is, in the first and in the second chart.
    pub speeds: [f64; 2],
}

impl CountRatio {
    /// The larger over the smaller: at least 1.
    pub fn factor(&self) -> f64 {
        let [a, b] = self.speeds;
        (a / b).max(b / a)
    }
}

/// What two charts say of one model at one distance.
#[derive(Debug, Clone, PartialEq)]
pub struct ReferenceAgreement {
    /// Name of the model.
    pub model: String,
    /// The distance, as [`SummaryPanel::fill`].
    pub fill: f64,
    /// How many ratios there are in both.
    pub compared: usize,
    /// Ratios that are farther apart than [`LARGEST_FACTOR`], the worst first.
    pub off: Vec<CountRatio>,
    /// Median over the choices (without triangles) of the second speed over the first. Far from 1 it is the time of
    /// triangles that differs, and with it every ratio.
    pub common: f64,
    /// Choices whose mean FLIP differs by more than a hundredth; a device gives the same pictures again.
    pub other_errors: Vec<String>,
    /// Choices that are on both frontiers in another order.
    pub out_of_order: Vec<String>,
    /// Choices that are on one frontier, and on the other chart beaten by more than the 15 percent.
    pub moved: Vec<String>,
    /// Choices that are on one frontier only, and would be on the other if times were within 15 percent: ties.
    pub tied: Vec<String>,
}

impl ReferenceAgreement {
    /// Tells whether the two say the same.
    pub fn is_kept(&self) -> bool {
        self.off.is_empty()
            && self.other_errors.is_empty()
            && self.out_of_order.is_empty()
            && self.moved.is_empty()
    }
}

/// The time that others are measured by: that of triangles, of clouds that of the first choice that both have.
fn unit(panel: &SummaryPanel, other: &SummaryPanel) -> Option<f64> {
    let is_shared = |p: &&SummaryPoint| other.points.iter().any(|q| q.choice == p.choice);
    let first = || panel.points.iter().find(is_shared);
    panel
        .triangles_point()
        .or_else(first)
        .map(|p| p.frame.median)
}

/// Tells whether a point of a chart is beaten by another, by more than what is a tie.
fn is_beaten(panel: &SummaryPanel, point: &SummaryPoint) -> bool {
    panel.points.iter().any(|other| {
        other.frame.median * LARGEST_FACTOR < point.frame.median
            && other.flip <= point.flip * SAME_ERROR
    })
}

/// Compares the panels that are in both charts, in the order of the first; `None` where the two have none in common.
pub fn agreement(
    first: &[SummaryPanel],
    second: &[SummaryPanel],
) -> Option<Vec<ReferenceAgreement>> {
    let compare = |a: &SummaryPanel| {
        let is_same = |b: &&SummaryPanel| b.model == a.model && b.fill == a.fill;
        second.iter().find(is_same).map(|b| of_panels(a, b))
    };
    let all: Vec<ReferenceAgreement> = first.iter().filter_map(compare).collect();
    (!all.is_empty()).then_some(all)
}

fn of_panels(a: &SummaryPanel, b: &SummaryPanel) -> ReferenceAgreement {
    let mut found = ReferenceAgreement {
        model: a.model.clone(),
        fill: a.fill,
        compared: 0,
        off: Vec::new(),
        common: 1.0,
        other_errors: Vec::new(),
        out_of_order: Vec::new(),
        moved: Vec::new(),
        tied: Vec::new(),
    };
    let in_b = |p: &SummaryPoint| b.points.iter().position(|q| q.choice == p.choice);
    let mut changes = Vec::new();
    if let (Some(of_a), Some(of_b)) = (unit(a, b), unit(b, a)) {
        for p in &a.points {
            let Some(q) = in_b(p).map(|i| &b.points[i]) else {
                continue;
            };
            found.compared += 1;
            let name = p.choice.name();
            let ratio = CountRatio {
                name: name.clone(),
                speeds: [of_a / p.frame.median, of_b / q.frame.median],
            };
            if p.choice != TRIANGLES {
                changes.push(ratio.speeds[1] / ratio.speeds[0]);
            }
            if ratio.factor() > LARGEST_FACTOR {
                found.off.push(ratio);
            }
            let [least, most] = [p.flip.min(q.flip), p.flip.max(q.flip)];
            if most > least * SAME_ERROR {
                found.other_errors.push(name);
            }
        }
    }
    changes.sort_by(f64::total_cmp);
    if let Some(&middle) = changes.get(changes.len() / 2) {
        found.common = middle;
    }
    found.off.sort_by(|x, y| y.factor().total_cmp(&x.factor()));
    // Frontiers go from fast to slow: what is on both must come in one order.
    let mut last = 0;
    for p in a.frontier.iter().map(|&i| &a.points[i]) {
        let place = in_b(p).and_then(|i| b.frontier.iter().position(|&j| j == i));
        match place {
            Some(place) if place < last => found.out_of_order.push(p.choice.name()),
            Some(place) => last = place,
            None => {}
        }
    }
    for (from, to) in [(a, b), (b, a)] {
        for p in from.frontier.iter().map(|&i| &from.points[i]) {
            let there = to.points.iter().position(|q| q.choice == p.choice);
            let Some(there) = there.filter(|i| !to.frontier.contains(i)) else {
                continue;
            };
            let list = if is_beaten(to, &to.points[there]) {
                &mut found.moved
            } else {
                &mut found.tied
            };
            list.push(p.choice.name());
        }
    }
    found
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::super::row::tests::row;
    use super::super::summary::summarize;
    use super::super::{AvailablePaths, ChartRow, DrawConfiguration};
    use super::*;

    /// Panels of choices with these times and errors.
    fn panels(points: &[(f64, f64)]) -> Vec<SummaryPanel> {
        let choices = DrawConfiguration::few(false, AvailablePaths::ALL);
        let rows: Vec<ChartRow> = (points.iter().zip(choices))
            .map(|(&(ms, flip), choice)| {
                let mut r = row("m", choice, 1.0, 0);
                (r.frame_ms, r.flip) = (ms, flip);
                r
            })
            .collect();
        summarize(&rows)
    }

    const FIRST: [(f64, f64); 4] = [(60.0, 0.01), (6.0, 0.05), (20.0, 0.02), (30.0, 0.03)];

    fn against_first(points: &[(f64, f64)]) -> ReferenceAgreement {
        let found = agreement(&panels(&FIRST), &panels(points)).unwrap();
        assert_eq!(found.len(), 1);
        found.into_iter().next().unwrap()
    }

    #[test]
    fn a_chart_agrees_with_itself_and_on_a_machine_of_another_speed() {
        let itself = against_first(&FIRST);
        assert!(itself.is_kept() && itself.compared == 4, "{itself:?}");
        let slower: Vec<(f64, f64)> = FIRST.iter().map(|&(ms, flip)| (3.0 * ms, flip)).collect();
        let slower = against_first(&slower);
        assert!(slower.is_kept() && slower.tied.is_empty(), "{slower:?}");
        assert_eq!(agreement(&panels(&FIRST), &[]), None);
    }

    #[test]
    fn ratios_beyond_15_percent_are_named_the_worst_first() {
        let mut points = FIRST;
        points[2].0 = 20.0 * 1.14;
        assert!(against_first(&points).is_kept());
        points[2].0 = 20.0 / 1.3;
        points[3].0 = 30.0 * 1.5;
        let found = against_first(&points);
        let names: Vec<&str> = found.off.iter().map(|r| r.name.as_str()).collect();
        let all = DrawConfiguration::few(false, AvailablePaths::ALL);
        assert_eq!(names, [all[3].name(), all[2].name()]);
        assert!((found.off[0].factor() - 1.5).abs() < 1e-9 && !found.is_kept());
        // When triangles were slow all others look fast.
        let mut points = FIRST;
        points[0].0 = 60.0 * 1.2;
        let found = against_first(&points);
        assert_eq!(found.off.len(), 3);
        assert!((found.common - 1.2).abs() < 1e-9);
        assert!((against_first(&FIRST).common - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_frontier_may_change_by_ties_alone() {
        // A choice of nearly the same error that is faster by less than 15 percent takes the place of another.
        let mut points = FIRST;
        points[3] = (19.0, 0.02);
        let mut first = FIRST;
        first[3] = (21.0, 0.02);
        let found = agreement(&panels(&first), &panels(&points)).unwrap();
        assert_eq!(found[0].tied.len(), 2, "{found:?}");
        assert!(found[0].is_kept());
        // By more it is another frontier.
        points[3] = (10.0, 0.02);
        let found = agreement(&panels(&first), &panels(&points)).unwrap();
        assert!(
            !found[0].is_kept() && !found[0].moved.is_empty(),
            "{found:?}"
        );
        // Two that change places.
        let mut points = FIRST;
        points[1] = (6.0, 0.02);
        points[2] = (5.0, 0.05);
        let found = against_first(&points);
        assert_eq!(found.out_of_order.len(), 1, "{found:?}");
        assert_eq!(found.other_errors.len(), 2);
    }
}
