//! Oriented polygons where a frame sees them, and the pixels that they cover.

use crate::abi::OrientedPolygon;
use crate::math::camera::View;
use crate::pack::polygons::{PolygonSample, ScreenPolygon};
use glam::{DVec2, DVec3};

/// Radii by which planes of a flat surface are kept apart where they are blended.
const LEAST_STEP: f64 = 0.01;

/// Least |cosine| by which depth offsets are divided.
const LEAST_COSINE: f64 = 0.1;

/// Polygon where the frame sees it.
pub(super) struct SeenPolygon<'p> {
    pub(super) polygon: &'p OrientedPolygon,
    seen: ScreenPolygon,
}

/// Polygons that a view sees, in their order; where `is_culled` without those that face away.
pub(super) fn seen_polygons<'p>(
    polygons: &'p [OrientedPolygon],
    view: &View,
    is_culled: bool,
) -> Vec<SeenPolygon<'p>> {
    (polygons.iter())
        .filter(|polygon| !is_culled || polygon.faces(view))
        .filter_map(|polygon| {
            let seen = ScreenPolygon::of(polygon, view)?;
            Some(SeenPolygon { polygon, seen })
        })
        .collect()
}

impl SeenPolygon<'_> {
    /// Calls `visit` with the pixels of some columns and rows (the first, and one past the last) that it covers, and what they
    /// see of it.
    pub(super) fn for_each_pixel(
        &self,
        [left, right]: [usize; 2],
        [top, bottom]: [usize; 2],
        mut visit: impl FnMut([usize; 2], PolygonSample),
    ) {
        let [low, high] = self.seen.bounds();
        let is_widened = self.seen.margin_px() > 0.0;
        // Pixels whose centers lie between; casts saturate at 0.
        let first_row = ((low.y - 0.5).ceil() as usize).clamp(top, bottom);
        let end_row = ((high.y - 0.5).floor() + 1.0) as usize;
        for y in first_row..end_row.min(bottom) {
            let at_y = y as f64 + 0.5;
            let [from, to] = self.seen.span(at_y);
            if from > to {
                continue;
            }
            let first = ((from - 0.5).ceil() as usize).max(left);
            let end = (((to - 0.5).floor() + 1.0) as usize).min(right);
            for x in first..end {
                let at = DVec2::new(x as f64 + 0.5, at_y);
                let sample = match is_widened {
                    true => self.seen.sample(at),
                    false => self.seen.sample_inside(at),
                };
                if let Some(sample) = sample {
                    visit([x, y], sample);
                }
            }
        }
    }
}

/// Splat from a vertex where it is blended or hides centers: pulled towards the eye or pushed away from it by
/// scaling around it, so that it stays flat and covers the same pixels.
pub(super) struct PushedSplat<'p> {
    pub(super) own: SeenPolygon<'p>,
    /// Depth offset of its radius, view-space units.
    pub(super) offset: f32,
    /// Depth offset over the distance of its center from the eye; 0 without perspective.
    slope: f64,
    /// Depth offset without perspective, view-space units; else 0.
    lift: f64,
    /// Twice what a face that it stands for may lie from its plane, depth offsets.
    apart: f64,
}

impl<'p> PushedSplat<'p> {
    /// Polygon that a view sees, pushed by a factor of its radius.
    pub(super) fn new(own: SeenPolygon<'p>, view: &View, depth_offset: f32) -> Self {
        let polygon = own.polygon;
        let turn = view.view_from_model.as_dmat4();
        let scale = f64::from(view.model_scale);
        let center = turn.transform_point3(polygon.center.as_dvec3());
        let normal = turn.transform_vector3(polygon.normal.as_dvec3()) / scale;
        let way = center.length();
        let to_eye = match view.is_perspective {
            true => -center / way,
            false => DVec3::Z,
        };
        let facing = match way > 0.0 || !view.is_perspective {
            true => normal.dot(to_eye).abs().max(LEAST_COSINE),
            false => 1.0,
        };
        let offset = f64::from(depth_offset) * f64::from(polygon.round_radius) * scale / facing;
        let (slope, lift) = match (view.is_perspective, way > 0.0) {
            (true, true) => (offset / way, 0.0),
            (true, false) => (0.0, 0.0),
            (false, _) => (0.0, offset),
        };
        Self {
            own,
            offset: offset as f32,
            slope,
            lift,
            apart: 2.0 * f64::from(polygon.spread),
        }
    }

    /// Distance that a sample is pulled to by what faces may lie apart.
    pub(super) fn pulled_distance(&self, sample: &PolygonSample) -> f64 {
        (sample.distance - self.apart * self.lift) / (1.0 + self.apart * self.slope)
    }

    /// Distance that a sample is pushed to by what faces may lie apart.
    pub(super) fn pushed_distance(&self, sample: &PolygonSample) -> f64 {
        self.pushed(sample.distance, self.apart + LEAST_STEP)
    }

    /// Distance that a sample is pushed to by what keeps planes of a flat surface apart.
    pub(super) fn least_pushed_distance(&self, sample: &PolygonSample) -> f64 {
        self.pushed(sample.distance, LEAST_STEP)
    }

    /// A distance, pushed away by a number of depth offsets.
    fn pushed(&self, distance: f64, offsets: f64) -> f64 {
        distance * (1.0 + offsets * self.slope) + offsets * self.lift
    }
}
