//! What drawing costs on one device, and which path and primitive are therefore the cheaper.
//!
//! All times are nanoseconds. They are measured by [`crate::bench::calibrate`]; nothing here measures, so a decision
//! depends on its arguments alone. All ways draw the same picture: what is decided here changes only its time. What was
//! not measured decides nothing: the renderer falls back to its rules of thumb there.

use crate::math::camera::View;
use crate::render::model_facts::DrawnFacts;
use crate::render::screen_bounds;
use crate::render::{Path, SplatKind};

/// The sizes that splats are measured at on both paths: sides or diameters in pixels, ascending.
pub const SIZES_PX: [f32; 3] = [1.0, 3.0, 6.0];
/// The sizes that points and quads are compared at, pixels, ascending.
pub const PRIMITIVE_SIZES_PX: [f32; 6] = [1.0, 3.0, 8.0, 16.0, 32.0, 64.0];

/// How much of the box around a model in the picture the model covers, at most: a sphere covers 0.79 of it, the scanned
/// models 0.3 to 0.5.
const COVERED_OF_BOX: f64 = 0.6;
/// Splats of a surface overlap: each brings at most this part of its own square of new pixels. A cut at 1 pixel has three
/// splats in a covered pixel, at 3 pixels one for each pixel, which is eight times its square.
const NEW_OF_SQUARE: f64 = 0.25;
/// By how much compute must be cheaper than the rasterizer, and quads than points, to be taken: less is within the error of
/// what was measured, and no choice should hang on it.
const CLEARLY: f64 = 1.1;

/// The part of the picture that a frame works on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PicturePixels {
    /// All of the picture.
    pub picture: u64,
    /// The box around what is drawn.
    pub of_box: u64,
}

/// Pixels of the box around what is drawn in the picture: the part that passes over the picture go over.
pub fn pixels_of(facts: impl Into<DrawnFacts>, view: &View, largest_px: f32) -> PicturePixels {
    let margin_px = largest_px / 2.0 + 3.0;
    PicturePixels {
        picture: u64::from(view.width) * u64::from(view.height),
        of_box: screen_bounds::pixels(screen_bounds::rect_px(&facts.into(), view, margin_px)),
    }
}

/// What the passes of a frame cost before any primitive is in them: beginning, clearing, loading, resolving, normalizing.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassCosts {
    /// A frame, whatever its size, nanoseconds.
    pub frame_ns: f64,
    /// A pixel of the picture on top, whether or not anything is near it, nanoseconds.
    pub picture_ns: f64,
    /// A pixel of the box around what is drawn, on top of both, nanoseconds.
    pub box_ns: f64,
    /// What a covered pixel costs on top of all, nanoseconds.
    pub covered_ns: f64,
}

impl PassCosts {
    /// Nanoseconds of a picture with at most `covered` pixels of the box covered.
    fn of(&self, pixels: PicturePixels, covered: f64) -> f64 {
        self.of_nothing(pixels)
            + self.covered_ns * covered.min(COVERED_OF_BOX * pixels.of_box as f64)
    }

    /// Nanoseconds without those of covered pixels.
    fn of_nothing(&self, pixels: PicturePixels) -> f64 {
        self.frame_ns + self.picture_ns * pixels.picture as f64 + self.box_ns * pixels.of_box as f64
    }
}

/// One path of one kind of splat.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplatCosts {
    /// A splat of each of [`SIZES_PX`] in all passes that draw it, nanoseconds.
    pub splat_ns: [f64; SIZES_PX.len()],
    /// What the passes of this path cost before any splat.
    pub passes: PassCosts,
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

    /// Nanoseconds of `count` splats of `size_px` pixels. How many pixels they cover is not known before they are drawn: a
    /// quarter of their squares together, and at most 0.6 of the box.
    pub fn frame_ns(&self, count: u64, size_px: f32, pixels: PicturePixels) -> f64 {
        if count == 0 {
            return 0.0;
        }
        let count = count as f64;
        let covered = count * (NEW_OF_SQUARE * f64::from(size_px).powi(2)).max(1.0);
        count * self.splat_ns(size_px) + self.passes.of(pixels, covered)
    }
}

/// One path of small triangles.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TriangleCosts {
    /// A triangle of a pixel or two, nanoseconds.
    pub triangle_ns: f64,
    /// What the passes of this path cost before any triangle.
    pub passes: PassCosts,
}

impl TriangleCosts {
    /// Nanoseconds of `count` small triangles; each is taken to cover a pixel.
    pub fn frame_ns(&self, count: u64, pixels: PicturePixels) -> f64 {
        if count == 0 {
            return 0.0;
        }
        count as f64 * self.triangle_ns + self.passes.of(pixels, count as f64)
    }
}

/// By rasterizer and by compute; `None` what the device, or this version of the program, cannot.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PerRasterizer<T> {
    /// By the rasterizer.
    pub raster: Option<T>,
    /// By compute shaders.
    pub compute: Option<T>,
}

impl<T> PerRasterizer<T> {
    /// The cost of each, infinite of what cannot be.
    fn each(&self, of: impl Fn(&T) -> f64) -> [f64; 2] {
        [&self.raster, &self.compute].map(|way| way.as_ref().map_or(f64::INFINITY, &of))
    }
}

/// What it costs on top that compute and rasterizer both draw blended splats of a frame: depth and sums are handed over.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MergeCosts {
    /// A splat that is in the rasterizer's list too, because it might have been large, nanoseconds.
    pub splat_ns: f64,
    /// The passes.
    pub passes: PassCosts,
}

/// A splat as point primitive and as quad, in all passes that draw it.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PrimitiveCosts {
    /// As a point of each of [`PRIMITIVE_SIZES_PX`], nanoseconds; of a size that the device has no points of, as a quad.
    pub point_ns: [f64; PRIMITIVE_SIZES_PX.len()],
    /// As a quad of each, nanoseconds.
    pub quad_ns: [f64; PRIMITIVE_SIZES_PX.len()],
}

impl PrimitiveCosts {
    /// The size above which splats are to be drawn as quads, pixels: 0 where quads are cheaper at every size, infinite where
    /// they are cheaper at none.
    ///
    /// Of all sizes that could part points from quads it is the one with the least product of costs, a quad counting a
    /// tenth more than measured: one size that noise made wrong moves nothing, and what is equal stays a point. Between
    /// the last size of points and the first of quads it is where their costs, linear in the area, are equal.
    pub fn largest_point_px(&self) -> f32 {
        const SIZES: usize = PRIMITIVE_SIZES_PX.len();
        let over: [f64; SIZES] = std::array::from_fn(|i| {
            (self.point_ns[i].max(1e-3) / (CLEARLY * self.quad_ns[i].max(1e-3))).ln()
        });
        // What points up to there cost over quads.
        let mut sum = 0.0;
        let (mut first_quad, mut least) = (0, 0.0);
        for (i, ratio) in over.iter().enumerate() {
            sum += ratio;
            if sum <= least {
                (first_quad, least) = (i + 1, sum);
            }
        }
        if first_quad == 0 {
            return 0.0;
        }
        if first_quad == SIZES {
            return f32::INFINITY;
        }
        let more = |i: usize| self.point_ns[i] - CLEARLY * self.quad_ns[i];
        let (below, above) = (more(first_quad - 1), more(first_quad));
        let area = |i: usize| f64::from(PRIMITIVE_SIZES_PX[i]).powi(2);
        let (a, b) = (area(first_quad - 1), area(first_quad));
        let along = if below <= 0.0 && above > below {
            (-below / (above - below)).clamp(0.0, 1.0)
        } else {
            0.5
        };
        (a + (b - a) * along).sqrt() as f32
    }
}

/// What one device charges. What is `None` was not measured.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DrawCosts {
    /// Opaque squares; discs count as these.
    pub square: Option<PerRasterizer<SplatCosts>>,
    /// Opaque ellipses.
    pub ellipse: Option<PerRasterizer<SplatCosts>>,
    /// Splats that are blended in two passes and normalized.
    pub gauss: Option<PerRasterizer<SplatCosts>>,
    /// Filtered splats.
    pub filtered: Option<PerRasterizer<SplatCosts>>,
    /// Visibility splats, with the reconstruction by a Gaussian, which is the same by both paths.
    pub visibility: Option<PerRasterizer<SplatCosts>>,
    /// What compute costs on top beside the rasterizer: splats that are blended in two passes.
    pub gauss_merge: Option<MergeCosts>,
    /// The same of filtered splats.
    pub filtered_merge: Option<MergeCosts>,
    /// Triangles of a pixel or two.
    pub triangle: Option<PerRasterizer<TriangleCosts>>,
    /// Opaque splats as points and as quads. Those that are blended are taken to behave alike: their shaders are larger, for
    /// vertices (of which a quad has six) as for fragments.
    pub primitives: Option<PrimitiveCosts>,
    /// A node that the cut visits on the processor, all threads together, nanoseconds. Of a small model, whose nodes lie in
    /// the caches: a lower bound.
    pub node_ns: Option<f64>,
    /// A node that a cut visits on the device, nanoseconds, of a small model.
    pub device_node_ns: Option<f64>,
}

impl DrawCosts {
    /// Tells whether a cut takes the device less time than the host, which has to write and move its lists besides.
    pub fn cuts_on_device(&self) -> bool {
        matches!((self.device_node_ns, self.node_ns), (Some(device), Some(host)) if device < host)
    }
}

/// What one frame has to draw.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DrawLoad {
    /// Small triangles: those that both paths can draw.
    pub triangles: u64,
    /// Splats that both paths can draw.
    pub splats: u64,
    /// Side or diameter of the splats, pixels.
    pub size_px: f32,
    /// Pixels of the picture.
    pub pixels: PicturePixels,
}

/// Which path draws which part of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OpaquePaths {
    /// The small triangles.
    pub triangles: Path,
    /// The splats.
    pub splats: Path,
}

/// What was chosen, and what was foreseen of both choices for all that there was to choose, nanoseconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChosenWay<T> {
    /// The choice.
    pub choice: T,
    /// Everything by the rasterizer; infinite where it cannot.
    pub raster_ns: f64,
    /// Splats (and triangles where that is cheaper) by compute; infinite where it cannot.
    pub compute_ns: f64,
}

impl DrawCosts {
    /// The costs of a kind of splat.
    pub fn of(&self, kind: SplatKind) -> Option<&PerRasterizer<SplatCosts>> {
        match kind {
            SplatKind::Square | SplatKind::Disc => self.square.as_ref(),
            SplatKind::Ellipse => self.ellipse.as_ref(),
            SplatKind::Gauss => self.gauss.as_ref(),
            SplatKind::Visibility => self.visibility.as_ref(),
            SplatKind::Filtered => self.filtered.as_ref(),
        }
    }

    /// The cheapest paths for a frame of opaque splats of a kind and triangles; `None` where one of them was not measured.
    ///
    /// Where triangles go by compute the splats do, too: what is left in a pixel by both is shaded by one pass over the
    /// picture. Passes that both need count once. The rasterizer, unless compute is cheaper by a tenth.
    pub fn opaque_paths(&self, kind: SplatKind, load: &DrawLoad) -> Option<ChosenWay<OpaquePaths>> {
        let DrawLoad {
            triangles,
            splats,
            size_px,
            pixels,
        } = *load;
        let (own, small) = (self.of(kind)?, self.triangle.as_ref()?);
        let splat_ns = own.each(|c| c.frame_ns(splats, size_px, pixels));
        let triangle_ns = small.each(|c| c.frame_ns(triangles, pixels));
        // What goes over the same pixels for both is done once: clearing, resolving.
        let nothing = |of_splats: &Option<SplatCosts>, of_triangles: &Option<TriangleCosts>| match (
            of_splats,
            of_triangles,
        ) {
            (Some(a), Some(b)) if splats > 0 && triangles > 0 => {
                a.passes.of_nothing(pixels).min(b.passes.of_nothing(pixels))
            }
            _ => 0.0,
        };
        use Path::{Compute, Raster};
        let offer = |by: [usize; 2]| {
            let ways = (
                [&own.raster, &own.compute][by[1]],
                [&small.raster, &small.compute][by[0]],
            );
            triangle_ns[by[0]] + splat_ns[by[1]] - nothing(ways.0, ways.1)
        };
        let offers = [
            (offer([0, 0]), Raster, Raster),
            (offer([0, 1]), Raster, Compute),
            (offer([1, 1]), Compute, Compute),
        ];
        let mut best = offers[0];
        best.0 /= CLEARLY;
        // Of equal ones the first.
        for offer in offers {
            if offer.0 < best.0 {
                best = offer;
            }
        }
        Some(ChosenWay {
            choice: OpaquePaths {
                triangles: best.1,
                splats: best.2,
            },
            raster_ns: offers[0].0,
            compute_ns: offers[1].0.min(offers[2].0),
        })
    }

    /// The cheaper path for the blended splats (or visibility splats) of a frame, [`Path::Raster`] or [`Path::Compute`]: the rasterizer, unless
    /// compute is cheaper by a tenth. `is_beside`: triangles or splats are rasterized in the same frame whatever is chosen; `has_large`: some
    /// of the splats themselves may be. `None` where the kind was not measured.
    pub fn blended_path(
        &self,
        kind: SplatKind,
        load: &DrawLoad,
        (is_beside, has_large): (bool, bool),
    ) -> Option<ChosenWay<Path>> {
        let merge = match kind {
            SplatKind::Filtered => self.filtered_merge.as_ref(),
            _ => self.gauss_merge.as_ref(),
        };
        let ways = self.of(kind)?;
        let [raster_ns, mut compute_ns] =
            ways.each(|c| c.frame_ns(load.splats, load.size_px, load.pixels));
        if is_beside || has_large {
            let merge = merge?;
            compute_ns += merge.passes.of_nothing(load.pixels);
            if has_large {
                compute_ns += merge.splat_ns * load.splats as f64;
            }
        }
        Some(ChosenWay {
            choice: if compute_ns < raster_ns / CLEARLY {
                Path::Compute
            } else {
                Path::Raster
            },
            raster_ns,
            compute_ns,
        })
    }

    /// The size above which splats are to be drawn as quads; `None` where that was not measured.
    pub fn largest_point_px(&self) -> Option<f32> {
        self.primitives
            .as_ref()
            .map(PrimitiveCosts::largest_point_px)
    }

    /// Joins these costs and those of `other` that are not among them.
    pub fn or(self, other: Self) -> Self {
        Self {
            square: self.square.or(other.square),
            ellipse: self.ellipse.or(other.ellipse),
            gauss: self.gauss.or(other.gauss),
            filtered: self.filtered.or(other.filtered),
            visibility: self.visibility.or(other.visibility),
            gauss_merge: self.gauss_merge.or(other.gauss_merge),
            filtered_merge: self.filtered_merge.or(other.filtered_merge),
            triangle: self.triangle.or(other.triangle),
            primitives: self.primitives.or(other.primitives),
            node_ns: self.node_ns.or(other.node_ns),
            device_node_ns: self.device_node_ns.or(other.device_node_ns),
        }
    }

    /// Tells whether every figure is a time that can be: finite and not negative.
    pub fn is_whole(&self) -> bool {
        let is_time = |ns: &f64| ns.is_finite() && *ns >= 0.0;
        let is_pass = |p: &PassCosts| {
            [p.frame_ns, p.picture_ns, p.box_ns, p.covered_ns]
                .iter()
                .all(is_time)
        };
        let is_splat = |c: &SplatCosts| c.splat_ns.iter().all(is_time) && is_pass(&c.passes);
        let is_triangle = |c: &TriangleCosts| is_time(&c.triangle_ns) && is_pass(&c.passes);
        let is_merge = |c: &MergeCosts| is_time(&c.splat_ns) && is_pass(&c.passes);
        let splats = [
            &self.square,
            &self.ellipse,
            &self.gauss,
            &self.filtered,
            &self.visibility,
        ];
        let triangles = self.triangle.iter();
        splats
            .into_iter()
            .flatten()
            .all(|w| w.raster.iter().chain(&w.compute).all(is_splat))
            && triangles
                .flat_map(|w| w.raster.iter().chain(&w.compute))
                .all(is_triangle)
            && self
                .gauss_merge
                .iter()
                .chain(&self.filtered_merge)
                .all(is_merge)
            && self
                .primitives
                .iter()
                .all(|p| p.point_ns.iter().chain(&p.quad_ns).all(is_time))
            && self.node_ns.iter().all(is_time)
            && self.device_node_ns.iter().all(is_time)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failing test panics")]
mod tests;
