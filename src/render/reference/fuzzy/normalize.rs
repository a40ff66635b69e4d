//! The third pass of fuzzy splats on the CPU.

use crate::abi::constants;
use crate::image::Image;
use crate::math::camera::View;
use crate::pack::{ColorBy, Style};
use crate::render::reference::disc::through;
use crate::render::reference::shade::{Kind, Shading};
use crate::render::reference::target::{LEAST_ALPHA, in_formats};
use crate::render::reference::{Frame, Outputs};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// The picture of the sums.
pub(super) fn image(
    frame: &Frame,
    has_coverage: bool,
    outputs: Outputs,
    front: &[f32],
    sums: &[[f32; 4]],
    normals: &[[f32; 4]],
) -> Image {
    let view = frame.view;
    let (width, height) = (view.width as usize, view.height as usize);
    let is_rim = |x: usize, y: usize| {
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let mut rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.any(|y| {
            columns
                .clone()
                .any(|x| sums[y * width + x][3] < constants::LEAST_FUZZY_WEIGHT)
        })
    };
    let background = frame.style.background.map(f64::from);
    // The sums of deferred shading hold what decides the color.
    let style = Style {
        use_colors: frame.style.use_colors || frame.style.color_by == ColorBy::Primitive,
        color_by: ColorBy::Shading,
        ..*frame.style
    };
    let shading = Shading::new(view, &style);
    let is_shown = |i: usize| sums[i][3] >= constants::LEAST_FUZZY_WEIGHT;
    let color_at = |i: usize| {
        if !is_shown(i) {
            let [r, g, b] = background;
            return [r, g, b, 0.0];
        }
        let [r, g, b, weight] = sums[i].map(f64::from);
        let alpha = if has_coverage && is_rim(i % width, i / width) {
            weight.min(1.0)
        } else {
            1.0
        };
        let mut mean = DVec3::new(r, g, b) / weight;
        if let (true, Some(normal)) = (frame.style.is_deferred, normals.get(i)) {
            let at = (i % width, i / width);
            mean = light(
                frame,
                &shading,
                at,
                *normal,
                f64::from(normal[3]) / weight,
                mean,
            );
        }
        let shown = |mean: f64, behind: f64| mean * alpha + behind * (1.0 - alpha);
        [
            shown(mean.x, background[0]),
            shown(mean.y, background[1]),
            shown(mean.z, background[2]),
            alpha.max(LEAST_ALPHA),
        ]
    };
    let distance_at = |i: usize| {
        if is_shown(i) {
            view.distance_of_depth(front[i])
        } else {
            f32::INFINITY
        }
    };
    let normal_at = |i: usize| {
        if is_shown(i) {
            in_world(view, normals[i]).as_vec3().to_array()
        } else {
            [0.0; 3]
        }
    };
    let pixels = sums.len();
    let (color, values) = in_formats(pixels, outputs, color_at);
    Image {
        width: view.width,
        height: view.height,
        color,
        values,
        depth: if outputs.depth {
            (0..pixels).into_par_iter().map(distance_at).collect()
        } else {
            Vec::new()
        },
        normal: if outputs.normal {
            (0..pixels).into_par_iter().map(normal_at).collect()
        } else {
            Vec::new()
        },
    }
}

/// A sum of normals in view space as a unit normal in the world, or zero.
fn in_world(view: &View, [x, y, z, _]: [f32; 4]) -> DVec3 {
    let in_view = Vec3::new(x, y, z).as_dvec3().normalize_or_zero();
    let to_model = view.view_from_model.as_dmat4().inverse();
    (to_model.transform_vector3(in_view) * f64::from(view.model_scale)).normalize_or_zero()
}

/// Deferred shading: the mean of normals and base colors, lit as a point of the surface on the ray of the pixel, at the
/// mean of depths.
fn light(
    frame: &Frame,
    shading: &Shading,
    (x, y): (usize, usize),
    normal: [f32; 4],
    depth: f64,
    base: DVec3,
) -> DVec3 {
    let view = frame.view;
    let distance = f64::from(view.distance_of_depth(depth as f32));
    let on_ray = through(frame, x as u32, y as u32);
    let in_view = if view.is_perspective {
        on_ray * distance
    } else {
        on_ray.truncate().extend(-distance)
    };
    let to_model = view.view_from_model.as_dmat4().inverse();
    let position = to_model.transform_point3(in_view);
    shading.value(Kind::Splat, position, in_world(view, normal), base)
}
