//! Distortion of a lens: from the ray of a point to the place where the photograph has it, and back.
//!
//! A ray is (x, y) = (X / Z, Y / Z) of a point in camera space; the distorted (x', y') times the focal length, plus the
//! principal point, is the pixel. Models and the order of their coefficients are those of OpenCV:
//!
//! * Brown: x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) + 2 p1 x y + p2 (r² + 2 x²), likewise y'
//! * rational: the radial factor is (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)
//! * fisheye: r' = t (1 + k1 t² + k2 t⁴ + k3 t⁶ + k4 t⁸), t = atan r
//! * measured radial (VisualSFM): r = r' (1 + k1 r'²), so the distortion is on the side of the measurement

/// Formula of a lens.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum LensModel {
    /// None: a pinhole.
    #[default]
    Pinhole = 0,
    /// Polynomial, with tangential terms: k1 k2 p1 p2 k3 k4.
    Brown = 1,
    /// Quotient of polynomials, with tangential terms: k1 k2 p1 p2 k3 k4 k5 k6.
    Rational = 2,
    /// Equidistant, with a polynomial of the angle: k1 k2 k3 k4.
    Fisheye = 3,
    /// Polynomial of the measured radius: k1.
    MeasuredRadial = 4,
}

impl LensModel {
    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pinhole => "none",
            Self::Brown => "Brown",
            Self::Rational => "rational",
            Self::Fisheye => "fisheye",
            Self::MeasuredRadial => "radial on the measured side",
        }
    }
}

/// Lens of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraLens {
    /// The formula.
    pub model: LensModel,
    /// Coefficients of the formula; what it does not have is 0.
    pub coefficients: [f64; 8],
    /// Largest radius (tangent of the angle from the axis) up to which the formula grows. Beyond it the formula would fold
    /// far points back into the photograph, so nothing there is seen.
    pub largest_radius: f64,
}

impl Default for CameraLens {
    fn default() -> Self {
        Self::new(LensModel::Pinhole, &[])
    }
}

/// Radius at which every lens ends: 87 degrees.
const WIDEST: f64 = 20.0;

impl CameraLens {
    /// A lens with the first coefficients given, the others 0. Coefficients that are all 0 make a pinhole, except of a
    /// fisheye.
    pub fn new(model: LensModel, coefficients: &[f64]) -> Self {
        let mut all = [0.0; 8];
        for (value, given) in all.iter_mut().zip(coefficients) {
            *value = *given;
        }
        let model = match model {
            LensModel::Fisheye => model,
            _ if all == [0.0; 8] => LensModel::Pinhole,
            _ => model,
        };
        let mut lens = Self {
            model,
            coefficients: all,
            largest_radius: WIDEST,
        };
        lens.largest_radius = lens.end_of_growth();
        lens
    }

    /// The radius at which the distorted radius stops growing, at most [`WIDEST`].
    fn end_of_growth(&self) -> f64 {
        if self.model == LensModel::Pinhole {
            return WIDEST;
        }
        let steps = 8000;
        let (mut last, mut at) = (0.0, 0.0);
        for i in 1..=steps {
            let r = WIDEST * f64::from(i) / f64::from(steps);
            let grown = r * self.radial_factor(r * r);
            if !(grown > last && grown.is_finite()) {
                return at;
            }
            (last, at) = (grown, r);
        }
        WIDEST
    }

    /// Distorted radius over radius, without tangential terms.
    fn radial_factor(&self, r2: f64) -> f64 {
        let [k1, k2, _, _, k3, k4, k5, k6] = self.coefficients;
        match self.model {
            LensModel::Pinhole => 1.0,
            LensModel::Brown => 1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4))),
            LensModel::Rational => {
                (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
            }
            LensModel::Fisheye => {
                let r = r2.sqrt();
                let t = r.atan();
                let [k1, k2, k3, k4, ..] = self.coefficients;
                let t2 = t * t;
                let bent = t * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))));
                if r > 1e-9 { bent / r } else { 1.0 }
            }
            LensModel::MeasuredRadial => measured_factor(k1, r2),
        }
    }

    /// The distorted ray; `None` beyond the largest radius.
    pub fn distort(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        if self.model == LensModel::Pinhole {
            return Some([x, y]);
        }
        let r2 = x * x + y * y;
        if r2.is_nan() || r2 > self.largest_radius * self.largest_radius {
            return None;
        }
        let factor = self.radial_factor(r2);
        let (p1, p2) = match self.model {
            LensModel::Brown | LensModel::Rational => (self.coefficients[2], self.coefficients[3]),
            _ => (0.0, 0.0),
        };
        Some([
            x * factor + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * factor + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y),
        ])
    }

    /// The ray that [`distort`](Self::distort) takes to a place, found by Newton's method; `None` where there is none.
    pub fn undistort(&self, [u, v]: [f64; 2]) -> Option<[f64; 2]> {
        if self.model == LensModel::Pinhole {
            return Some([u, v]);
        }
        let wanted = u.hypot(v);
        // The radius by bisection first, since the formula grows up to the largest radius.
        let (mut low, mut high) = (0.0, self.largest_radius);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if middle * self.radial_factor(middle * middle) < wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        let scale = if wanted > 1e-12 { high / wanted } else { 1.0 };
        let [mut x, mut y] = [u * scale, v * scale];
        // Tangential terms are small: what is missing is added.
        for _ in 0..20 {
            let [a, b] = self.distort([x, y])?;
            (x, y) = (x + u - a, y + v - b);
        }
        let [a, b] = self.distort([x, y])?;
        ((a - u).abs() < 1e-6 && (b - v).abs() < 1e-6).then_some([x, y])
    }
}

/// Solves r = r' (1 + k r'²) for r' / r by Newton's method.
fn measured_factor(k: f64, r2: f64) -> f64 {
    let mut s = 1.0;
    for _ in 0..8 {
        let value = s + k * r2 * s * s * s - 1.0;
        let slope = 1.0 + 3.0 * k * r2 * s * s;
        if slope <= 1e-6 {
            return f64::NAN;
        }
        s -= value / slope;
    }
    s
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lenses() -> Vec<CameraLens> {
        vec![
            CameraLens::default(),
            CameraLens::new(LensModel::Brown, &[-0.16, 0.03, 1e-3, -2e-3, 0.004]),
            CameraLens::new(
                LensModel::Rational,
                &[0.1, 0.02, 1e-3, 5e-4, 0.01, 0.2, 0.01, 0.001],
            ),
            CameraLens::new(LensModel::Fisheye, &[-0.03, 0.01, 0.002, -0.001]),
            CameraLens::new(LensModel::MeasuredRadial, &[0.17]),
        ]
    }

    #[test]
    fn undistortion_is_the_inverse() {
        for lens in lenses() {
            for i in 0..100 {
                let ray = [
                    f64::from(i % 10) * 0.1 - 0.45,
                    f64::from(i / 10) * 0.1 - 0.45,
                ];
                let bent = lens.distort(ray).unwrap();
                let back = lens.undistort(bent).unwrap();
                let error = (back[0] - ray[0]).hypot(back[1] - ray[1]);
                assert!(error < 1e-7, "{lens:?} {ray:?} {error}");
            }
        }
    }

    #[test]
    fn measured_distortion_is_a_cubic_of_the_measured_radius() {
        let lens = CameraLens::new(LensModel::MeasuredRadial, &[0.17]);
        // r' = 0.5: r = 0.5 (1 + 0.17 * 0.25) = 0.52125.
        let [x, y] = lens.distort([0.52125, 0.0]).unwrap();
        assert!((x - 0.5).abs() < 1e-12 && y == 0.0, "{x}");
        // With the distortion on the other side it would be 0.545.
        let other = CameraLens::new(LensModel::Brown, &[0.17]);
        assert!((other.distort([0.52125, 0.0]).unwrap()[0] - 0.5).abs() > 0.03);
    }

    #[test]
    fn a_polynomial_that_turns_back_sees_nothing_beyond() {
        // r (1 - r²/3) turns at r = 1; far points would land in the middle again.
        let lens = CameraLens::new(LensModel::Brown, &[-1.0 / 3.0]);
        assert!(
            (lens.largest_radius - 1.0).abs() < 0.01,
            "{}",
            lens.largest_radius
        );
        assert!(lens.distort([0.9, 0.0]).is_some());
        assert_eq!(lens.distort([1.7, 0.0]), None);
        assert_eq!(
            CameraLens::new(LensModel::Brown, &[0.0, 0.0]).model,
            LensModel::Pinhole
        );
    }
}
