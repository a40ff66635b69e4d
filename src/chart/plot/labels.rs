//! Places labels where they hide nothing.

/// Rectangle: left, top, right, bottom.
type LabelBox = [f64; 4];

/// A label with its place.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PlotLabel {
    /// What it says.
    pub(super) text: String,
    /// Left end of its baseline.
    pub(super) at: [f64; 2],
    /// Where a line to its point ends.
    pub(super) anchor: [f64; 2],
}

/// Finds places within a field, greedily in the order of asking.
#[derive(Debug)]
pub(super) struct LabelPlacer {
    field: LabelBox,
    markers: Vec<([f64; 2], f64)>,
    labels: Vec<LabelBox>,
}

/// Width of a character and height of a line at the size of labels, pixels; wide enough for most fonts.
const CHARACTER: [f64; 2] = [6.6, 13.0];

/// Lines are looked at in steps of so many pixels: half the height of a label.
const STEP: f64 = 6.0;

/// Radius of the markers that stand for a line.
const LINE: f64 = 1.0;

/// Tried in this order at equal cost: to the upper right and the lower left a frontier leaves room.
const DIRECTIONS: [[f64; 2]; 8] = [
    [0.8, -0.6],
    [-0.8, 0.6],
    [0.0, -1.0],
    [1.0, 0.0],
    [0.6, 0.8],
    [-0.6, -0.8],
    [0.0, 1.0],
    [-1.0, 0.0],
];

impl LabelPlacer {
    pub(super) fn new(field: LabelBox) -> Self {
        Self {
            field,
            markers: Vec::new(),
            labels: Vec::new(),
        }
    }

    /// Keeps labels off a marker of radius `r`, as far as there is room elsewhere.
    pub(super) fn avoid(&mut self, at: [f64; 2], r: f64) {
        self.markers.push((at, r));
    }

    /// Keeps labels off a line through `places`, less than off markers.
    pub(super) fn avoid_line(&mut self, places: &[[f64; 2]]) {
        for pair in places.windows(2) {
            let ([x0, y0], [x1, y1]) = (pair[0], pair[1]);
            let steps = ((x1 - x0).hypot(y1 - y0) / STEP).ceil().max(1.0);
            for i in 0..=steps as u32 {
                let t = f64::from(i) / steps;
                self.avoid([x0 + t * (x1 - x0), y0 + t * (y1 - y0)], LINE);
            }
        }
    }

    /// The best place for a label of a point; `None` where all would lie over other labels.
    pub(super) fn place(&mut self, point: [f64; 2], text: &str) -> Option<PlotLabel> {
        let size = [CHARACTER[0] * text.chars().count() as f64, CHARACTER[1]];
        let mut best: Option<(f64, LabelBox, [f64; 2])> = None;
        for distance in [11.0, 20.0, 32.0, 46.0, 62.0, 80.0, 100.0] {
            for [dx, dy] in DIRECTIONS {
                let anchor = [point[0] + dx * distance, point[1] + dy * distance];
                // The side that faces the point is at the anchor.
                let left = anchor[0] - size[0] * (0.5 - 0.5 * (dx * 1.25).clamp(-1.0, 1.0));
                let top = anchor[1] - size[1] * (0.5 - 0.5 * dy);
                let rect = [left, top, left + size[0], top + size[1]];
                let is_inside = rect[0] >= self.field[0] + 2.0
                    && rect[1] >= self.field[1] + 2.0
                    && rect[2] <= self.field[2] - 2.0
                    && rect[3] <= self.field[3] - 2.0;
                if !is_inside || self.labels.iter().any(|l| overlap(l, &rect)) {
                    continue;
                }
                let hidden: f64 = self
                    .markers
                    .iter()
                    .filter(|(at, r)| overlap(&rect, &[at[0] - r, at[1] - r, at[0] + r, at[1] + r]))
                    .map(|(_, r)| r * if *r > LINE { 15.0 } else { 6.0 })
                    .sum();
                let cost = hidden + distance;
                if best.as_ref().is_none_or(|b| cost < b.0) {
                    best = Some((cost, rect, anchor));
                }
            }
        }
        let (_, rect, anchor) = best?;
        self.labels.push(rect);
        Some(PlotLabel {
            text: text.to_owned(),
            at: [rect[0], rect[3] - 3.0],
            anchor,
        })
    }
}

fn overlap(a: &LabelBox, b: &LabelBox) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    #[test]
    fn labels_lie_inside_apart_from_each_other_and_beside_markers() {
        let mut placer = LabelPlacer::new([0.0, 0.0, 400.0, 300.0]);
        let points: Vec<[f64; 2]> = (0..9)
            .map(|i| [20.0 + 45.0 * f64::from(i), 280.0 - 32.0 * f64::from(i)])
            .collect();
        for point in &points {
            placer.avoid(*point, 8.0);
        }
        for point in &points {
            placer.place(*point, "filtered 2").unwrap();
        }
        for (i, a) in placer.labels.iter().enumerate() {
            assert!(a[0] >= 0.0 && a[1] >= 0.0 && a[2] <= 400.0 && a[3] <= 300.0);
            assert!(!placer.labels[..i].iter().any(|b| overlap(a, b)));
            assert!(
                !points
                    .iter()
                    .any(|p| overlap(a, &[p[0] - 5.0, p[1] - 5.0, p[0] + 5.0, p[1] + 5.0]))
            );
        }
        // Off a line too, where there is room beside it.
        let mut placer = LabelPlacer::new([0.0, 0.0, 400.0, 300.0]);
        placer.avoid_line(&[[50.0, 250.0], [350.0, 50.0]]);
        let label = placer.place([200.0, 150.0], "filtered 2").unwrap();
        let [left, top, right, bottom] = placer.labels[0];
        for i in 0..=300 {
            let (x, y) = (50.0 + f64::from(i), 250.0 - f64::from(i) * 2.0 / 3.0);
            assert!(
                !(left < x && x < right && top < y && y < bottom),
                "{label:?}"
            );
        }
        // In a corner, with a line below and a marker beside it: off the marker, farther away.
        let mut placer = LabelPlacer::new([0.0, 0.0, 400.0, 300.0]);
        let (point, other) = ([20.0, 16.0], [60.0, 16.0]);
        placer.avoid(point, 4.5);
        placer.avoid(other, 4.5);
        placer.avoid_line(&[point, [26.0, 130.0], [40.0, 280.0]]);
        placer.avoid_line(&[other, [90.0, 80.0]]);
        placer.place(point, "square (c) 4").unwrap();
        let marker = [
            other[0] - 4.5,
            other[1] - 4.5,
            other[0] + 4.5,
            other[1] + 4.5,
        ];
        assert!(!overlap(&placer.labels[0], &marker), "{placer:?}");
        let mut placer = LabelPlacer::new([0.0, 0.0, 400.0, 300.0]);
        // What has no room gets none.
        assert_eq!(placer.place([200.0, 150.0], &"x".repeat(100)), None);
    }
}
