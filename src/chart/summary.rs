//! Rows of all views put together: a point a choice, and the frontier.

use super::{ChartRow, DrawConfiguration, frontier};
use crate::measure::ValueDistribution;

/// A choice at one distance from a model: means over the views, and the worst view.
#[derive(Debug, Clone, PartialEq)]
pub struct SummaryPoint {
    /// The choice.
    pub choice: DrawConfiguration,
    /// How many views there are.
    pub views: u32,
    /// Frame, milliseconds: means over the views of their median, 5th and 95th percentile.
    pub frame: ValueDistribution,
    /// Processor's part of it, milliseconds: mean of the views' medians.
    pub cpu_ms: f64,
    /// Mean FLIP.
    pub flip: f64,
    /// Mean FLIP of the worst view.
    pub worst_flip: f64,
    /// Mean FLIP over object pixels.
    pub flip_object: f64,
    /// Root of the mean squared difference over object pixels, 0..=1: of all views together.
    pub rmse_object: f64,
    /// One less the structural similarity.
    pub dissimilarity: f64,
    /// Missing and extra pixels a view.
    pub wrong_pixels: f64,
    /// Pixels in holes a view.
    pub hole_pixels: f64,
    /// Distance of the outlines, pixels: mean.
    pub silhouette_px: f64,
    /// 99th percentile, of the worst view.
    pub silhouette_p99_px: f64,
    /// Depth error in footprints; NaN where there is none.
    pub depth: f64,
    /// Normal error in degrees; NaN where there is none.
    pub normal: f64,
    /// Triangles, splats and points drawn a view.
    pub primitives: f64,
}

/// What is slower is on the frontier only for this share less of an error.
const LEAST_GAIN: f64 = 0.01;

/// The points of one model at one distance.
#[derive(Debug, Clone, PartialEq)]
pub struct SummaryPanel {
    /// Name of the model.
    pub model: String,
    /// Number of triangles of the model.
    pub triangles: u64,
    /// Number of vertices of the model.
    pub vertices: u64,
    /// Projected diameter of the bounding sphere over the shorter side.
    pub fill: f64,
    /// All that was measured, in the order of the rows.
    pub points: Vec<SummaryPoint>,
    /// Indices of the points that none beats in frame time and mean FLIP, fastest first; each has a hundredth less FLIP
    /// than the one before.
    pub frontier: Vec<usize>,
    /// What was refused, and why.
    pub refused: Vec<(String, String)>,
}

impl SummaryPanel {
    /// The point of triangles by the rasterizer.
    pub fn triangles_point(&self) -> Option<&SummaryPoint> {
        self.points
            .iter()
            .find(|p| p.choice == super::choice::TRIANGLES)
    }

    /// How many times faster than triangles a point is; NaN for clouds.
    pub fn speed(&self, point: &SummaryPoint) -> f64 {
        self.triangles_point()
            .map_or(f64::NAN, |t| t.frame.median / point.frame.median)
    }

    /// The cheapest point whose mean FLIP is at most `bound` in every view.
    pub fn cheapest(&self, bound: f64) -> Option<&SummaryPoint> {
        self.points
            .iter()
            .filter(|p| p.worst_flip <= bound)
            .min_by(|a, b| a.frame.median.total_cmp(&b.frame.median))
    }
}

fn mean(rows: &[&ChartRow], of: impl Fn(&ChartRow) -> f64) -> f64 {
    rows.iter().map(|r| of(r)).sum::<f64>() / rows.len() as f64
}

/// As [`mean`] of those that have a value.
fn mean_of_known(rows: &[&ChartRow], of: impl Fn(&ChartRow) -> f64) -> f64 {
    let known: Vec<f64> = rows.iter().map(|r| of(r)).filter(|v| !v.is_nan()).collect();
    known.iter().sum::<f64>() / known.len() as f64
}

fn point(choice: DrawConfiguration, rows: &[&ChartRow]) -> SummaryPoint {
    SummaryPoint {
        choice,
        views: rows.len() as u32,
        frame: ValueDistribution {
            median: mean(rows, |r| r.frame_ms),
            p5: mean(rows, |r| r.frame_p5_ms),
            p95: mean(rows, |r| r.frame_p95_ms),
        },
        cpu_ms: mean(rows, |r| r.cpu_ms),
        flip: mean(rows, |r| r.flip),
        worst_flip: rows.iter().map(|r| r.flip).fold(0.0, f64::max),
        flip_object: mean(rows, |r| r.flip_object),
        // PSNR is -20 log10(rmse); squares are what has a mean.
        rmse_object: mean(rows, |r| 10f64.powf(-r.psnr_object_db / 10.0)).sqrt(),
        dissimilarity: mean(rows, |r| 1.0 - r.ssim),
        wrong_pixels: mean(rows, |r| (r.missing + r.extra) as f64),
        hole_pixels: mean(rows, |r| r.hole_pixels as f64),
        silhouette_px: mean(rows, |r| r.silhouette_mean_px),
        silhouette_p99_px: rows.iter().map(|r| r.silhouette_p99_px).fold(0.0, f64::max),
        depth: mean_of_known(rows, |r| r.depth_mean_footprints),
        normal: mean_of_known(rows, |r| r.normal_mean_degrees),
        primitives: mean(rows, |r| (r.triangles + r.splats + r.points) as f64),
    }
}

/// Panels in the order in which models and distances come first in the rows. A choice that some views refuse has no
/// point.
pub fn summarize(rows: &[ChartRow]) -> Vec<SummaryPanel> {
    let mut panels: Vec<SummaryPanel> = Vec::new();
    let same = |p: &SummaryPanel, r: &ChartRow| {
        p.model == r.model
            && p.fill == r.fill
            && p.triangles == r.model_triangles
            && p.vertices == r.model_vertices
    };
    for row in rows {
        if !panels.iter().any(|p| same(p, row)) {
            panels.push(SummaryPanel {
                model: row.model.clone(),
                triangles: row.model_triangles,
                vertices: row.model_vertices,
                fill: row.fill,
                points: Vec::new(),
                frontier: Vec::new(),
                refused: Vec::new(),
            });
        }
    }
    for panel in &mut panels {
        let own: Vec<&ChartRow> = rows.iter().filter(|r| same(panel, r)).collect();
        let mut choices: Vec<DrawConfiguration> = Vec::new();
        for choice in own.iter().filter_map(|r| r.choice()) {
            if !choices.contains(&choice) {
                choices.push(choice);
            }
        }
        for choice in choices {
            let of: Vec<&ChartRow> = own
                .iter()
                .filter(|r| r.choice() == Some(choice))
                .copied()
                .collect();
            match of.iter().find(|r| !r.refused.is_empty()) {
                Some(row) => panel.refused.push((choice.name(), row.refused.clone())),
                None => panel.points.push(point(choice, &of)),
            }
        }
        let times: Vec<[f64; 2]> = panel
            .points
            .iter()
            .map(|p| [p.frame.median, p.flip])
            .collect();
        panel.frontier = frontier(&times);
        // Twins have one picture up to rounding: the slower of them gains nothing.
        let mut least = f64::INFINITY;
        panel.frontier.retain(|&i| {
            let is_kept = times[i][1] < (1.0 - LEAST_GAIN) * least;
            if is_kept {
                least = times[i][1];
            }
            is_kept
        });
    }
    panels
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::super::AvailablePaths;
    use super::super::choice::TRIANGLES;
    use super::super::row::tests::row;
    use super::*;

    #[test]
    fn views_are_averaged_and_the_worst_is_kept() {
        let few = DrawConfiguration::few(false, AvailablePaths::NONE);
        let (slow, fast, refused) = (TRIANGLES, few[2], few[3]);
        let mut rows = Vec::new();
        for view in 0..2 {
            for (choice, ms, flip) in [(slow, 30.0, 0.001), (fast, 3.0, 0.004), (refused, 1.0, 0.0)]
            {
                let mut r = row("m", choice, 1.0, view);
                r.frame_ms = ms * f64::from(view + 1);
                r.flip = flip * f64::from(2 * view + 1);
                r.psnr_object_db = [20.0, f64::INFINITY][view as usize];
                r.normal_mean_degrees = [4.0, f64::NAN][view as usize];
                if choice == refused && view == 1 {
                    r.refused = "why".into();
                }
                rows.push(r);
            }
        }
        rows.push(row("m", slow, 0.5, 0));
        let panels = summarize(&rows);
        assert_eq!(panels.len(), 2);
        let p = &panels[0];
        assert_eq!(p.points.len(), 2);
        assert_eq!(p.refused, vec![(refused.name(), "why".to_owned())]);
        let f = &p.points[1];
        assert_eq!((f.frame.median, f.views), (4.5, 2));
        assert!((f.flip - 0.008).abs() < 1e-12 && (f.worst_flip - 0.012).abs() < 1e-12);
        // Mean squares of 0.01 and 0.
        assert!((f.rmse_object - 0.005f64.sqrt()).abs() < 1e-12);
        assert_eq!(f.normal, 4.0);
        assert_eq!(p.frontier, vec![1, 0]);
        assert!((p.speed(f) - 10.0).abs() < 1e-12);
        // The mean would keep this bound, the worst view does not.
        assert_eq!(p.cheapest(0.01).unwrap().choice, slow);
        assert_eq!(p.cheapest(0.012001).unwrap().choice, fast);
        assert!(p.cheapest(1e-9).is_none());
    }

    #[test]
    fn what_gains_next_to_nothing_is_not_on_the_frontier() {
        let few = DrawConfiguration::few(false, AvailablePaths::ALL);
        let rows: Vec<ChartRow> = [(1.0, 0.1), (2.0, 0.0999), (3.0, 0.0995), (4.0, 0.05)]
            .iter()
            .zip(&few)
            .map(|(&(ms, flip), choice)| {
                let mut r = row("m", *choice, 1.0, 0);
                (r.frame_ms, r.flip) = (ms, flip);
                r
            })
            .collect();
        assert_eq!(summarize(&rows)[0].frontier, vec![0, 3]);
    }
}
