//! What is measured: a method with its splat, its path and its threshold.

use crate::method::{Method, Path, Settings, SplatKind};

/// One way to draw a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// The method.
    pub method: Method,
    /// What its splats look like; of no account for triangles.
    pub splat: SplatKind,
    /// By rasterizer or by compute, never left to the program: twins are two lines of the chart.
    pub path: Path,
    /// Threshold, pixels. 0 for triangles, which have none.
    pub threshold_px: f32,
}

/// Every triangle, by the rasterizer: what the others are compared with.
pub const TRIANGLES: Choice = Choice {
    method: Method::Triangles,
    splat: SplatKind::Square,
    path: Path::Raster,
    threshold_px: 0.0,
};

/// The thresholds of a full chart, pixels.
pub const THRESHOLDS: [f32; 11] = [0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0];

/// All kinds of splats, in the order of the legend.
pub const KINDS: [SplatKind; 6] = [
    SplatKind::Square,
    SplatKind::Disc,
    SplatKind::Ellipse,
    SplatKind::Gauss,
    SplatKind::Visibility,
    SplatKind::Filtered,
];

/// The name that a value has in files.
fn word(value: &impl serde::Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(word)) => word,
        _ => String::new(),
    }
}

impl Choice {
    fn new(method: Method, splat: SplatKind, threshold_px: f32) -> Self {
        Self {
            method,
            splat,
            path: Path::Raster,
            threshold_px,
        }
    }

    /// Whether compute shaders can draw it on a device that has what they need.
    fn has_twin(&self) -> bool {
        match (self.method, self.splat) {
            (Method::Pop, SplatKind::Square | SplatKind::Disc) => {
                self.threshold_px <= crate::method::LARGEST_COMPUTE_SQUARE_PX
            }
            (Method::Pop, SplatKind::Ellipse) => {
                self.threshold_px <= crate::method::LARGEST_COMPUTE_ELLIPSE_PX
            }
            (
                Method::Pop | Method::Splats,
                SplatKind::Gauss | SplatKind::Visibility | SplatKind::Filtered,
            ) => self.threshold_px <= crate::method::LARGEST_COMPUTE_BLENDED_PX,
            _ => false,
        }
    }

    /// Everything at the given thresholds that makes sense for a mesh, or for a cloud: triangles, points (up to 3 pixels),
    /// splats and pop with every kind of splat, and compute twins where `has_compute`.
    pub fn all(thresholds: &[f32], is_cloud: bool, has_compute: bool) -> Vec<Self> {
        let mut all = Vec::new();
        if !is_cloud {
            all.push(TRIANGLES);
        }
        for splat in KINDS {
            // A size below a pixel is drawn as one.
            let sizes = thresholds.iter().filter(|t| (1.0..=3.0).contains(*t));
            if splat != SplatKind::Filtered {
                all.extend(sizes.map(|t| Self::new(Method::Points, splat, *t)));
            }
        }
        for method in [Method::Splats, Method::Pop] {
            // Without triangles both draw the same.
            if is_cloud && method == Method::Pop {
                continue;
            }
            for splat in KINDS {
                for &threshold in thresholds {
                    let raster = Self::new(method, splat, threshold);
                    all.push(raster);
                    if has_compute && raster.has_twin() {
                        all.push(Self {
                            path: Path::Compute,
                            ..raster
                        });
                    }
                }
            }
        }
        all
    }

    /// Two dozen of them, for a first look.
    pub fn few(is_cloud: bool, has_compute: bool) -> Vec<Self> {
        use SplatKind::{Disc, Ellipse, Filtered, Gauss, Square, Visibility};
        let method = if is_cloud {
            Method::Splats
        } else {
            Method::Pop
        };
        let mut few = Vec::new();
        if !is_cloud {
            few.push(TRIANGLES);
        }
        few.push(Self::new(Method::Points, Square, 1.0));
        for (splat, thresholds) in [
            (Square, &[0.25, 0.5, 1.0, 2.0, 4.0][..]),
            (Disc, &[2.0]),
            (Ellipse, &[1.0, 2.0]),
            (Gauss, &[2.0]),
            (Visibility, &[2.0]),
            (Filtered, &[0.5, 1.0, 2.0, 4.0]),
        ] {
            for &threshold in thresholds {
                let raster = Self::new(method, splat, threshold);
                let has_twin = has_compute && raster.has_twin();
                // The slowest of all; its twin has the same picture.
                if !(has_twin && threshold < 1.0) {
                    few.push(raster);
                }
                if has_twin {
                    few.push(Self {
                        path: Path::Compute,
                        ..raster
                    });
                }
            }
        }
        few
    }

    /// The settings that draw it; all others are the usual ones.
    pub fn settings(&self) -> Settings {
        Settings {
            method: self.method,
            splat: self.splat,
            path: self.path,
            threshold_px: self.threshold_px,
            ..Settings::default()
        }
    }

    /// Name of the line in the chart: everything but the threshold, such as `pop square, compute`.
    pub fn line(&self) -> String {
        let method = word(&self.method);
        if self.method == Method::Triangles {
            return method;
        }
        let twin = if self.path == Path::Compute {
            ", compute"
        } else {
            ""
        };
        format!("{method} {}{twin}", word(&self.splat))
    }

    /// Name of the point, such as `pop square, compute, 2 px`.
    pub fn name(&self) -> String {
        if self.method == Method::Triangles {
            return self.line();
        }
        format!("{}, {} px", self.line(), self.threshold_px)
    }

    /// Method, splat and path as they stand in files.
    pub fn words(&self) -> [String; 3] {
        [word(&self.method), word(&self.splat), word(&self.path)]
    }

    /// The choice of these words; `None` when one of them is none.
    pub fn of_words(method: &str, splat: &str, path: &str, threshold_px: f32) -> Option<Self> {
        let method = [
            Method::Triangles,
            Method::Points,
            Method::Splats,
            Method::Pop,
        ]
        .into_iter()
        .find(|m| word(m) == method)?;
        let splat = KINDS.into_iter().find(|s| word(s) == splat)?;
        let path = [Path::Raster, Path::Compute]
            .into_iter()
            .find(|p| word(p) == path)?;
        // Written so that NaN is refused.
        (threshold_px >= 0.0).then_some(Self {
            method,
            splat,
            path,
            threshold_px,
        })
    }

    /// Options of `surfel render` that draw it.
    pub fn options(&self) -> String {
        let [method, splat, path] = self.words();
        if self.method == Method::Triangles {
            return format!("--method {method} --path {path}");
        }
        format!(
            "--method {method} --splat {splat} --threshold {} --path {path}",
            self.threshold_px
        )
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_words_lead_back() {
        for choices in [
            Choice::all(&THRESHOLDS, false, true),
            Choice::all(&THRESHOLDS, true, false),
            Choice::few(false, true),
            Choice::few(true, false),
        ] {
            let mut names: Vec<String> = choices.iter().map(Choice::name).collect();
            names.sort();
            names.dedup();
            assert_eq!(names.len(), choices.len());
            for choice in choices {
                let [m, s, p] = choice.words();
                assert_eq!(
                    Choice::of_words(&m, &s, &p, choice.threshold_px).unwrap(),
                    choice
                );
            }
        }
        assert!(Choice::of_words("pop", "square", "auto", 1.0).is_none());
        assert!(Choice::of_words("pop", "square", "raster", f32::NAN).is_none());
    }

    #[test]
    fn clouds_have_no_triangles_and_twins_need_compute() {
        let cloud = Choice::all(&THRESHOLDS, true, false);
        assert!(
            cloud
                .iter()
                .all(|c| matches!(c.method, Method::Points | Method::Splats)
                    && c.path == Path::Raster)
        );
        let twins = |has: bool| {
            Choice::all(&THRESHOLDS, false, has)
                .iter()
                .filter(|c| c.path == Path::Compute)
                .count()
        };
        // Squares and discs up to 6 pixels, ellipses up to 10; Gaussians, visibility and filtered splats of all eleven sizes, in
        // splats and in pop.
        assert_eq!((twins(false), twins(true)), (0, 2 * 8 + 9 + 6 * 11));
        let lines = |is_cloud| {
            let few = Choice::few(is_cloud, true).into_iter();
            let mut lines: Vec<String> = few
                .filter(|c| c.path == Path::Compute)
                .map(|c| c.line())
                .collect();
            lines.dedup();
            lines
        };
        let of_pop = [
            "pop square, compute",
            "pop disc, compute",
            "pop ellipse, compute",
            "pop gauss, compute",
            "pop visibility, compute",
            "pop filtered, compute",
        ];
        assert_eq!(lines(false), of_pop);
        let of_cloud = [
            "splats gauss, compute",
            "splats visibility, compute",
            "splats filtered, compute",
        ];
        assert_eq!(lines(true), of_cloud);
    }
}
