//! The third pass of fuzzy splats on the CPU.

use crate::abi::constants::LEAST_FUZZY_WEIGHT;
use crate::image::Image;
use crate::math::camera::View;
use crate::pack::{ColorBy, PrimitiveStyle};
use crate::render::PictureOutputs;
use crate::render::reference::bands::{LEAST_ALPHA, ShownPixel, picture};
use crate::render::reference::disc::through;
use crate::render::reference::frame::ReferenceFrame;
use crate::render::reference::fuzzy::FuzzyPixel;
use crate::render::reference::shade::{SurfaceKind, SurfacePoint, SurfaceShading};
use glam::{DVec3, Vec4};

/// The picture of the sums.
pub(super) fn image(
    frame: &ReferenceFrame,
    has_coverage: bool,
    outputs: PictureOutputs,
    pixels: &[FuzzyPixel],
) -> Image {
    // The sums of deferred shading hold what decides the color.
    let style = PrimitiveStyle {
        use_colors: frame.style.use_colors || frame.style.color_by == ColorBy::Primitive,
        color_by: ColorBy::Shading,
        ..*frame.style
    };
    let sums = FuzzySums {
        frame,
        deferred: (frame.style.is_deferred).then(|| SurfaceShading::new(frame.view, &style)),
        has_coverage,
        has_normals: outputs.normal,
        pixels,
    };
    picture(frame.view, outputs, |i| sums.shown(i))
}

/// The attachments after the second pass.
struct FuzzySums<'a> {
    frame: &'a ReferenceFrame<'a>,
    /// What lights the means; `None` where fragments are lit.
    deferred: Option<SurfaceShading>,
    /// Sums of weights are coverage.
    has_coverage: bool,
    has_normals: bool,
    pixels: &'a [FuzzyPixel],
}

impl FuzzySums<'_> {
    fn shown(&self, i: usize) -> ShownPixel {
        let background = ShownPixel::background(self.frame.style);
        if !self.is_shown(i) {
            return background;
        }
        let pixel = &self.pixels[i];
        let view = self.frame.view;
        let sum = pixel.sum.as_dvec4();
        let mut mean = sum.truncate() / sum.w;
        if let Some(shading) = &self.deferred {
            mean = self.light(shading, i, mean);
        }
        let alpha = if self.has_coverage && self.is_rim(i) {
            sum.w.min(1.0)
        } else {
            1.0
        };
        let [r, g, b, _] = background.color;
        let [r, g, b] = (mean * alpha + DVec3::new(r, g, b) * (1.0 - alpha)).to_array();
        ShownPixel {
            color: [r, g, b, alpha.max(LEAST_ALPHA)],
            distance: view.distance_of_depth(pixel.front),
            normal: if self.has_normals {
                in_world(view, pixel.normal).as_vec3().to_array()
            } else {
                [0.0; 3]
            },
        }
    }

    fn is_shown(&self, i: usize) -> bool {
        self.pixels[i].sum.w >= LEAST_FUZZY_WEIGHT
    }

    /// Tells whether a pixel or one of its 8 neighbors in the picture shows nothing.
    fn is_rim(&self, i: usize) -> bool {
        let (width, height) = (
            self.frame.view.width as usize,
            self.frame.view.height as usize,
        );
        let (x, y) = (i % width, i / width);
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let mut rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.any(|y| {
            let mut row = columns.clone().map(|x| &self.pixels[y * width + x]);
            row.any(|pixel| pixel.sum.w < LEAST_FUZZY_WEIGHT)
        })
    }

    /// Deferred shading: the mean of normals and base colors, lit as a point of the surface on the ray of the pixel, at
    /// the mean of depths.
    fn light(&self, shading: &SurfaceShading, i: usize, base: DVec3) -> DVec3 {
        let view = self.frame.view;
        let pixel = &self.pixels[i];
        let depth = f64::from(pixel.normal.w) / f64::from(pixel.sum.w);
        let distance = f64::from(view.distance_of_depth(depth as f32));
        let i = i as u32;
        let on_ray = through(self.frame, i % view.width, i / view.width);
        let in_view = if view.is_perspective {
            on_ray * distance
        } else {
            on_ray.truncate().extend(-distance)
        };
        let to_model = view.view_from_model.as_dmat4().inverse();
        shading.value(&SurfacePoint {
            kind: SurfaceKind::Splat,
            position: to_model.transform_point3(in_view),
            normal: in_world(view, pixel.normal),
            color: base,
            light_share: 1.0,
            distance,
        })
    }
}

/// A sum of normals in view space as a unit normal in the world, or zero.
fn in_world(view: &View, sum: Vec4) -> DVec3 {
    let in_view = sum.truncate().as_dvec3().normalize_or_zero();
    let to_model = view.view_from_model.as_dmat4().inverse();
    (to_model.transform_vector3(in_view) * f64::from(view.model_scale)).normalize_or_zero()
}
