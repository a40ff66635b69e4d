//! A sphere in its parent's, in 13 bits.
//!
//! The parent has radius 1 around zero. A child of size s, of 13 sizes, is a cube of s cells of a grid of 13 by 13 by 13
//! cells on [-1, 1]³: its radius is s/13, its center that of the cube. Cubes whose sphere would lie wholly apart from
//! the parent are left out; 7,621 remain, numbered in the order of s, x, y and z.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use std::sync::LazyLock;

/// Number of radii, and of grid cells along the parent's diameter.
pub const LEVELS: usize = 13;

/// Number of codes.
pub const SPHERE_CODES: usize = 7621;

/// A sphere in single precision, as it is decoded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PageSphere {
    /// Center, in the coordinates of its page.
    pub center: Vec3,
    /// Radius, at least 0.
    pub radius: f32,
}

impl PageSphere {
    /// Tells whether this contains a ball, but for roundings of double precision.
    #[inline]
    pub fn contains(&self, center: DVec3, radius: f64) -> bool {
        self.center.as_dvec3().distance(center) + radius
            <= f64::from(self.radius) * (1.0 + 1e-12) + f64::MIN_POSITIVE
    }
}

/// No code.
const NONE: u16 = u16::MAX;

struct SphereTables {
    /// Center and radius by code.
    decoded: Vec<PageSphere>,
    /// Code by s - 1, x, y, z.
    codes: Vec<u16>,
}

static TABLES: LazyLock<SphereTables> = LazyLock::new(|| {
    let mut tables = SphereTables {
        decoded: Vec::with_capacity(SPHERE_CODES),
        codes: vec![NONE; LEVELS * LEVELS * LEVELS * LEVELS],
    };
    for size in 1..=LEVELS {
        let radius = size as f64 / LEVELS as f64;
        let most = 1.0 + 3f64.sqrt() * radius;
        let ends = LEVELS + 1 - size;
        for cell in 0..ends * ends * ends {
            let cells = [cell / (ends * ends), cell / ends % ends, cell % ends];
            let offset = DVec3::from_array(cells.map(|k| place(size, k)));
            // Nothing lies within a rounding of the limit: squares of whole numbers over 169 beside a multiple of √3.
            if offset.length_squared() <= most * most {
                tables.codes[index(size, cells)] = tables.decoded.len() as u16;
                tables.decoded.push(PageSphere {
                    center: offset.as_vec3(),
                    radius: radius as f32,
                });
            }
        }
    }
    tables
});

/// Middle of `size` cells from cell `first` on.
fn place(size: usize, first: usize) -> f64 {
    (size + 2 * first) as f64 / LEVELS as f64 - 1.0
}

fn index(size: usize, [x, y, z]: [usize; 3]) -> usize {
    (((size - 1) * LEVELS + x) * LEVELS + y) * LEVELS + z
}

/// Table of [`SPHERE_CODES`] spheres in a parent of radius 1 around zero.
#[inline]
fn table() -> &'static [PageSphere] {
    &TABLES.decoded
}

/// The child's sphere. Codes that are none decode as the last, which is the parent itself.
#[inline]
pub fn decode_sphere(parent: &PageSphere, code: u16) -> PageSphere {
    let table = table();
    let own = table[usize::from(code).min(SPHERE_CODES - 1)];
    PageSphere {
        center: parent.center + own.center * parent.radius,
        radius: parent.radius * own.radius,
    }
}

/// The code with the smallest radius whose decoded sphere contains a ball; the last one, which decodes to the parent, where
/// no smaller one does. So the decoded sphere contains the ball wherever the (decoded) parent does, and it is never larger
/// than the parent. It may stick out of the parent.
pub fn encode_sphere(parent: &PageSphere, center: DVec3, radius: f64) -> u16 {
    let last = SPHERE_CODES as u16 - 1;
    let scale = f64::from(parent.radius);
    if !(scale > 0.0 && scale.is_finite()) {
        return last;
    }
    let offset = ((center - parent.center.as_dvec3()) / scale).to_array();
    // No smaller one can.
    let least = ((radius / scale * LEVELS as f64) as usize).max(1);
    for size in least..LEVELS {
        let cells = offset.map(|c| {
            let first = 0.5 * (LEVELS as f64 * (c + 1.0) - size as f64);
            (first.round().max(0.0) as usize).min(LEVELS - size)
        });
        let code = TABLES.codes[index(size, cells)];
        if code != NONE && decode_sphere(parent, code).contains(center, radius) {
            return code;
        }
    }
    last
}

#[cfg(test)]
mod tests {
    use super::super::random::TestNumbers;
    use super::*;

    #[test]
    fn codes_are_those_of_the_paper() {
        assert_eq!(table().len(), SPHERE_CODES);
        let mut counts = [0; LEVELS];
        for sphere in table() {
            counts[(sphere.radius * 13.0).round() as usize - 1] += 1;
        }
        let expected = [
            1617, 1648, 1331, 1000, 729, 512, 343, 216, 125, 64, 27, 8, 1,
        ];
        assert_eq!(counts, expected);
        let last = table()[SPHERE_CODES - 1];
        assert_eq!((last.center, last.radius), (Vec3::ZERO, 1.0));
        // Even sizes have their middles on half steps.
        assert!(table().iter().all(|s| s.center.abs().max_element() < 1.0));
    }

    #[test]
    fn every_decoded_sphere_is_coded_by_itself() {
        let parent = PageSphere {
            center: Vec3::new(3.0, -2.0, 0.5),
            radius: 0.7,
        };
        for code in 0..SPHERE_CODES as u16 {
            let own = decode_sphere(&parent, code);
            let again = encode_sphere(&parent, own.center.as_dvec3(), f64::from(own.radius));
            assert_eq!(again, code);
            // A ball a little smaller has the same code or one of a smaller radius.
            let inner = encode_sphere(
                &parent,
                own.center.as_dvec3(),
                f64::from(own.radius) * 0.999,
            );
            assert!(inner <= code);
        }
    }

    /// Children as in the measurement of the design: radii of a quarter to three quarters, anywhere inside.
    #[test]
    fn errors_are_those_measured() {
        let mut numbers = TestNumbers(11);
        let parent = PageSphere {
            center: Vec3::new(-5.0, 2.0, 9.0),
            radius: 2.5,
        };
        let scale = f64::from(parent.radius);
        const COUNT: usize = 50_000;
        let (mut axis, mut wider, mut ratio) = (0.0, 0.0, 0.0);
        for _ in 0..COUNT {
            let radius = 0.25 + 0.5 * numbers.unit();
            let offset = numbers.in_ball() * (1.0 - radius);
            let center = parent.center.as_dvec3() + offset * scale;
            let own = decode_sphere(&parent, encode_sphere(&parent, center, radius * scale));
            // Q1 and Q3.
            assert!(own.contains(center, radius * scale));
            assert!(own.radius <= parent.radius);
            let off = (own.center.as_dvec3() - center).abs() / scale;
            axis += (off.x + off.y + off.z) / 3.0;
            wider += f64::from(own.radius) / scale - radius;
            ratio += f64::from(own.radius) / scale / radius;
        }
        let mean = |sum: f64| sum / COUNT as f64;
        let (axis, wider, ratio) = (mean(axis), mean(wider), mean(ratio));
        assert!((axis - 0.033).abs() < 0.004, "{axis}");
        assert!((wider - 0.112).abs() < 0.012, "{wider}");
        // Of radii evenly spread; children of one size have more or less.
        assert!((ratio - 1.246).abs() < 0.01, "{ratio}");
    }

    #[test]
    fn bounds_hold_from_the_root_down() {
        // A random tree, each child coded in its decoded parent: Q1, Q2 (a point of a ball is in all its decoded
        // ancestors) and Q3 at every node.
        let mut numbers = TestNumbers(77);
        for _ in 0..400 {
            let true_root = (numbers.in_ball() * 100.0, 1.0 + numbers.unit() * 50.0);
            let root = PageSphere {
                center: true_root.0.as_vec3(),
                radius: (true_root.1 * 1.000_01 + 1e-5) as f32,
            };
            assert!(root.contains(true_root.0, true_root.1));
            let (mut real, mut decoded) = (true_root, root);
            let mut ancestors = vec![root];
            for _ in 0..9 {
                let radius = real.1 * (0.02 + 0.97 * numbers.unit());
                let center = real.0 + numbers.in_ball() * (real.1 - radius);
                let own = decode_sphere(&decoded, encode_sphere(&decoded, center, radius));
                assert!(own.contains(center, radius));
                assert!(own.radius <= decoded.radius);
                (real, decoded) = ((center, radius), own);
                ancestors.push(own);
                for _ in 0..3 {
                    let point = center + numbers.in_ball() * radius;
                    assert!(ancestors.iter().all(|ball| ball.contains(point, 0.0)));
                }
            }
        }
    }

    #[test]
    fn what_is_degenerate_decodes_to_the_parent() {
        let last = SPHERE_CODES as u16 - 1;
        let point = PageSphere {
            center: Vec3::ONE,
            radius: 0.0,
        };
        assert_eq!(encode_sphere(&point, DVec3::ONE, 0.0), last);
        assert_eq!(decode_sphere(&point, last), point);
        let unit = PageSphere {
            center: Vec3::ZERO,
            radius: 1.0,
        };
        assert_eq!(encode_sphere(&unit, DVec3::ZERO, 1.0), last);
        assert_eq!(encode_sphere(&unit, DVec3::NAN, 1.0), last);
        assert_eq!(encode_sphere(&unit, DVec3::ZERO, f64::NAN), last);
        assert_eq!(decode_sphere(&unit, u16::MAX), unit);
        // A point in the middle is in the smallest cell there.
        let code = encode_sphere(&unit, DVec3::ZERO, 0.0);
        assert_eq!(decode_sphere(&unit, code).radius, (1.0f64 / 13.0) as f32);
    }
}
