//! What drawing costs on one device, and which path is therefore the cheaper.
//!
//! All times are nanoseconds. They are measured by [`crate::bench::calibrate`]; nothing here measures, so a decision
//! depends on its arguments alone. Both paths draw the same picture: what is decided here changes only its time.

use super::{Path, SplatKind};

/// The sizes that splats are measured at: sides or diameters in pixels, ascending.
pub const SIZES_PX: [f32; 3] = [1.0, 3.0, 6.0];

/// What a pass that goes over the whole picture costs: clearing, resolving, normalizing.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PixelCosts {
    /// A pixel of the picture, whether or not anything is in it, nanoseconds.
    pub any_ns: f64,
    /// What a covered pixel costs on top of that, nanoseconds.
    pub covered_ns: f64,
}

impl PixelCosts {
    /// Nanoseconds of a picture of `pixels`, at most `covered` of them with something in them.
    fn of(&self, pixels: f64, covered: f64) -> f64 {
        self.any_ns * pixels + self.covered_ns * covered.min(pixels)
    }
}

/// One path of one kind of splat.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplatCosts {
    /// A splat of each of [`SIZES_PX`] in all passes that draw it, nanoseconds.
    pub splat_ns: [f64; SIZES_PX.len()],
    /// The passes over the picture that this path needs on top.
    pub pixels: PixelCosts,
}

impl SplatCosts {
    /// A splat of `size_px` pixels, nanoseconds. Between two sizes linear in the area, beyond the largest on the same
    /// line (never below the largest), below the smallest as the smallest. A size that is NaN counts as the smallest.
    pub fn splat_ns(&self, size_px: f32) -> f64 {
        let area = f64::from(size_px.max(SIZES_PX[0])).powi(2);
        let areas = SIZES_PX.map(|s| f64::from(s).powi(2));
        let above = (1..SIZES_PX.len() - 1)
            .find(|i| area <= areas[*i])
            .unwrap_or(SIZES_PX.len() - 1);
        let (a, b) = (self.splat_ns[above - 1], self.splat_ns[above]);
        let along = (area - areas[above - 1]) / (areas[above] - areas[above - 1]);
        let ns = a + (b - a) * along;
        if along > 1.0 { ns.max(b) } else { ns.max(0.0) }
    }

    /// Nanoseconds of `count` splats of `size_px` pixels in a picture of `pixels`. They are taken to cover as many pixels
    /// as they have together, which is too many where they overlap: it errs to the path that needs no pass over the
    /// picture.
    pub fn frame_ns(&self, count: u64, size_px: f32, pixels: u64) -> f64 {
        if count == 0 {
            return 0.0;
        }
        let count = count as f64;
        let covered = count * f64::from(size_px.max(1.0)).powi(2);
        count * self.splat_ns(size_px) + self.pixels.of(pixels as f64, covered)
    }
}

/// One path of small triangles.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TriangleCosts {
    /// A triangle of a pixel or two, nanoseconds.
    pub triangle_ns: f64,
    /// The passes over the picture that this path needs on top.
    pub pixels: PixelCosts,
}

impl TriangleCosts {
    /// Nanoseconds of `count` small triangles in a picture of `pixels`; each is taken to cover a pixel.
    pub fn frame_ns(&self, count: u64, pixels: u64) -> f64 {
        if count == 0 {
            return 0.0;
        }
        count as f64 * self.triangle_ns + self.pixels.of(pixels as f64, count as f64)
    }
}

/// By rasterizer and by compute; `None` what the device, or this version of the program, cannot.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ways<T> {
    /// By the rasterizer.
    pub raster: Option<T>,
    /// By compute shaders.
    pub compute: Option<T>,
}

impl<T> Ways<T> {
    /// The cost of each, infinite of what cannot be.
    fn each(&self, of: impl Fn(&T) -> f64) -> [f64; 2] {
        [&self.raster, &self.compute].map(|way| way.as_ref().map_or(f64::INFINITY, &of))
    }
}

/// What one device charges.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Costs {
    /// Opaque squares; discs and ellipses count as these.
    pub square: Ways<SplatCosts>,
    /// Splats that are blended in two passes and normalized.
    pub gauss: Ways<SplatCosts>,
    /// Filtered splats.
    pub filtered: Ways<SplatCosts>,
    /// Triangles of a pixel or two.
    pub triangle: Ways<TriangleCosts>,
    /// A node that the cut visits on the processor, all threads together, nanoseconds. Of a small model, whose nodes lie in
    /// the caches: a lower bound.
    pub node_ns: f64,
}

/// What one frame has to draw.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Load {
    /// Small triangles: those that both paths can draw.
    pub triangles: u64,
    /// Splats that both paths can draw.
    pub splats: u64,
    /// Their side or diameter, pixels.
    pub size_px: f32,
    /// Pixels of the picture.
    pub pixels: u64,
}

/// Which path draws which part of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Paths {
    /// The small triangles.
    pub triangles: Path,
    /// The splats.
    pub splats: Path,
}

impl Costs {
    /// The costs of a kind of splat. Visibility splats have no twin and count as blended ones.
    pub fn of(&self, kind: SplatKind) -> &Ways<SplatCosts> {
        match kind {
            SplatKind::Square | SplatKind::Disc | SplatKind::Ellipse => &self.square,
            SplatKind::Gauss | SplatKind::Visibility => &self.gauss,
            SplatKind::Filtered => &self.filtered,
        }
    }

    /// The cheaper path for `count` splats of `size_px` pixels in a picture of `pixels`: [`Path::Raster`] or
    /// [`Path::Compute`]. Of equal costs the rasterizer.
    pub fn path_of_splats(&self, kind: SplatKind, count: u64, size_px: f32, pixels: u64) -> Path {
        let [raster, compute] = self.of(kind).each(|c| c.frame_ns(count, size_px, pixels));
        if compute < raster {
            Path::Compute
        } else {
            Path::Raster
        }
    }

    /// The cheapest paths for a frame with triangles and splats of one kind. Where triangles go by compute the splats do,
    /// too: what is left in a pixel by both is shaded by one pass over the picture, whose time counts once.
    pub fn paths(&self, kind: SplatKind, load: &Load) -> Paths {
        let Load {
            triangles,
            splats,
            size_px,
            pixels,
        } = *load;
        let ways = self.of(kind);
        let splat_ns = ways.each(|c| c.frame_ns(splats, size_px, pixels));
        let triangle_ns = self.triangle.each(|c| c.frame_ns(triangles, pixels));
        // Both passes over the picture go over the same pixels.
        let shared = match (&ways.compute, &self.triangle.compute) {
            (Some(a), Some(b)) if splats > 0 && triangles > 0 => {
                a.pixels.any_ns.min(b.pixels.any_ns) * pixels as f64
            }
            _ => 0.0,
        };
        use Path::{Compute, Raster};
        let offers = [
            (triangle_ns[0] + splat_ns[0], Raster, Raster),
            (triangle_ns[0] + splat_ns[1], Raster, Compute),
            (triangle_ns[1] + splat_ns[1] - shared, Compute, Compute),
        ];
        // Of equal ones the first.
        let mut best = offers[0];
        for offer in offers {
            if offer.0 < best.0 {
                best = offer;
            }
        }
        Paths {
            triangles: best.1,
            splats: best.2,
        }
    }

    /// Whether every figure is a time that can be: finite and not negative.
    pub fn is_whole(&self) -> bool {
        let is_time = |ns: &f64| ns.is_finite() && *ns >= 0.0;
        let is_pixels = |p: &PixelCosts| is_time(&p.any_ns) && is_time(&p.covered_ns);
        let is_splat = |c: &SplatCosts| c.splat_ns.iter().all(is_time) && is_pixels(&c.pixels);
        let is_triangle = |c: &TriangleCosts| is_time(&c.triangle_ns) && is_pixels(&c.pixels);
        [&self.square, &self.gauss, &self.filtered]
            .iter()
            .all(|w| w.raster.iter().chain(&w.compute).all(is_splat))
            && [&self.triangle.raster, &self.triangle.compute]
                .iter()
                .all(|c| c.iter().all(is_triangle))
            && is_time(&self.node_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NO_PIXELS: PixelCosts = PixelCosts {
        any_ns: 0.0,
        covered_ns: 0.0,
    };

    fn splat(splat_ns: [f64; 3], any_ns: f64, covered_ns: f64) -> SplatCosts {
        SplatCosts {
            splat_ns,
            pixels: PixelCosts { any_ns, covered_ns },
        }
    }

    /// A device on which a raster splat takes 100 ns whatever its size, one by compute 10 ns and 10 more for each pixel
    /// above the first; shading a pixel takes 2 ns, a covered one 20 more.
    fn costs() -> Costs {
        let square = Ways {
            raster: Some(splat([100.0; 3], 0.0, 0.0)),
            compute: Some(splat([10.0, 90.0, 360.0], 2.0, 20.0)),
        };
        Costs {
            square,
            gauss: Ways {
                raster: Some(splat([400.0; 3], 5.0, 0.0)),
                compute: None,
            },
            filtered: square,
            triangle: Ways {
                raster: Some(TriangleCosts {
                    triangle_ns: 70.0,
                    pixels: NO_PIXELS,
                }),
                compute: Some(TriangleCosts {
                    triangle_ns: 20.0,
                    pixels: PixelCosts {
                        any_ns: 2.0,
                        covered_ns: 100.0,
                    },
                }),
            },
            node_ns: 4.0,
        }
    }

    #[test]
    fn sizes_between_and_beyond_are_linear_in_area() {
        let c = splat([10.0, 90.0, 360.0], 0.0, 0.0);
        assert_eq!(SIZES_PX.map(|s| c.splat_ns(s)), [10.0, 90.0, 360.0]);
        // Side 2 has 4 pixels: 3 of the 8 between 1 and 9.
        assert_eq!(c.splat_ns(2.0), 40.0);
        // Side 12 has 144: 135 beyond 9, at 270 for 27.
        assert_eq!(c.splat_ns(12.0), 1440.0);
        assert_eq!((c.splat_ns(0.2), c.splat_ns(f32::NAN)), (10.0, 10.0));
        // A measurement that fell with the size is not carried on below its end.
        assert_eq!(splat([10.0, 90.0, 80.0], 0.0, 0.0).splat_ns(60.0), 80.0);
    }

    #[test]
    fn many_small_splats_go_by_compute_and_few_or_large_ones_do_not() {
        let c = costs();
        let path = |count, size_px| c.path_of_splats(SplatKind::Square, count, size_px, 250_000);
        // Side 1: 90 ns saved a splat, less 20 for its pixel; the picture's 500,000 ns are paid by 7143 of them.
        assert_eq!(path(7_100, 1.0), Path::Raster);
        assert_eq!(path(7_200, 1.0), Path::Compute);
        // Side 3: 10 ns saved a splat, 180 for its pixels, until all pixels are covered: 250,000 (20 + 2) / 10.
        assert_eq!(path(500_000, 3.0), Path::Raster);
        assert_eq!(path(560_000, 3.0), Path::Compute);
        // Side 2: 60 ns saved a splat, 80 for its four pixels, until all are covered: 5,500,000 / 60.
        assert_eq!(path(50_000, 2.0), Path::Raster);
        assert_eq!(path(91_000, 2.0), Path::Raster);
        assert_eq!(path(92_000, 2.0), Path::Compute);
        assert_eq!(path(u64::MAX, 6.0), Path::Raster);
        assert_eq!(path(0, 1.0), Path::Raster);
        // What the rasterizer cannot goes by compute however few there are.
        let mut c = costs();
        c.filtered.raster = None;
        let path = c.path_of_splats(SplatKind::Filtered, 1, 1.0, 250_000);
        assert_eq!(path, Path::Compute);
        // Without a twin.
        assert_eq!(
            c.path_of_splats(SplatKind::Gauss, 1_000_000, 1.0, 250_000),
            Path::Raster
        );
    }

    #[test]
    fn splats_follow_triangles_and_their_pixels_count_once() {
        let c = costs();
        let load = |triangles, splats| Load {
            triangles,
            splats,
            size_px: 1.0,
            pixels: 250_000,
        };
        let paths = |t, s| {
            let p = c.paths(SplatKind::Square, &load(t, s));
            (p.triangles, p.splats)
        };
        use Path::{Compute, Raster};
        assert_eq!(paths(0, 0), (Raster, Raster));
        assert_eq!(paths(1_000, 1_000), (Raster, Raster));
        assert_eq!(paths(1_000, 100_000), (Raster, Compute));
        // 50 ns saved a triangle; 250,000 pixels of 102 ns: 510,000 triangles, or 500,000 beside splats.
        assert_eq!(paths(509_000, 0), (Raster, Raster));
        assert_eq!(paths(511_000, 0), (Compute, Compute));
        assert_eq!(paths(503_000, 100_000), (Compute, Compute));
        assert_eq!(paths(498_000, 100_000), (Raster, Compute));
        let mut without = c;
        without.square.compute = None;
        let p = without.paths(SplatKind::Square, &load(1_000_000, 1_000_000));
        assert_eq!((p.triangles, p.splats), (Raster, Raster));
    }

    #[test]
    fn times_that_cannot_be_are_seen() {
        assert!(costs().is_whole());
        let mut c = costs();
        c.node_ns = f64::NAN;
        assert!(!c.is_whole());
        let mut c = costs();
        c.square.raster = Some(splat([1.0, 1.0, -1.0], 0.0, 0.0));
        assert!(!c.is_whole());
        let mut c = costs();
        c.gauss.compute = Some(splat([1.0, f64::INFINITY, 1.0], 0.0, 0.0));
        assert!(!c.is_whole());
    }
}
