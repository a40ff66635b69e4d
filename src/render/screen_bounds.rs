//! The part of the picture that a model can be seen in: work on whole pictures is done there only.

use crate::math::camera::View;
use crate::render::model_facts::{DrawnFacts, DrawnParts, FactedModel};
use glam::Vec3;
use std::ops::Range;

/// The pixels that the box of what is drawn covers, and `margin_px` more on every side: left, top, and one past right and
/// bottom. Never empty. All of the picture where a corner of the box is beside or behind the eye.
pub(crate) fn rect_px(facts: &DrawnFacts, view: &View, margin_px: f32) -> [u32; 4] {
    let whole = [0, 0, view.width, view.height];
    let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
    for corner in 0..8 {
        let side = |axis: usize| {
            let end = if corner >> axis & 1 == 0 {
                facts.min
            } else {
                facts.max
            };
            end[axis]
        };
        let (x, y, distance) = view.project(Vec3::new(side(0), side(1), side(2)));
        // Also what is no number. The near plane does not matter: the picture of the box is the hull of those of its
        // corners, wherever they are before the eye.
        if !(x.is_finite() && y.is_finite() && (distance > 0.0 || !view.is_perspective)) {
            return whole;
        }
        for (axis, at) in [x, y].into_iter().enumerate() {
            low[axis] = low[axis].min(at);
            high[axis] = high[axis].max(at);
        }
    }
    let part = |axis: usize, size: u32| {
        let first = (low[axis] - margin_px)
            .floor()
            .clamp(0.0, size as f32 - 1.0) as u32;
        let end = (high[axis] + margin_px).ceil().clamp(0.0, size as f32) as u32;
        (first, end.max(first + 1))
    };
    let ((left, right), (top, bottom)) = (part(0, view.width), part(1, view.height));
    [left, top, right, bottom]
}

/// Sides of a tile of the picture, pixels. Rows are high, as each costs a software device some microseconds.
const TILE: [u32; 2] = [8, 32];
/// Gaps of a row between areas that are not worth another one, tiles.
const LEAST_GAP: usize = 2;
/// The level of the tree that says where the model is has at least so many nodes. Four times as many leave out more of the
/// rim, and take as long to ask as that spares.
const LEAST_NODES: usize = 512;

/// Parts of `rect_px` ([`rect_px`] of the same margin) in which something can be seen, disjoint. A software device goes over
/// each pixel that it is told to, whether anything is there or not.
pub(crate) fn areas(
    parts: DrawnParts<'_>,
    view: &View,
    rect_px: [u32; 4],
    margin_px: f32,
) -> Vec<[u32; 4]> {
    let most = pixels(rect_px) / parts.count().max(1) as u64;
    let level_of = |part: FactedModel<'_>| {
        let tree = &part.model.tree;
        let mut levels = (0..tree.level_count()).map(|level| tree.level(level));
        levels.find(|nodes| nodes.len() >= LEAST_NODES && nodes.len() as u64 <= most)
    };
    let levels: Option<Vec<Range<u32>>> = parts.iter().map(level_of).collect();
    levels
        .and_then(|levels| {
            let spheres = parts.iter().zip(levels).flat_map(|(part, level)| {
                let nodes = part
                    .model
                    .tree
                    .nodes
                    .get(level.start as usize..level.end as usize);
                let nodes = nodes.unwrap_or_default().iter();
                nodes.map(|node| (node.center, node.radius))
            });
            areas_of(spheres, view, rect_px, margin_px)
        })
        .unwrap_or_else(|| vec![rect_px])
}

/// The same of spheres; `None` where the eye is in one of them.
fn areas_of(
    spheres: impl Iterator<Item = (Vec3, f32)>,
    view: &View,
    rect_px: [u32; 4],
    margin_px: f32,
) -> Option<Vec<[u32; 4]>> {
    let [left, top, right, bottom] = rect_px;
    let columns = (right - left).div_ceil(TILE[0]) as usize;
    let rows = (bottom - top).div_ceil(TILE[1]) as usize;
    let mut tiles = vec![false; columns * rows];
    let half = [view.width as f32 / 2.0, view.height as f32 / 2.0];
    let focal = [0, 1].map(|i: usize| view.scale[i].abs() * half[i]);
    for (center, radius) in spheres {
        let (x, y, distance) = view.project(center);
        let radius = radius * view.model_scale * 1.001;
        // Pixels that a sphere of this radius reaches from where its center is seen. In a perspective the farthest is at
        // most that of the nearest and farthest depth: (x + r) / (z - r) - x / z = r (1 + x / z) / (z - r).
        let reach = |i: usize, at: f32| {
            margin_px
                + if view.is_perspective {
                    let aside = (at - half[i]).abs() + view.offset[i].abs() * half[i];
                    radius * (focal[i] + aside) / (distance - radius)
                } else {
                    radius * focal[i]
                }
        };
        let (reach_x, reach_y) = (reach(0, x), reach(1, y));
        let is_beside = view.is_perspective && distance <= radius;
        if is_beside || !(reach_x + x).is_finite() || !(reach_y + y).is_finite() {
            return None;
        }
        // Tiles from the first to before the last; a number below 0 becomes 0.
        let span = |low: f32, high: f32, start: u32, side: u32, most: usize| {
            let first = ((low - start as f32) / side as f32) as usize;
            let is_before = high < start as f32;
            let end = ((high - start as f32) / side as f32) as usize + 1;
            first..if is_before { 0 } else { end.min(most) }
        };
        let across = span(x - reach_x, x + reach_x, left, TILE[0], columns);
        for row in span(y - reach_y, y + reach_y, top, TILE[1], rows) {
            if let Some(tiles) = tiles
                .get_mut(row * columns..)
                .and_then(|row| row.get_mut(across.clone()))
            {
                tiles.fill(true);
            }
        }
    }
    let mut areas: Vec<[u32; 4]> = Vec::new();
    // Those of the row before.
    let mut before = 0..0;
    for (row, tiles) in tiles.chunks(columns.max(1)).enumerate() {
        let start = top + row as u32 * TILE[1];
        let end = (start + TILE[1]).min(bottom);
        let own = areas.len();
        for run in runs(tiles) {
            let side = |tile: usize| (left + tile as u32 * TILE[0]).min(right);
            areas.push([side(run.start), start, side(run.end), end]);
        }
        let across = |[left, _, right, _]: &[u32; 4]| [*left, *right];
        let same = areas[before.clone()]
            .iter()
            .map(across)
            .eq(areas[own..].iter().map(across));
        if same && own == before.end {
            areas.truncate(own);
            for area in &mut areas[before.clone()] {
                area[3] = end;
            }
        } else {
            before = own..areas.len();
        }
    }
    Some(areas)
}

/// Runs of tiles that are set, with small gaps.
fn runs(tiles: &[bool]) -> Vec<std::ops::Range<usize>> {
    let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
    for (at, _) in tiles.iter().enumerate().filter(|(_, is_set)| **is_set) {
        match runs.last_mut() {
            Some(last) if at - last.end <= LEAST_GAP => last.end = at + 1,
            _ => runs.push(at..at + 1),
        }
    }
    runs
}

/// One as x, y, width and height.
pub(crate) fn area([left, top, right, bottom]: [u32; 4]) -> [u32; 4] {
    [left, top, right - left, bottom - top]
}

/// Number of pixels in a rectangle.
pub(crate) fn pixels([left, top, right, bottom]: [u32; 4]) -> u64 {
    u64::from(right - left) * u64::from(bottom - top)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;
    use crate::math::camera::Camera;
    use crate::tree::Model;
    use glam::DVec3;

    fn of_box(min: Vec3, max: Vec3, view: &View, margin: f32) -> [u32; 4] {
        let facts = DrawnFacts {
            min,
            max,
            ..DrawnFacts::from(&Model::default())
        };
        rect_px(&facts, view, margin)
    }

    #[test]
    fn a_rectangle_holds_the_box_and_is_as_small_as_it_may_be() {
        // Half a field of view of 45 degrees: 100 pixels a unit of tangent.
        let size = (400, 200);
        let angle = std::f64::consts::FRAC_PI_2;
        let look = |near| {
            Camera::look_at(
                size,
                DVec3::ZERO,
                DVec3::NEG_Z,
                DVec3::Y,
                angle,
                [near, 100.0],
            )
            .view(DVec3::ZERO)
            .unwrap()
        };
        // The nearer face decides: at distance 4 one unit is 25 pixels. That holds if the near plane cuts the box too.
        let (min, max) = (Vec3::new(-1.0, 0.0, -6.0), Vec3::new(2.0, 1.0, -4.0));
        for near in [1.0, 5.0] {
            assert_eq!(of_box(min, max, &look(near), 0.25), [174, 74, 251, 101]);
            assert_eq!(of_box(min, max, &look(near), 3.25), [171, 71, 254, 104]);
        }
        let view = look(1.0);
        // Partly and wholly beside the picture.
        assert_eq!(
            of_box(min - Vec3::X * 8.0, max - Vec3::X * 8.0, &view, 0.25),
            [0, 74, 101, 101]
        );
        let [left, _, right, _] = of_box(min + Vec3::X * 90.0, max + Vec3::X * 90.0, &view, 0.25);
        assert_eq!((left, right), (399, 400));
        // Around the eye, and what has no size.
        assert_eq!(of_box(-Vec3::ONE, Vec3::ONE, &view, 0.25), [0, 0, 400, 200]);
        let nothing = (Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY));
        assert_eq!(of_box(nothing.0, nothing.1, &view, 0.25), [0, 0, 400, 200]);
        assert_eq!(pixels([3, 4, 10, 6]), 14);
        assert_eq!(area([3, 4, 10, 6]), [3, 4, 7, 2]);
    }

    /// Every pixel is in one area if it is within the margin of a sphere's picture, found by rays through its corners, and
    /// areas do not overlap.
    #[test]
    fn areas_hold_the_pictures_of_spheres_and_leave_the_rest_out() {
        let size = (403, 301);
        let margin = 4.25;
        let camera = |fov| {
            let eye = DVec3::new(0.0, -6.0, 1.0);
            let view = Camera::look_at(size, eye, DVec3::ZERO, DVec3::Z, fov, [0.1, 100.0]);
            view.view(DVec3::ZERO).unwrap()
        };
        let mut off_center = camera(0.9);
        off_center.offset = [0.3, -0.2];
        off_center.scale[0] = -off_center.scale[0];
        let mut orthographic = camera(0.9);
        orthographic.is_perspective = false;
        (orthographic.scale, orthographic.offset) = ([0.4, 0.5], [0.1, -0.05]);
        let mut ring: Vec<(Vec3, f32)> = (0..60)
            .map(|i| {
                let angle = i as f32 / 60.0 * std::f32::consts::TAU;
                (
                    Vec3::new(2.0 * angle.cos(), 0.3, 2.0 * angle.sin()),
                    0.1 + 0.01 * (i % 5) as f32,
                )
            })
            .collect();
        // Near and at the side, where a perspective makes an ellipse of it.
        ring.push((Vec3::new(1.2, -3.0, 0.3), 0.6));
        for view in [camera(0.9), camera(1.6), off_center, orthographic] {
            let rect = [3, 5, 400, 299];
            let areas = areas_of(ring.iter().copied(), &view, rect, margin).unwrap();
            let mut count = vec![0; (size.0 * size.1) as usize];
            for &[left, top, right, bottom] in &areas {
                assert!(left >= rect[0] && top >= rect[1] && right <= rect[2] && bottom <= rect[3]);
                for y in top..bottom {
                    for x in left..right {
                        count[(y * size.0 + x) as usize] += 1;
                    }
                }
            }
            assert!(count.iter().all(|&n| n <= 1), "areas overlap");
            let all: u32 = count.iter().sum();
            assert!(u64::from(all) < pixels(rect) * 4 / 5, "{all}");
            for &(center, radius) in &ring {
                for step in 0..400 {
                    let a = step as f32 * 0.37;
                    let z = 1.0 - (step as f32 + 0.5) / 200.0;
                    let r = (1.0 - z * z).sqrt();
                    let on = center + radius * Vec3::new(r * a.cos(), r * a.sin(), z);
                    let (x, y, _) = view.project(on);
                    for (dx, dy) in [(-margin, 0.0), (margin, 0.0), (0.0, -margin), (0.0, margin)] {
                        let (x, y) = ((x + dx).floor(), (y + dy).floor());
                        let is_in = x >= rect[0] as f32
                            && y >= rect[1] as f32
                            && x < rect[2] as f32
                            && y < rect[3] as f32;
                        if is_in {
                            let at = y as usize * size.0 as usize + x as usize;
                            assert_eq!(count[at], 1, "{x} {y}");
                        }
                    }
                }
            }
        }
        // The eye is in one of them, or they are nowhere.
        let view = camera(0.9);
        let near = [(view.eye, 0.5)].into_iter();
        assert_eq!(areas_of(near, &view, [0, 0, 403, 301], margin), None);
        let no_number = [(Vec3::NAN, 0.5)].into_iter();
        assert_eq!(areas_of(no_number, &view, [0, 0, 403, 301], margin), None);
        // All over, rows become one.
        let far = [(Vec3::ZERO, 4.0)].into_iter();
        let rect = [0, 0, 403, 301];
        assert_eq!(areas_of(far, &view, rect, margin), Some(vec![rect]));
    }
}
