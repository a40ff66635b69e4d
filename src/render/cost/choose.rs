//! Which of a frame's primitives compute draws, and which of its splats are points: by what they cost on the device where
//! that was measured ([`DrawCosts`]), else by rules of thumb of a software device.

use crate::cut::{Cut, StripRun};
use crate::math::camera::View;
use crate::pack::Footprint;
use crate::pack::splats::pixels_of_unit;
use crate::render::cost::model::{ChosenWay, DrawCosts, DrawLoad, OpaquePaths, PicturePixels};
use crate::render::cut_key::LARGEST_HIDDEN_PX;
use crate::render::screen_bounds;
use crate::render::technique::Technique;
use crate::render::{Occlusion, Path, Settings, SplatKind};
use crate::tree::Model;

/// What compute draws of a list of splats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ComputeShare {
    /// Nothing: the rasterizer draws all.
    Nothing,
    /// What is small; there may be larger ones.
    Small,
    /// Everything: all are small.
    All,
}

impl ComputeShare {
    /// Of a list of `splats` beside `others` that are rastered, in a frame that may be drawn by compute.
    ///
    /// Where the rasterizer draws as well, its depth and its sums are merged with those of compute, which costs a software
    /// device some 20 ns a pixel; a small splat saves it 100 to 150.
    pub(crate) fn of(
        settings: &Settings,
        (splats, others): (usize, usize),
        has_large: bool,
        rect_px: [u32; 4],
    ) -> Self {
        let is_alone = others == 0 && !has_large;
        let is_many = 8 * splats as u64 >= screen_bounds::pixels(rect_px);
        if settings.path != Path::Compute && !is_alone && !is_many {
            Self::Nothing
        } else {
            Self::of_all(has_large)
        }
    }

    /// All that compute can draw of a list; whether there are larger splats in it.
    pub(crate) fn of_all(has_large: bool) -> Self {
        if has_large { Self::Small } else { Self::All }
    }
}

/// Tells whether `count` primitives are enough to pay for the pass that shades the picture, by a rule of thumb for devices
/// whose costs are not known: `least` of them for each pixel of the rectangle that the model may be in. Shading a pixel
/// afterwards costs a software device 40 ns (splats) to 400 ns (triangles), drawing a primitive by compute instead of the
/// rasterizer saves it about 60 to 80.
pub(crate) fn pays(count: usize, least: f64, rect_px: [u32; 4], settings: &Settings) -> bool {
    settings.path == Path::Compute || count as f64 >= least * screen_bounds::pixels(rect_px) as f64
}

/// How much a frame draws, as far as it is known once its cut is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FrameWorkload<'a> {
    pub(crate) settings: &'a Settings,
    /// What the device charges.
    pub(crate) costs: Option<DrawCosts>,
    /// Splats of the cut, hidden ones with them: the picture, to the last bit, must not depend on whether those are left
    /// out.
    pub(crate) splats: usize,
    /// See [`size_px`].
    pub(crate) size_px: f32,
    /// Triangles of the cut.
    pub(crate) triangles: usize,
    /// The part of the picture that something may be drawn in.
    pub(crate) rect_px: [u32; 4],
    /// Width and height of the picture.
    pub(crate) size: (u32, u32),
}

/// Leaves that are looked at for the size of all.
const SAMPLE: usize = 256;

/// What size the splats of the cuts of models count as, pixels: the threshold, but for opaque ellipses of a cloud, whose points have sizes of
/// their own. Of these it is the side of their mean square, of a sample; none counts as larger than
/// compute draws.
pub(crate) fn size_px<'a>(
    settings: &Settings,
    view: &View,
    parts: impl Iterator<Item = (&'a Model, &'a Cut)>,
) -> f32 {
    let usual = settings.threshold_px.max(1.0);
    let most = crate::render::compute_limits::largest_point_px(settings);
    let may_have_own =
        Technique::of(settings) == Technique::Opaque && settings.footprint() == Footprint::Oriented;
    // Sums over all splats: of squares of sides, and of splats.
    let (mut squares, mut all) = (0.0, 0.0);
    for (model, cut) in parts.filter(|_| may_have_own) {
        let splats = cut.nodes.len() + cut.leaves.len() + StripRun::splats_of(&cut.strips);
        let step = cut.leaves.len().div_ceil(SAMPLE);
        let (mut sum, mut count) = (0.0, 0.0);
        if step > 0 && !model.kind().is_surface() {
            for &leaf in cut.leaves.iter().step_by(step) {
                let sphere = &model.tree.leaves[leaf as usize];
                let side = 2.0 * sphere.radius * pixels_of_unit(view, sphere.center);
                // A radius of 0 asks for the usual size.
                let side = if side > 0.0 { side } else { usual };
                sum += side.clamp(1.0, most).powi(2);
                count += 1.0;
            }
        }
        let with_own = if count > 0.0 {
            cut.leaves.len() as f32
        } else {
            0.0
        };
        let of_own = with_own * sum / f32::max(count, 1.0);
        squares += of_own + (splats as f32 - with_own) * usual.powi(2);
        all += splats as f32;
    }
    match all > 0.0 {
        true => (squares / all).sqrt(),
        false => usual,
    }
}

impl FrameWorkload<'_> {
    /// The costs where they may decide: nobody insists on a path.
    fn deciding(&self) -> Option<&DrawCosts> {
        self.costs
            .as_ref()
            .filter(|_| self.settings.path == Path::Auto)
    }

    fn pixels(&self) -> PicturePixels {
        PicturePixels {
            picture: u64::from(self.size.0) * u64::from(self.size.1),
            of_box: screen_bounds::pixels(self.rect_px),
        }
    }

    fn load(&self, splats: u64) -> DrawLoad {
        DrawLoad {
            triangles: self.triangles as u64,
            splats,
            size_px: self.size_px,
            pixels: self.pixels(),
        }
    }

    /// The paths of opaque splats and small triangles, in a frame that may be drawn by compute.
    pub(crate) fn opaque(&self) -> OpaquePaths {
        let settings = self.settings;
        // Where hidden squares are left out by themselves, about one for each pixel of the box is left, at larger sizes fewer.
        let pixels = screen_bounds::pixels(self.rect_px) as f64;
        let left = pixels / f64::from(settings.threshold_px.max(1.0));
        // What an ellipse hides is not looked for.
        let are_ellipses = settings.footprint() == Footprint::Oriented;
        let are_left_out = settings.occlusion != Occlusion::Off
            && !are_ellipses
            && settings.threshold_px <= LARGEST_HIDDEN_PX[0];
        let splats = match are_left_out {
            true => (self.splats as u64).min(left as u64),
            false => self.splats as u64,
        };
        match self
            .deciding()
            .and_then(|c| c.opaque_paths(settings.splat, &self.load(splats)))
        {
            Some(chosen) => {
                log("opaque splats and small triangles", &chosen);
                chosen.choice
            }
            None => {
                let path = |count, least| match pays(count, least, self.rect_px, settings) {
                    true => Path::Compute,
                    false => Path::Raster,
                };
                // Each ellipse saves a software device 130 ns and more, a square 60 to 80.
                let least = if are_ellipses { 0.0625 } else { 0.125 };
                let paths = OpaquePaths {
                    triangles: path(self.triangles, 1.0),
                    splats: path(self.splats, least),
                };
                self.log_guess("opaque splats and small triangles", &paths);
                paths
            }
        }
    }

    /// The path of visibility splats, in a frame that may be drawn by compute.
    pub(crate) fn visible(&self) -> Path {
        let load = self.load(self.splats as u64);
        // What the rasterizer draws beside them it draws either way.
        let chosen = (self.deciding())
            .and_then(|costs| costs.blended_path(SplatKind::Visibility, &load, (false, false)));
        match chosen {
            Some(chosen) => {
                log("visibility splats", &chosen);
                chosen.choice
            }
            None => {
                // Each splat saves a software device 250 ns and more, a pixel of the box costs it some 20.
                let path = match pays(self.splats, 0.0625, self.rect_px, self.settings) {
                    true => Path::Compute,
                    false => Path::Raster,
                };
                self.log_guess("visibility splats", &path);
                path
            }
        }
    }

    /// What compute draws of blended splats beside `others` that are rasterized; `has_large`: splats may be too large.
    pub(crate) fn blended(&self, others: usize, has_large: bool) -> ComputeShare {
        let kind = match Technique::of(self.settings) {
            Technique::Filtered => SplatKind::Filtered,
            _ => SplatKind::Gauss,
        };
        let chosen = self.deciding().and_then(|costs| {
            costs.blended_path(
                kind,
                &self.load(self.splats as u64),
                (others > 0, has_large),
            )
        });
        match chosen {
            Some(chosen) => {
                log("blended splats", &chosen);
                match (chosen.choice, has_large) {
                    (Path::Compute, true) => ComputeShare::Small,
                    (Path::Compute, false) => ComputeShare::All,
                    _ => ComputeShare::Nothing,
                }
            }
            None => {
                let counts = (self.splats, others);
                let share = ComputeShare::of(self.settings, counts, has_large, self.rect_px);
                self.log_guess("blended splats by compute", &share);
                share
            }
        }
    }

    /// The same where compute draws the small triangles too, so that little is left to the rasterizer. They are not priced:
    /// by compute they cost a third of what they cost otherwise, wherever that pays for splats.
    pub(crate) fn all_blended(&self, has_large: bool) -> ComputeShare {
        if self.deciding().is_some() {
            return self.blended(0, has_large);
        }
        // The passes over the picture are there for splats and triangles alike.
        let all = self.splats + self.triangles;
        match pays(all, 0.125, self.rect_px, self.settings) {
            true => ComputeShare::of_all(has_large),
            false => ComputeShare::Nothing,
        }
    }

    fn log_guess(&self, what: &str, choice: &impl std::fmt::Debug) {
        if self.settings.path == Path::Auto {
            tracing::debug!("{what}: {choice:?}, by rule of thumb: not measured on this device");
        }
    }
}

fn log<T: std::fmt::Debug>(what: &str, chosen: &ChosenWay<T>) {
    let ChosenWay {
        choice,
        raster_ns,
        compute_ns,
    } = chosen;
    tracing::debug!(
        "{what}: {choice:?}, as measured on this device: {:.2} ms by the rasterizer, {:.2} ms by compute",
        raster_ns / 1e6,
        compute_ns / 1e6
    );
}

/// Tells whether compute draws what the device chose, where nobody insists: of a splat and a triangle for each pixel, since how
/// many there are is not known before. Where that was not measured it does: a graphics card takes 2 to 7 ns to set a primitive
/// up, and by compute a hundredth (docs/experiments/graphics-card.md).
pub(crate) fn draws_chosen(
    costs: Option<&DrawCosts>,
    settings: &Settings,
    (rect_px, size): ([u32; 4], (u32, u32)),
) -> bool {
    let of_box = screen_bounds::pixels(rect_px);
    let load = DrawLoad {
        triangles: of_box,
        splats: of_box,
        size_px: settings.threshold_px.max(1.0),
        pixels: PicturePixels {
            picture: u64::from(size.0) * u64::from(size.1),
            of_box,
        },
    };
    let chosen = costs.and_then(|costs| costs.opaque_paths(settings.splat, &load));
    chosen.is_none_or(|chosen| chosen.choice.triangles == Path::Compute)
}

/// The largest splat that the rasterizer draws as a point, pixels: what the device allows (`device_px`), or less where quads
/// are cheaper below that.
pub(crate) fn largest_point_px(costs: &DrawCosts, settings: &Settings, device_px: f32) -> f32 {
    match Technique::of(settings) {
        Technique::Opaque | Technique::Fuzzy => {}
        // Filtered splats have no quads. Behind quads of visibility splats all of the picture is reconstructed.
        Technique::Filtered | Technique::Visibility | Technique::Polygons | Technique::Nothing => {
            return device_px;
        }
    }
    match costs.largest_point_px() {
        Some(px) if px < device_px => {
            tracing::debug!("splats above {px:.1} px are quads, as measured on this device");
            px
        }
        _ => device_px,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failing test panics")]

    use super::*;
    use crate::generate::{self, GeneratedShape, ShapeSpec};
    use crate::render::cost::model::{PassCosts, PerRasterizer, SplatCosts, TriangleCosts};

    /// A million splats in 100,000 pixels: at 10 ns more for each by the rasterizer and 5 ms more for the frame by compute.
    #[test]
    fn all_ellipses_count_and_of_squares_those_that_are_seen() {
        let passes = PassCosts {
            frame_ns: 5e6,
            ..PassCosts::default()
        };
        let splats = |ns, passes| SplatCosts {
            splat_ns: [ns; 3],
            passes,
        };
        let kind = Some(PerRasterizer {
            raster: Some(splats(11.0, PassCosts::default())),
            compute: Some(splats(1.0, passes)),
        });
        let triangles = TriangleCosts {
            triangle_ns: 1.0,
            passes: PassCosts::default(),
        };
        let costs = DrawCosts {
            square: kind,
            ellipse: kind,
            triangle: Some(PerRasterizer {
                raster: Some(triangles),
                compute: None,
            }),
            ..DrawCosts::default()
        };
        let path = |splat, costs| {
            let settings = Settings {
                splat,
                path: Path::Auto,
                threshold_px: 1.0,
                ..Settings::default()
            };
            let workload = FrameWorkload {
                settings: &settings,
                costs: Some(costs),
                splats: 1_000_000,
                size_px: 1.0,
                triangles: 0,
                rect_px: [0, 0, 500, 200],
                size: (500, 500),
            };
            workload.opaque().splats
        };
        assert_eq!(path(SplatKind::Ellipse, costs), Path::Compute);
        assert_eq!(path(SplatKind::Square, costs), Path::Raster);
        assert_eq!(path(SplatKind::Disc, costs), Path::Raster);
        // Each kind by its own costs.
        let mut cheap = costs;
        cheap.ellipse = cheap.ellipse.map(|ways| PerRasterizer {
            raster: Some(splats(1.0, PassCosts::default())),
            ..ways
        });
        assert_eq!(path(SplatKind::Ellipse, cheap), Path::Raster);
    }

    /// A triangle that takes the rasterizer 3 ns, and compute 1 beside `picture_ns` a pixel.
    #[test]
    fn what_the_device_chose_is_drawn_by_what_is_cheaper() {
        let costs = |picture_ns| {
            let passes = PassCosts {
                picture_ns,
                ..PassCosts::default()
            };
            let triangle = |triangle_ns, passes| TriangleCosts {
                triangle_ns,
                passes,
            };
            let splats = |ns, passes| SplatCosts {
                splat_ns: [ns; 3],
                passes,
            };
            DrawCosts {
                square: Some(PerRasterizer {
                    raster: Some(splats(3.0, PassCosts::default())),
                    compute: Some(splats(1.0, passes)),
                }),
                triangle: Some(PerRasterizer {
                    raster: Some(triangle(3.0, PassCosts::default())),
                    compute: Some(triangle(1.0, passes)),
                }),
                ..DrawCosts::default()
            }
        };
        let picture = ([0, 0, 500, 500], (500, 500));
        let draws =
            |costs: Option<DrawCosts>| draws_chosen(costs.as_ref(), &Settings::default(), picture);
        assert!(draws(None) && draws(Some(DrawCosts::default())));
        assert!(draws(Some(costs(0.5))));
        assert!(!draws(Some(costs(20.0))));
    }

    #[test]
    fn ellipses_of_a_cloud_count_as_large_as_they_are() {
        let points = (0..1600).map(|i| (i % 40, i / 40));
        let spec = ShapeSpec::with_triangles(GeneratedShape::Square, 2_000).unwrap();
        let mut mesh = generate::mesh(&spec);
        mesh.triangles.clear();
        mesh.normals.clear();
        mesh.colors.clear();
        mesh.positions = points
            .map(|(x, y)| glam::Vec3::new(x as f32, y as f32, 0.0))
            .collect();
        let options = crate::tree::BuildOptions::default();
        let model = crate::tree::build(mesh, &options, &crate::progress::SilentProgress).unwrap();
        let at = model.origin + glam::DVec3::new(0.0, 0.0, 1000.0);
        let camera = crate::math::camera::Camera::look_at(
            (500, 500),
            at,
            model.origin,
            glam::DVec3::Y,
            2.0 * 0.05f64.atan(),
            [1.0, 2000.0],
        );
        let view = camera.view(model.origin).unwrap();
        let size = |splat, threshold_px, cut: &Cut| {
            let settings = Settings {
                splat,
                threshold_px,
                ..Settings::default()
            };
            size_px(&settings, &view, [(&model, cut)].into_iter())
        };
        let mut cut = Cut {
            leaves: (0..1600).collect(),
            ..Cut::default()
        };
        // 5 pixels of a unit: 100 units are 500.
        let squares = model.tree.leaves.iter().map(|l| (10.0 * l.radius).powi(2));
        let wanted = (squares.sum::<f32>() / 1600.0).sqrt();
        let found = size(SplatKind::Ellipse, 2.0, &cut);
        assert!(wanted > 4.0, "{wanted}");
        assert!((found - wanted).abs() < 0.05 * wanted, "{found}, {wanted}");
        assert_eq!(size(SplatKind::Square, 2.0, &cut), 2.0);
        // As many nodes beside them.
        cut.nodes = vec![0; 1600];
        let both = size(SplatKind::Ellipse, 2.0, &cut);
        let wanted = ((found * found + 4.0) / 2.0).sqrt();
        assert!((both - wanted).abs() < 0.01, "{both}, {wanted}");
        assert_eq!(size(SplatKind::Ellipse, 2.0, &Cut::default()), 2.0);
    }
}
