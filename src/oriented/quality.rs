//! What splats do to a surface, measured by samples: how far they stand out, and what they leave bare.

use crate::abi::OrientedPolygon;
use crate::oriented::nearest::FaceBoxes;
use crate::oriented::splats::SplatSet;
use crate::oriented::surface::WeldedSurface;
use crate::progress::Progress;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Samples along the side of the square around a splat.
const SAMPLES_A_SIDE: usize = 9;

/// Distances of drawn points from the surface, model units.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OverhangSpread {
    /// The greatest.
    pub most: f64,
    /// The mean over splats of their greatest.
    pub mean: f64,
    /// The greatest over the radius of its splat.
    pub most_of_radius: f64,
}

/// Largest number of splats whose reach is measured. The nearest face to a point that is far from all takes long to find.
pub const MOST_MEASURED: usize = 8_192;

/// How far splats reach from the surface. Samples lie inside of each and on its outline. Of more than [`MOST_MEASURED`]
/// splats an even choice is measured. Once `progress` is cancelled the rest counts as nothing.
pub fn overhang(
    surface: &WeldedSurface,
    set: &SplatSet,
    progress: &dyn Progress,
) -> OverhangSpread {
    let boxes = FaceBoxes::new(surface);
    let step = set.splats.len().div_ceil(MOST_MEASURED).max(1);
    let each: Vec<[f64; 2]> = (set.splats.par_iter().step_by(step))
        .map(|splat| {
            if progress.is_cancelled() {
                return [0.0; 2];
            }
            let most = (drawn_points(splat).iter())
                .map(|&point| boxes.distance(point))
                .fold(0.0, f64::max);
            [most, most / f64::from(splat.round_radius)]
        })
        .collect();
    let count = each.len().max(1) as f64;
    OverhangSpread {
        most: each.iter().map(|e| e[0]).fold(0.0, f64::max),
        mean: each.iter().map(|e| e[0]).sum::<f64>() / count,
        most_of_radius: each.iter().map(|e| e[1]).fold(0.0, f64::max),
    }
}

/// Points of a splat: a square grid, and its outline.
fn drawn_points(splat: &OrientedPolygon) -> Vec<DVec3> {
    let radius = splat.round_radius;
    let corners: Vec<DVec2> = (splat.footprint().iter())
        .map(|c| DVec2::from(c.map(f64::from)))
        .collect();
    let point = |uv: [f32; 2]| splat.point(uv).as_dvec3();
    let at = |i: usize| (i as f32 + 0.5) / SAMPLES_A_SIDE as f32 * 2.0 * radius - radius;
    let mut points: Vec<DVec3> = (0..SAMPLES_A_SIDE * SAMPLES_A_SIDE)
        .map(|k| [at(k % SAMPLES_A_SIDE), at(k / SAMPLES_A_SIDE)])
        .filter(|&uv| splat.contains(uv))
        .map(point)
        .collect();
    for (i, &from) in corners.iter().enumerate() {
        let to = corners[(i + 1) % corners.len()];
        for step in 0..4 {
            let uv = from.lerp(to, f64::from(step) / 4.0);
            // Corners outside of the circle are not drawn.
            let uv = uv.clamp_length_max(f64::from(radius)).as_vec2();
            points.push(point(uv.to_array()));
        }
    }
    points
}

/// The share of the surface's area that no splat and no triangle covers, 0 to 1, by `samples_a_face` points of each face.
///
/// A point is covered by a triangle that is drawn, or by a splat of a corner of its face, turned to the same side, that holds
/// its foot and is no farther from it than `most_height` radii.
pub fn uncovered_share(
    surface: &WeldedSurface,
    set: &SplatSet,
    samples_a_face: usize,
    most_height: f64,
) -> f64 {
    let bare = |face: u32| {
        if (set.triangles)
            .binary_search(&surface.triangle_of_face[face as usize])
            .is_ok()
        {
            return 0.0;
        }
        let [a, b, c] = surface.corners(face);
        let normal = surface.normals[face as usize];
        let splats: Vec<&OrientedPolygon> = (surface.faces[face as usize].iter())
            .flat_map(|&point| set.splats_of_point(point))
            .filter(|splat| splat.normal.as_dvec3().dot(normal) > 0.0)
            .collect();
        let is_bare = |k: &usize| {
            // The R2 sequence (M. Roberts, 2018), folded into the triangle.
            let (s, t) = (
                (0.5 + *k as f64 * 0.754_877_666_246_692_8) % 1.0,
                (0.5 + *k as f64 * 0.569_840_290_998_053_2) % 1.0,
            );
            let (s, t) = if s + t > 1.0 {
                (1.0 - s, 1.0 - t)
            } else {
                (s, t)
            };
            let point = a + s * (b - a) + t * (c - a);
            !splats.iter().any(|splat| covers(splat, point, most_height))
        };
        let bare = (0..samples_a_face).filter(is_bare).count();
        surface.areas[face as usize] * bare as f64 / samples_a_face.max(1) as f64
    };
    let faces = 0..surface.faces.len() as u32;
    let total: f64 = surface.areas.iter().sum();
    let shares: Vec<f64> = faces.into_par_iter().map(bare).collect();
    if total > 0.0 {
        shares.iter().sum::<f64>() / total
    } else {
        0.0
    }
}

fn covers(splat: &OrientedPolygon, point: DVec3, most_height: f64) -> bool {
    let from_center = point - splat.center.as_dvec3();
    let [u, v, height] = [splat.axis, splat.second_axis(), splat.normal]
        .map(|axis| from_center.dot(axis.as_dvec3()));
    // On the outline rounding decides.
    let inward = 1.0 - 1e-6;
    height.abs() <= most_height * f64::from(splat.round_radius)
        && splat.contains([(u * inward) as f32, (v * inward) as f32])
}
