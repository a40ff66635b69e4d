//! How far the camera has moved, as the nodes of each region of the model see it.
//!
//! A camera that goes around a model moves all of it across the picture, but changes depths and distances by little: those of
//! what lies at the center not at all. So there is not one odometer but one for each node of a level with some hundreds
//! of nodes, for all that is below it. How depths, distances and the like change from one view to the next is known for the
//! center of its ball, and how much this can differ within the ball.

use crate::cut::frustum_and_size::Tester;
use crate::cut::slack::SLACK_ERROR;
use glam::{DVec3, Vec3};

/// Nodes of the level that divides a model into regions, at least, where it has so many.
const FEWEST_REGIONS: u32 = 500;
/// And at most, for 16 bits.
const MOST_REGIONS: u32 = 1 << 16;
/// Odometers start again, and all is tested, when one has reached so many times the reach of the model: single precision
/// would lose small steps.
const LONGEST: f64 = 4.0;

/// The nodes `first .. first + count` of a level, whose children are nodes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Regions {
    pub(super) level: usize,
    pub(super) first: u32,
    pub(super) count: u32,
}

impl Regions {
    /// The first level with enough nodes, else the last, that is not the lowest. None where the tree has no such level.
    pub(super) fn of(level_starts: &[u32]) -> Option<Self> {
        let levels = level_starts.windows(3).enumerate();
        let mut found = None;
        for (level, starts) in levels {
            let [first, next, _] = *starts else { continue };
            let count = next.saturating_sub(first);
            if !(1..MOST_REGIONS).contains(&count) {
                break;
            }
            found = Some(Self {
                level,
                first,
                count,
            });
            if count >= FEWEST_REGIONS {
                break;
            }
        }
        found
    }
}

/// What the tests read of a view, in model units and double precision.
#[derive(Debug, Clone, Copy)]
struct Seen {
    eye: DVec3,
    /// The view direction and the sides: unit normals, and what is added; without near and far.
    planes: [(DVec3, f64); 5],
    near: f64,
    far: f64,
}

impl Seen {
    fn of(tester: &Tester) -> Self {
        let unit = f64::from(tester.unit);
        let plane = |[x, y, z, offset]: [f32; 4]| {
            (
                DVec3::new(f64::from(x), f64::from(y), f64::from(z)),
                f64::from(offset) / unit,
            )
        };
        let [a, b, c, d] = tester.side_planes();
        Self {
            eye: tester.reference.as_dvec3(),
            planes: [tester.forward_plane(), a, b, c, d].map(plane),
            near: f64::from(tester.near) / unit,
            far: f64::from(tester.far) / unit,
        }
    }
}

/// What has been added up for a region, model units.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Odometers {
    /// Changes of depth, of distance from the eye and of the near plane.
    size: f64,
    /// These, and changes of distances from the planes of the view volume.
    volume: f64,
}

/// Odometers of a model's regions, from one view to the next.
#[derive(Debug, Default)]
pub(super) struct Motion {
    regions: Vec<Odometers>,
    /// Ways of the eye.
    eye: f64,
}

/// The odometers of one region, as records have them.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Reading {
    /// The ball that all centers below have to lie in.
    pub(super) center: Vec3,
    pub(super) radius: f32,
    /// Of volume, size and the eye.
    odometers: [f32; 3],
    /// What the tests of this view may err by.
    error: f32,
}

impl Reading {
    /// Of places and of the eye, for answers that are found now; `is_inside`: whether the view volume is not asked.
    #[inline]
    pub(super) fn from(&self, is_inside: bool) -> [f32; 2] {
        [
            self.odometers[usize::from(is_inside)] - self.error,
            self.odometers[2] - self.error,
        ]
    }

    /// The same for answers that were found before.
    #[inline]
    pub(super) fn now(&self, is_inside: bool) -> [f32; 2] {
        [
            self.odometers[usize::from(is_inside)] + self.error,
            self.odometers[2] + self.error,
        ]
    }
}

/// How much depths and distances (and, secondly, distances from planes as well) in a ball change from one view to another.
///
/// A distance from a plane changes by an affine function of the center: by as much as at the middle of the ball, and radius times
/// the change of its normal. The change of D has a gradient |u - u'| of the directions from both eyes, which is at most the way
/// between them over the lesser distance; and it is at most this way.
fn change(from: &Seen, to: &Seen, center: DVec3, radius: f64) -> [f64; 2] {
    let distance = |camera: &Seen, plane: usize| {
        let (normal, offset) = camera.planes[plane];
        normal.dot(center - camera.eye) + offset
    };
    let of_plane = |plane: usize| {
        let turn = from.planes[plane].0.distance(to.planes[plane].0);
        (distance(to, plane) - distance(from, plane)).abs() + turn * radius
    };
    let way = from.eye.distance(to.eye);
    let (before, after) = (from.eye.distance(center), to.eye.distance(center));
    let least = before.min(after) - radius;
    let of_distance = if least > 0.0 {
        way.min((after - before).abs() + radius * way / least)
    } else {
        way
    };
    let depth = of_plane(0);
    let size = (depth + (to.near - from.near).abs()).max(of_distance);
    let sides = (1..5).map(of_plane).fold(0.0, f64::max);
    let volume = size.max(sides).max(depth + (to.far - from.far).abs());
    // Roundings of double precision.
    [size, volume].map(|change| change * 1.000_001)
}

impl Motion {
    /// Starts at 0.
    pub(super) fn restart(&mut self, count: u32) {
        self.regions.clear();
        self.regions.resize(count as usize, Odometers::default());
        self.eye = 0.0;
    }

    /// Goes on from one view to another; tells whether it can, or has to start again. `ball` is that of a region.
    pub(super) fn advance(
        &mut self,
        (from, to): (&Tester, &Tester),
        ball: impl Fn(u32) -> (Vec3, f32),
    ) -> bool {
        let most = LONGEST * to.reach();
        let (from, to) = (Seen::of(from), Seen::of(to));
        self.eye += from.eye.distance(to.eye);
        let mut longest = self.eye;
        let mut sum = 0.0;
        for (odometers, index) in self.regions.iter_mut().zip(0..) {
            let (center, radius) = ball(index);
            let [size, volume] = change(&from, &to, center.as_dvec3(), f64::from(radius));
            odometers.size += size;
            odometers.volume += volume;
            sum += odometers.volume;
            longest = longest.max(odometers.volume);
        }
        // `max` passes over what is no number, the sum does not.
        sum.is_finite() && longest < most
    }

    /// What the odometers say in a view.
    pub(super) fn readings(
        &self,
        tester: &Tester,
        ball: impl Fn(u32) -> (Vec3, f32),
        readings: &mut Vec<Reading>,
    ) {
        let error = SLACK_ERROR * tester.plane_error / tester.unit;
        readings.clear();
        readings.extend(self.regions.iter().zip(0..).map(|(odometers, index)| {
            let (center, radius) = ball(index);
            Reading {
                center,
                radius,
                odometers: [odometers.volume, odometers.size, self.eye].map(|sum| sum as f32),
                error,
            }
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cut::Settings;
    use crate::math::camera::Camera;
    use crate::tree::Model;

    /// Nothing in a ball changes by more than is said, and some of it by half as much or more.
    #[test]
    fn changes_in_a_ball_are_bounded() {
        let mut state = 3u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1u32 << 30) - 1.0
        };
        let model = Model::default();
        let mut closest = [0.0f64; 2];
        for _ in 0..2000 {
            let mut vector = |scale: f64| DVec3::new(random(), random(), random()) * scale;
            let eye = DVec3::new(0.3, 0.2, 3.0);
            let (way, target, center) = (vector(0.1), vector(0.1), vector(1.0));
            let camera = |eye: DVec3, target: DVec3, near: f64| {
                let camera = Camera::look_at((400, 300), eye, target, DVec3::Y, 0.8, (near, 20.0));
                let view = camera.view(DVec3::ZERO).expect("a usable camera");
                Seen::of(&Tester::new(&model, &view, &Settings::default()))
            };
            let from = camera(eye, DVec3::ZERO, 0.1);
            let to = camera(eye + way, target, 0.1);
            let radius = 0.2;
            let bounds = change(&from, &to, center, radius);
            for _ in 0..50 {
                let at = center + vector(1.0).clamp_length_max(1.0) * radius;
                let of = |camera: &Seen, plane: usize| {
                    let (normal, offset) = camera.planes[plane];
                    normal.dot(at - camera.eye) + offset
                };
                let planes = [0, 1, 2, 3, 4].map(|i| (of(&to, i) - of(&from, i)).abs());
                let distance = (to.eye.distance(at) - from.eye.distance(at)).abs();
                let size = planes[0].max(distance);
                let volume = planes.into_iter().fold(distance, f64::max);
                for ((change, bound), closest) in
                    [size, volume].into_iter().zip(bounds).zip(&mut closest)
                {
                    assert!(change <= bound, "{change} {bound}");
                    *closest = closest.max(change / bound);
                }
            }
        }
        assert!(closest.iter().all(|&share| share > 0.9), "{closest:?}");
    }
}
