//! Pixels at the rims of patches show how much of them is covered.
//!
//! **Which.** Those whose reversed depth is farther from the mean of the depths on both sides, along x or along y, than four widths
//! of a pixel: in a plane reversed depths go on straight. Pixels at a side of the picture have neighbors along it alone.
//!
//! **What.** Sixteen samples of the pixel are tested against the patches that it and its eight neighbors show, and each takes the
//! color of the pixel that shows the nearest patch that covers it: itself, else the first in the order of [`AROUND`]. Patches that
//! are smaller than a pixel may lie between those that are seen. So a patch is bounded only by those of its sides that face the
//! way in which depths fall around the pixel, and widened by half its margin. Where they fall to several sides, as beside what is
//! thin, all sides bound it, and the whole margin widens it. A pixel that shows no patch is covered by what it shows, at its
//! depth, wherever none of those is nearer. Where it shows a patch, what none covers shows the mean of those of the neighbors that
//! show none; without such neighbors it does not count.

use crate::abi::constants::{OUTWARD_COSINE, RIM_MARGIN};
use crate::math::camera::View;
use crate::pack::polygons::ScreenPolygon;
use crate::patches::{AROUND, RIM_PLACES, RIM_SAMPLES, StraightDepth, outward_direction};
use crate::render::reference::bands::OpaquePixel;
use crate::render::reference::frame::ReferenceFrame;
use crate::render::reference::polygons::PolygonList;
use glam::{DVec2, DVec4, Vec2, Vec3};
use rayon::prelude::*;

/// Covers rims in the picture that patches were drawn into.
pub(super) fn cover(frame: &ReferenceFrame<'_>, pixels: &mut [OpaquePixel], list: PolygonList<'_>) {
    let seen = ExactRims {
        frame,
        list,
        pixels,
    };
    let colors: Vec<(usize, [f64; 4])> = (0..pixels.len())
        .into_par_iter()
        .filter(|&at| seen.is_rim(at))
        .filter_map(|at| Some((at, seen.color(at)?)))
        .collect();
    for (at, color) in colors {
        pixels[at].shown.color = color;
    }
}

/// A picture whose patches are drawn.
struct ExactRims<'a> {
    frame: &'a ReferenceFrame<'a>,
    list: PolygonList<'a>,
    pixels: &'a [OpaquePixel],
}

impl ExactRims<'_> {
    fn place(&self, at: usize) -> [i64; 2] {
        let width = self.frame.view.width as usize;
        [(at % width) as i64, (at / width) as i64]
    }

    /// A pixel beside another; `None` beside the picture.
    fn beside(&self, [x, y]: [i64; 2], [across, down]: [i32; 2]) -> Option<&OpaquePixel> {
        let View { width, height, .. } = self.frame.view;
        let (x, y) = (x + i64::from(across), y + i64::from(down));
        let is_in = (0..i64::from(*width)).contains(&x) && (0..i64::from(*height)).contains(&y);
        is_in.then(|| &self.pixels[(y * i64::from(*width) + x) as usize])
    }

    fn is_rim(&self, at: usize) -> bool {
        let straight = StraightDepth::new(self.frame.view);
        let (place, own) = (self.place(at), self.pixels[at].depth);
        let is_broken = |before: [i32; 2], after: [i32; 2]| {
            let sides = self.beside(place, before).zip(self.beside(place, after));
            sides.is_some_and(|(a, b)| straight.is_broken([a.depth, own, b.depth]))
        };
        is_broken([-1, 0], [1, 0]) || is_broken([0, -1], [0, 1])
    }

    /// Color of a rim; `None` where no patch is near.
    fn color(&self, at: usize) -> Option<[f64; 4]> {
        let (place, own) = (self.place(at), &self.pixels[at]);
        let color_of = |pixel: &OpaquePixel| DVec4::from(pixel.shown.color);
        let mut patches: Vec<(u32, ScreenPolygon, DVec4)> = Vec::new();
        let (mut others, mut other_count) = (DVec4::ZERO, 0.0);
        for step in AROUND {
            let Some(pixel) = self.beside(place, step) else {
                continue;
            };
            let Some(number) = pixel.patch else {
                others += color_of(pixel);
                other_count += 1.0;
                continue;
            };
            if patches.iter().all(|(known, ..)| *known != number) {
                let polygon = &self.list.polygons[number as usize];
                let seen = ScreenPolygon::of(polygon, self.frame.view)?;
                patches.push((number, seen, color_of(pixel)));
            }
        }
        if patches.is_empty() {
            return None;
        }
        let behind = match (own.patch, other_count > 0.0) {
            (None, _) => Some((own.depth, color_of(own))),
            (Some(_), true) => Some((0.0, others / other_count)),
            (Some(_), false) => None,
        };
        let falls = AROUND.iter().filter_map(|&step| {
            let pixel = self.beside(place, step)?;
            let step = Vec2::from(step.map(|step| step as f32));
            Some((step, own.depth - pixel.depth))
        });
        let outward = outward_direction(falls);
        let (mut sum, mut count) = (DVec4::ZERO, 0.0);
        for i in 0..RIM_SAMPLES {
            let corner = DVec2::new(place[0] as f64, place[1] as f64);
            let at = corner + DVec2::from(RIM_PLACES.map(|places| f64::from(places[i])));
            let mut nearest = behind;
            for (_, seen, color) in &patches {
                let Some(depth) = self.depth(seen, at, outward) else {
                    continue;
                };
                if nearest.is_none_or(|(front, _)| depth > front) {
                    nearest = Some((depth, *color));
                }
            }
            if let Some((_, color)) = nearest {
                sum += color;
                count += 1.0;
            }
        }
        (count > 0.0).then(|| (sum / count).to_array())
    }

    /// Reversed depth of a patch at a place; `None` where it does not cover it.
    fn depth(&self, patch: &ScreenPolygon, at: DVec2, outward: Option<Vec2>) -> Option<f32> {
        let seen = match outward {
            Some(outward) => {
                let bound = (outward.as_dvec2(), f64::from(OUTWARD_COSINE));
                patch.sample_with_outer_sides(at, bound, f64::from(RIM_MARGIN))
            }
            None => patch.sample(at),
        };
        let placed = (self.frame).project(Vec3::new(0.0, 0.0, -seen?.distance as f32))?;
        Some(placed.depth().max(f32::MIN_POSITIVE))
    }
}
