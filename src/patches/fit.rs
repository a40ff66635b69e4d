//! Least squares over corners: the shading normal with a symmetric shape operator, and colors with a gradient.

use glam::{DVec2, DVec3, Vec2, Vec3};

/// A little of the spread is added where it has no extent across, so that needles do not extrapolate.
const RIDGE: f64 = 1e-4;

/// Ridge for values that are linear over each triangle, as texture coordinates are: only what rounding leaves of needles has no
/// extent.
const LEAST_RIDGE: f64 = 1e-9;

/// A corner as the fit sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct FitCorner {
    /// Foot in the plane, from the origin of the record.
    pub(super) at: Vec2,
    /// Unit shading normal in the frame (u, v, normal).
    pub(super) normal: Vec3,
    /// Value / 255.
    pub(super) color: Vec3,
    /// A third of the triangle's area, or any share of it that is the same for all.
    pub(super) weight: f32,
}

/// What [`of_normals`] finds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NormalFit {
    pub(super) mean_normal: Vec3,
    pub(super) shape: [f32; 3],
}

impl NormalFit {
    /// As [`super::record::NodePatch::fitted_normal`], as a unit vector.
    pub(super) fn unit_at(&self, at: Vec2) -> Vec3 {
        let [uu, uv, vv] = self.shape;
        let turned = Vec3::new(uu * at.x + uv * at.y, uv * at.x + vv * at.y, 0.0);
        (self.mean_normal + turned).normalize_or(Vec3::Z)
    }
}

/// Weighted means and spreads of places.
#[derive(Debug, Clone, Copy, Default)]
struct PlaceSums {
    weight: f64,
    mean: DVec2,
    /// Covariances uu, uv, vv, with a ridge.
    spread: [f64; 3],
}

impl PlaceSums {
    fn of(corners: &[FitCorner], ridge: f64) -> Self {
        let (mut weight, mut sum) = (0.0, DVec2::ZERO);
        for corner in corners {
            let w = f64::from(corner.weight);
            weight += w;
            sum += corner.at.as_dvec2() * w;
        }
        if weight <= 0.0 {
            return Self::default();
        }
        let mean = sum / weight;
        let mut spread = [0.0; 3];
        for corner in corners {
            let (w, d) = (f64::from(corner.weight), corner.at.as_dvec2() - mean);
            spread[0] += w * d.x * d.x;
            spread[1] += w * d.x * d.y;
            spread[2] += w * d.y * d.y;
        }
        let mut spread = spread.map(|sum| sum / weight);
        let ridge = ridge * (spread[0] + spread[2]);
        spread[0] += ridge;
        spread[2] += ridge;
        Self {
            weight,
            mean,
            spread,
        }
    }

    fn is_spread(&self) -> bool {
        self.spread[0] + self.spread[2] > f64::MIN_POSITIVE
    }

    /// The mean of a value, and its covariances with u and v.
    fn of_value(&self, corners: &[FitCorner], value: impl Fn(&FitCorner) -> f64) -> (f64, DVec2) {
        let sum: f64 = corners.iter().map(|c| f64::from(c.weight) * value(c)).sum();
        let mean = sum / self.weight;
        let mut with = DVec2::ZERO;
        for corner in corners {
            let offset = corner.at.as_dvec2() - self.mean;
            with += offset * (f64::from(corner.weight) * (value(corner) - mean));
        }
        (mean, with / self.weight)
    }
}

/// The fit of the shading normals; `None` without area.
///
/// The in-plane part is a + S (u, v) with S symmetric; its three numbers minimize the weighted squares and solve
/// S11 Cuu + S12 Cuv = Duu, S11 Cuv + S12 (Cuu + Cvv) + S22 Cuv = Duv + Dvu, S12 Cuv + S22 Cvv = Dvv, with C the covariances of
/// places and D those of normals with places.
pub(super) fn of_normals(corners: &[FitCorner]) -> Option<NormalFit> {
    let places = PlaceSums::of(corners, RIDGE);
    if places.weight <= 0.0 {
        return None;
    }
    let [(u, du), (v, dv), (n, _)] =
        [0, 1, 2].map(|axis| places.of_value(corners, |corner| f64::from(corner.normal[axis])));
    let mean = DVec3::new(u, v, n);
    let shape = if places.is_spread() {
        let [cuu, cuv, cvv] = places.spread;
        let matrix = glam::DMat3::from_cols(
            DVec3::new(cuu, cuv, 0.0),
            DVec3::new(cuv, cuu + cvv, cuv),
            DVec3::new(0.0, cuv, cvv),
        );
        let solved = matrix.inverse() * DVec3::new(du.x, du.y + dv.x, dv.y);
        if solved.is_finite() {
            solved
        } else {
            DVec3::ZERO
        }
    } else {
        DVec3::ZERO
    };
    // The mean stands at the mean place; the record wants it in the origin.
    let [uu, uv, vv] = shape.to_array();
    let moved = DVec3::new(
        uu * places.mean.x + uv * places.mean.y,
        uv * places.mean.x + vv * places.mean.y,
        0.0,
    );
    Some(NormalFit {
        mean_normal: (mean - moved).as_vec3(),
        shape: shape.as_vec3().to_array(),
    })
}

/// Color in the origin, gradient along u and v, and the root mean square of what is left, of the worst channel.
pub(super) fn of_colors(corners: &[FitCorner]) -> (Vec3, [Vec3; 2], f32) {
    let places = PlaceSums::of(corners, RIDGE);
    if places.weight <= 0.0 {
        return (Vec3::ONE, [Vec3::ZERO; 2], 0.0);
    }
    let (color, gradient) = linear(corners, &places);
    let mut squares = DVec3::ZERO;
    for corner in corners {
        let at = color + gradient[0] * corner.at.x + gradient[1] * corner.at.y;
        let off = (corner.color - at.clamp(Vec3::ZERO, Vec3::ONE)).as_dvec3();
        squares += off * off * f64::from(corner.weight);
    }
    let residual = (squares / places.weight).max_element().sqrt() as f32;
    (color, gradient, residual)
}

/// Values that are linear on each triangle, in the place of colors: in the origin, and their change along u and v. `None`
/// without area.
pub(super) fn of_linear(corners: &[FitCorner]) -> Option<(Vec3, [Vec3; 2])> {
    let places = PlaceSums::of(corners, LEAST_RIDGE);
    (places.weight > 0.0).then(|| linear(corners, &places))
}

/// The least squares of colors: in the origin, and their change along u and v.
fn linear(corners: &[FitCorner], places: &PlaceSums) -> (Vec3, [Vec3; 2]) {
    let [cuu, cuv, cvv] = places.spread;
    let determinant = cuu * cvv - cuv * cuv;
    let mut color = Vec3::ZERO;
    let mut gradient = [Vec3::ZERO; 2];
    for channel in 0..3 {
        let (mean, with) = places.of_value(corners, |corner| f64::from(corner.color[channel]));
        let slope = if places.is_spread() && determinant > 0.0 {
            DVec2::new(cvv * with.x - cuv * with.y, cuu * with.y - cuv * with.x) / determinant
        } else {
            DVec2::ZERO
        };
        color[channel] = (mean - slope.dot(places.mean)) as f32;
        gradient[0][channel] = slope.x as f32;
        gradient[1][channel] = slope.y as f32;
    }
    (color, gradient)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn grid(normal: impl Fn(Vec2) -> Vec3, color: impl Fn(Vec2) -> Vec3) -> Vec<FitCorner> {
        (0..49)
            .map(|i| {
                let at = Vec2::new((i % 7) as f32 * 0.1 - 0.2, (i / 7) as f32 * 0.05 + 0.1);
                FitCorner {
                    at,
                    normal: normal(at),
                    color: color(at),
                    weight: 1.0 + (i % 3) as f32,
                }
            })
            .collect()
    }

    #[test]
    fn a_linear_field_comes_back() {
        let expected = NormalFit {
            mean_normal: Vec3::new(0.1, -0.2, 0.9),
            shape: [0.5, -0.25, 1.5],
        };
        let [uu, uv, vv] = expected.shape;
        let corners = grid(
            |at| {
                expected.mean_normal + Vec3::new(uu * at.x + uv * at.y, uv * at.x + vv * at.y, 0.0)
            },
            |at| Vec3::new(0.5 + at.x, 0.25 - 0.5 * at.y, 0.5),
        );
        let fit = of_normals(&corners).unwrap();
        assert!((fit.mean_normal - expected.mean_normal).length() < 1e-3);
        for (found, shape) in fit.shape.into_iter().zip(expected.shape) {
            assert!((found - shape).abs() < 2e-3, "{fit:?}");
        }
        let (color, gradient, residual) = of_colors(&corners);
        assert!((color - Vec3::new(0.5, 0.25, 0.5)).length() < 1e-3);
        assert!((gradient[0] - Vec3::X).length() < 1e-3);
        assert!((gradient[1] + Vec3::Y * 0.5).length() < 1e-3);
        assert!(residual < 1e-3);
    }

    #[test]
    fn a_needle_does_not_extrapolate_and_no_area_has_no_fit() {
        let mut corners = grid(|_| Vec3::Z, |_| Vec3::ONE);
        for corner in &mut corners {
            corner.normal = Vec3::new(corner.at.y * 100.0, 0.0, 1.0).normalize();
            corner.at.y = 0.0;
        }
        let fit = of_normals(&corners).unwrap();
        assert!(fit.shape.iter().all(|s| s.abs() < 100.0), "{fit:?}");
        for corner in &mut corners {
            corner.weight = 0.0;
        }
        assert_eq!(of_normals(&corners), None);
    }
}
