//! How far the camera may move until a test can answer otherwise.
//!
//! Ours; no paper. Each test of a ball compares a number with zero that depends on the place of the ball's center seen from the camera:
//! its depth z, its distance D from the eye, its distances from the sides, or the way v from the eye to it. What is
//! computed here is a bound m: as long as none of these has changed by m, in sum over all frames since, the number has
//! the same sign. [`crate::cut::motion`] adds up how much they change.
//!
//! Single precision errs. In a view whose model reaches P from the eye, z, D and distances from planes are off by 1e-6 P
//! (`Tester::plane_error`), and what is made of them in the tests is as if they were off by another 2e-6 P at most; the
//! bounds here are off by as much. [`SLACK_ERROR`] of `plane_error` is taken away from a bound for the view in which it was
//! found and as much for the view in which it is used; where a test errs by more, its bound says so. What is no number
//! counts as 0: tested again.

use crate::cut::SizeMetric;
use crate::cut::frustum_and_size::Tester;
use crate::cut::siblings::{Balls, Words};
use crate::cut::strip::{LOW, MAX_COUNT, MAX_WIDTH, relative_sizes};
use glam::Vec4;

/// What is taken away from each bound, for each of the two views, in units of `Tester::plane_error`.
pub(super) const SLACK_ERROR: f32 = 6.0;

/// A bound that nothing reaches.
pub(super) const FOREVER: Vec4 = Vec4::INFINITY;

/// What is no number becomes 0.
#[inline]
fn sane(v: Vec4) -> Vec4 {
    Vec4::select(v.cmpge(Vec4::ZERO), v, Vec4::ZERO)
}

/// Bounds (not below 0) of those lanes that are in a mask; the others never end.
#[inline]
pub(super) fn of_lanes(bounds: Vec4, mask: u8) -> Vec4 {
    bounds.max(OTHERS[(mask & 15) as usize])
}

/// Forever for the lanes that are not in a mask.
const OTHERS: [Vec4; 16] = {
    let mut table = [FOREVER; 16];
    let mut mask = 0;
    while mask < 16 {
        let mut lanes = [f32::INFINITY; 4];
        let mut lane = 0;
        while lane < 4 {
            if mask >> lane & 1 != 0 {
                lanes[lane] = 0.0;
            }
            lane += 1;
        }
        table[mask] = Vec4::from_array(lanes);
        mask += 1;
    }
    table
};

impl Tester {
    /// Bounds for [`Tester::small`], in the tester's unit: of changes of z and D.
    ///
    /// A ball is small where a = z - R - near > 0 and the size is at most the threshold. Of a <= 0 the bound is -a. Else
    /// a itself must not vanish where it decides, nor the difference of the size. For the exact size, with ρ = 2 f / t and
    /// w = z² - R², that is F = w² - ρ² R² (D² - R²). A change of z and D by m <= (z - R) / 16 changes w by at most 2.07 z m <=
    /// 2.07 (z + R) (z - R) / 16 = 0.13 w, so w² by 2.13 · 2.07 w z m, and D² by 2.1 D m <= 2.1 D² m / z, as D >= z. So
    /// m = |F| z / (4.4 z² w + 2.1 ρ² R² D²). The other differences are linear: z - ρ R, z - R - ρ R, and D - R sqrt(1 + ρ²).
    #[inline]
    pub(super) fn small_slack(&self, balls: &Balls) -> Vec4 {
        let (r, z) = (balls.radius, balls.depth);
        let before = z - r - self.near;
        let wide = r * self.ratio;
        let size = match self.size {
            SizeMetric::Exact => {
                let (squared, rr, zz) = (balls.distance_squared(), r * r, z * z);
                let (wide, depths) = (wide * wide, zz - rr);
                let slope = zz * depths * 4.4 + wide * squared * 2.1;
                let bound = (depths * depths - wide * (squared - rr)) * z / slope;
                let most = (z - r) * 0.0625;
                // At threshold 0 this is no number: never small.
                bound.max(-most).min(most)
            }
            SizeMetric::Center => z - wide,
            SizeMetric::Nearest => z - r - wide,
            SizeMetric::Angle => {
                balls.distance_squared().sqrt() - r * (1.0 + self.ratio_squared).sqrt()
            }
            SizeMetric::Area => Vec4::ZERO,
        };
        // `min` would pass over what is no number.
        let least = Vec4::select(size.cmpge(before), before, size);
        sane(Vec4::select(
            before.cmpgt(Vec4::ZERO),
            least.abs(),
            before.abs(),
        ))
    }

    /// Bounds for [`Tester::volume`], in the tester's unit: of changes of distances from its six planes.
    #[inline]
    pub(super) fn volume_slack(&self, balls: &Balls) -> Vec4 {
        let (nearest, edge) = (
            self.nearest_plane(balls),
            balls.radius + Vec4::splat(self.plane_error),
        );
        sane((nearest + edge).abs().min((nearest - edge).abs()))
    }

    /// Bounds for [`Tester::cones`], in the tester's unit: of ways of the eye. `faces_viewer`: lanes of which it matters
    /// whether all faces the viewer.
    ///
    /// With unit axis a, half angle α and radius R all faces away if h = a·v cos α - |v - (a·v) a| sin α - R >= 0, and all
    /// faces the viewer if that holds with -a. Both have a gradient of length 1 in v. The test itself lies within
    /// 2e-3 D of that on the safe side, most where the axis goes by the eye, and so may h here; 3e-3 D are taken away, and
    /// a hundredth of h for the D of later views.
    #[inline]
    pub(super) fn cones_slack(&self, balls: &Balls, words: &Words, faces_viewer: u8) -> Vec4 {
        let ([x, y, z], packed_sin) = (Self::cone_axes(words.axis()), words.sine());
        let sin = packed_sin * (1.0 / 65535.0);
        let cos = (1.0 - sin * sin).max(Vec4::ZERO).sqrt();
        let [vx, vy, vz] = balls.center;
        let along = (x * vx + y * vy + z * vz) / (x * x + y * y + z * z).sqrt();
        let squared = balls.distance_squared();
        let across = (squared - along * along).max(Vec4::ZERO).sqrt();
        let edge = across * sin + balls.radius;
        let (away, front) = ((along * cos - edge).abs(), (along * cos + edge).abs());
        let bound = away.min(of_lanes(front, faces_viewer)) * 0.99 - squared.sqrt() * 3e-3;
        let decides = packed_sin.cmplt(Vec4::splat(f32::from(crate::tree::Cone::NEVER)));
        Vec4::select(decides, sane(bound), FOREVER)
    }

    /// Bounds for the sides of four triangles ([`Tester::leaf_faces_away`]), in the tester's unit: of ways of the eye. That is
    /// its distance from their planes; less the error of single precision, which is 6.6e-7 |e₁| |e₂| |w| of n·w and as much
    /// of n, |w| aside. 0 for what single precision cannot tell.
    #[inline]
    pub(super) fn sides_slack(&self, corners: &[[Vec4; 3]; 3]) -> Vec4 {
        let [a, b, c] = corners;
        let edge = |to: &[Vec4; 3]| [0, 1, 2].map(|i| (to[i] - a[i]) * self.unit);
        let squared = |v: [Vec4; 3]| v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        let (e, g) = (edge(b), edge(c));
        let eye = self.reference.to_array();
        let w = [0, 1, 2].map(|i| (Vec4::splat(eye[i]) - a[i]) * self.unit);
        let normal = [
            e[1] * g[2] - e[2] * g[1],
            e[2] * g[0] - e[0] * g[2],
            e[0] * g[1] - e[1] * g[0],
        ];
        let along = normal[0] * w[0] + normal[1] * w[1] + normal[2] * w[2];
        let area = (squared(e) * squared(g)).sqrt();
        let error = area * squared(w).sqrt() * 1e-6;
        sane((along.abs() - error) / (squared(normal).sqrt() + area * 1e-6))
    }

    /// Bounds for [`Tester::may_be_rows`] and which lanes may be rows, in the tester's unit: of changes of z.
    #[inline]
    pub(super) fn may_be_rows_slack(&self, balls: &Balls, words: &Words, most: Vec4) -> (Vec4, u8) {
        let in_balls = balls.radius * self.ratio;
        let (half, width) = relative_sizes(words.strip());
        let thin = balls.depth - width * in_balls / MAX_WIDTH;
        let short = balls.depth - half * in_balls / most;
        let least = Vec4::select(thin.cmpge(short), short, thin);
        let is_strip = width.cmplt(Vec4::ONE);
        let may = (is_strip & least.cmpge(Vec4::ZERO)).bitmask() as u8;
        (Vec4::select(is_strip, sane(least.abs()), FOREVER), may)
    }

    /// Bounds for [`Tester::rows`] of nodes that may be rows, in the tester's unit: of changes of z and D. `rows`: lanes of
    /// those that are.
    ///
    /// With Z = z - H, S = D + H, u = K Z⁴ and t = ω² S² the count is the next whole number n from s on, s² = H² S² / (u - t). Where
    /// Z and S change by m <= Z / 64, no more than (u - t) Z / 26 u, u - t changes by a quarter of it at most, for Z <= S; so ln s
    /// changes by at most 1.5 (1 + (2 u + t) / (u - t)) m / Z. It must not change by more than ln (n / s) >= (n - s) / n or ln (s / (n - 1)) >=
    /// (s - n + 1) / n; a row of two is one whatever its s below. What is too long for a row stays so until ln s has changed by
    /// ln (s / n) >= (s - n) / s, n the most. The width decides by t <= 0.95² u, whose difference changes by
    /// less than 6 · 1.1 m / Z times the larger of the two, and the near plane by Z (1 - κ) - near. Errors of s are below 1e-4 of it.
    #[inline]
    pub(super) fn rows_slack(&self, balls: &Balls, words: &Words, most: Vec4, rows: u8) -> Vec4 {
        if self.size == SizeMetric::Nearest {
            return Vec4::ZERO;
        }
        let (half, width) = relative_sizes(words.strip());
        let (half, width) = (half * balls.radius, width * balls.radius);
        let nearest = balls.depth - half;
        let kappa = self.threshold_px / self.twice_focal_px;
        let low = kappa * (1.0 - kappa * kappa).max(0.0);
        let far = balls.distance_squared().sqrt() + half;
        let squared = nearest * nearest;
        let u = squared * squared * (low * low * LOW);
        let t = width * width * far * far;
        let rest = u - t;
        let s = half * far / rest.sqrt();
        let n = s.ceil().max(Vec4::splat(2.0));
        let below = Vec4::select(
            n.cmpgt(Vec4::splat(2.5)),
            s - n + 1.0,
            Vec4::splat(MAX_COUNT as f32),
        );
        let is_row = of_lanes(Vec4::ZERO, rows).cmpeq(Vec4::ZERO);
        let within = (n - s).min(below) / n;
        let beyond = (s - most.min(Vec4::splat(MAX_COUNT as f32))) / s;
        let ways =
            (Vec4::select(is_row, within, beyond) - 1e-4) / (1.5 + 1.5 * (2.0 * u + t) / rest);
        let width = (u * (MAX_WIDTH * MAX_WIDTH) - t) / (6.6 * u.max(t));
        // What is too wide is no row whatever its length.
        let length = sane(ways).min(sane(rest / (26.0 * u)));
        let bound = Vec4::select(width.cmpge(Vec4::ZERO), length.min(width), sane(-width));
        let before = nearest * (1.0 - kappa) - self.near;
        sane(bound.min(Vec4::splat(1.0 / 64.0)) * nearest).min(sane(before))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::abi::Vertex;
    use crate::cut::{Settings, siblings};
    use crate::math::camera::Camera;
    use crate::tree::{Cone, Model, Node, Strip};
    use glam::{DVec3, Vec3};

    /// In -1..1.
    fn random(state: &mut u64) -> f32 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    fn four_nodes(state: &mut u64) -> [Node; 4] {
        [0.004, 0.004, 0.03, 0.03].map(|radius| {
            let mut at = || Vec3::new(random(state), random(state), random(state));
            let (center, other) = (at(), at());
            let bytes = [0, 1, 2].map(|i| (other[i] * 127.0) as i8);
            Node {
                center,
                // Sizes from a pixel to some tens, in the view below.
                radius: radius * (1.0 + random(state)) + 0.0005,
                first_child: 0,
                cone: Cone {
                    axis: [0, 1].map(|i| (other[i] * 32767.0) as i16),
                    sin_half_angle: ((1.0 + other.z) * 20_000.0) as u16,
                },
                strip: Strip {
                    direction: [bytes[0], bytes[1]],
                    half_length: 100u8.wrapping_add_signed(bytes[2]),
                    width: (6.0 + 6.0 * random(state)) as u8,
                },
                child_count: 4,
                flags: 0,
            }
        })
    }

    /// What has moved by less than a bound, and the errors of two views, is answered as before; and what has moved
    /// by three times a bound is often answered otherwise, so the bounds are of use.
    #[test]
    fn answers_hold_as_far_as_bounds_say() {
        let mut state = 5u64;
        let model = Model::default();
        // Of small, volume, away, front, rows, sides: held; changed although they were held; changed beyond.
        let mut counts = [[0u32; 3]; 6];
        for round in 0..60_000 {
            let nodes = four_nodes(&mut state);
            let mut step = |scale: f32| {
                DVec3::new(
                    f64::from(random(&mut state) * scale),
                    f64::from(random(&mut state) * scale),
                    f64::from(random(&mut state) * scale),
                )
            };
            let eye = DVec3::new(0.0, 0.5, 3.0) + step(0.5);
            let scale = [0.001, 0.01, 0.1][round % 3];
            let (to_eye, to_target) = (eye + step(scale), step(scale));
            let settings = Settings {
                threshold_px: 3.0,
                size: [
                    SizeMetric::Exact,
                    SizeMetric::Exact,
                    SizeMetric::Center,
                    SizeMetric::Nearest,
                    SizeMetric::Angle,
                ][round / 3 % 5],
                ..Settings::default()
            };
            let tester = |eye: DVec3, target: DVec3| {
                let camera = Camera::look_at((400, 300), eye, target, DVec3::Y, 0.6, (0.1, 20.0));
                let view = camera.view(DVec3::ZERO).expect("a usable camera");
                Tester::new(&model, &view, &settings)
            };
            let (before, after) = (tester(eye, DVec3::ZERO), tester(to_eye, to_target));
            let (spheres, [_, axis, sine, shape]) = siblings::of_nodes(&nodes);
            let words = Words { axis, sine, shape };
            let (from, to) = (before.balls(spheres), after.balls(spheres));
            let (a, b) = (from.depth / before.unit, to.depth / after.unit);
            let distance = |balls: &Balls, t: &Tester| balls.distance_squared().sqrt() / t.unit;
            let place = (a - b)
                .abs()
                .max((distance(&from, &before) - distance(&to, &after)).abs());
            // All six planes are asked for one by one, in effect.
            let planes = [before.forward_plane()]
                .into_iter()
                .chain(before.side_planes());
            let others = [after.forward_plane()]
                .into_iter()
                .chain(after.side_planes());
            let volume = planes.zip(others).fold(place, |most, (p, q)| {
                let at = |p: [f32; 4], balls: &Balls, unit: f32| {
                    let [x, y, z] = balls.center;
                    (x * p[0] + y * p[1] + z * p[2] + p[3]) / unit
                };
                most.max((at(p, &from, before.unit) - at(q, &to, after.unit)).abs())
            });
            let way = Vec4::splat((to_eye - eye).length() as f32);
            let most = Vec4::splat(16.0);
            let rows = |t: &Tester, balls: &Balls| {
                let (count, fits) = t.rows(balls, &words, most);
                let fits = fits & t.may_be_rows(balls, &words, most);
                let is_row = |i: usize| fits >> i & 1 != 0;
                [0, 1, 2, 3].map(|i| if is_row(i) { count[i] } else { 0.0 })
            };
            let (rows_before, rows_after) = (rows(&before, &from), rows(&after, &to));
            let are_rows = (0..4).fold(0, |mask, i| mask | u8::from(rows_before[i] > 0.0) << i);
            let (row_bounds, may) = before.may_be_rows_slack(&from, &words, most);
            let row_bounds = row_bounds.min(of_lanes(
                before.rows_slack(&from, &words, most, are_rows),
                may | are_rows,
            ));
            let corners = {
                let vertices: Vec<Vertex> = (0..12)
                    .map(|_| Vertex {
                        position: Vec3::new(
                            random(&mut state),
                            random(&mut state),
                            random(&mut state),
                        ),
                        normal: [0; 2],
                        color: [255; 4],
                    })
                    .collect();
                Tester::corners(&vertices, [[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]])
            };
            let cones = |t: &Tester, balls: &Balls| t.cones(balls, words.axis(), words.sine());
            let sides = |t: &Tester| t.triangles_face_away(&corners);
            let differs = |a: u32, b: u32| [0, 1, 2, 3].map(|i| (a ^ b) >> i & 1 != 0);
            let unsure = sides(&before).1 | sides(&after).1;
            let cases = [
                (
                    before.small_slack(&from),
                    place,
                    differs(before.small(&from), after.small(&to)),
                ),
                (
                    before.volume_slack(&from),
                    volume,
                    [0, 1, 2, 3].map(|i| {
                        let (out, inside) = (before.volume(&from), after.volume(&to));
                        (out.0 ^ inside.0 | out.1 ^ inside.1) >> i & 1 != 0
                    }),
                ),
                (
                    before.cones_slack(&from, &words, 0),
                    way,
                    differs(cones(&before, &from).0, cones(&after, &to).0),
                ),
                (
                    before.cones_slack(&from, &words, 15),
                    way,
                    differs(cones(&before, &from).1, cones(&after, &to).1),
                ),
                (
                    row_bounds,
                    place,
                    [0, 1, 2, 3].map(|i| rows_before[i] != rows_after[i]),
                ),
                (
                    before.sides_slack(&corners),
                    way,
                    differs(sides(&before).0 | unsure, sides(&after).0 | unsure),
                ),
            ];
            let error = 2.0 * SLACK_ERROR * before.plane_error.max(after.plane_error);
            for ((bounds, moved, differs), counts) in cases.into_iter().zip(&mut counts) {
                for (lane, differs) in differs.into_iter().enumerate() {
                    let bound = (bounds[lane] - error) / before.unit;
                    if moved[lane] <= bound {
                        counts[0] += 1;
                        counts[1] += u32::from(differs);
                    } else if moved[lane] <= 6.0 * bound {
                        counts[2] += u32::from(differs);
                    }
                }
            }
        }
        println!("{counts:?}");
        for [held, wrong, beyond] in counts {
            assert!(held > 50_000 && wrong == 0 && beyond > 100, "{counts:?}");
        }
    }
}
