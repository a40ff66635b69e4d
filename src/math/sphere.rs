//! Smallest balls: around a triangle, and around up to four balls.
//!
//! Sources: Benda, *Point Based Rendering* (diploma thesis), section 3.2.2 for the triangle's circle. His bound of
//! three and four balls is not minimal (up to 1.8 times too large); here the exact minimum enclosing ball is found
//! by enumeration of its support, after Fischer and Gärtner, "The smallest enclosing ball of balls:
//! combinatorial structure and algorithms" (2004). Welzl's move-to-front method is not valid for balls.

use glam::DVec3;

/// A ball in double precision.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sphere {
    /// Center.
    pub center: DVec3,
    /// Radius, at least 0.
    pub radius: f64,
}

/// How far beyond its radius a candidate ball may have a member and still count as enclosing, relative. The center is
/// then off the optimum by about as much; callers take the radius anew from the rounded center.
const TOLERANCE: f64 = 1e-10;

/// A Gram determinant below this share of the product of its diagonal counts as singular.
const SINGULAR: f64 = 1e-12;

/// The smallest single-precision number that is at least `x` (not NaN). Larger than the largest finite one: infinity.
#[inline]
pub fn round_up(x: f64) -> f32 {
    let nearest = x as f32;
    // The next number has the next bits, or of negative ones those before. Without a branch, so that loops of it are vectors.
    let next = if nearest < 0.0 { u32::MAX } else { 1 };
    let step = if f64::from(nearest) < x { next } else { 0 };
    f32::from_bits(nearest.to_bits().wrapping_add(step))
}

/// Center of the smallest ball around a triangle: the midpoint of the longest side where the angle opposite to it is
/// not acute, otherwise the circumcenter. Duplicate and collinear corners take the first case.
#[inline]
pub fn triangle_center(v: [DVec3; 3]) -> DVec3 {
    let (e1, e2, e3) = (v[1] - v[0], v[2] - v[0], v[2] - v[1]);
    let (l1, l2, l3) = (
        e1.length_squared(),
        e2.length_squared(),
        e3.length_squared(),
    );
    let longest = l1.max(l2).max(l3);
    // The circumcenter divides by twice |e1 x e2|^2; never before both tests.
    let cross = e1.cross(e2).length_squared();
    let is_acute = l1 + l2 + l3 - longest > longest * (1.0 + 1e-12);
    if is_acute && cross > 1e-24 * longest * longest {
        let dot = e1.dot(e2);
        let scale = 0.5 / cross;
        v[0] + e1 * (l2 * (l1 - dot) * scale) + e2 * (l1 * (l2 - dot) * scale)
    } else if l1 == longest {
        (v[0] + v[1]) * 0.5
    } else if l2 == longest {
        (v[0] + v[2]) * 0.5
    } else {
        (v[1] + v[2]) * 0.5
    }
}

/// The smallest ball around a triangle; it contains the corners up to rounding in the last place.
pub fn of_triangle(v: [DVec3; 3]) -> Sphere {
    let center = triangle_center(v);
    let radius = v
        .iter()
        .map(|&p| center.distance_squared(p))
        .fold(0.0, f64::max);
    Sphere {
        center,
        radius: radius.sqrt(),
    }
}

/// The smallest ball around two balls (the larger one where it contains the other).
#[inline]
pub fn of_two(a: Sphere, b: Sphere) -> Sphere {
    let offset = b.center - a.center;
    let distance = offset.length();
    // Containment first: it also catches equal centers.
    if distance + b.radius <= a.radius {
        a
    } else if distance + a.radius <= b.radius {
        b
    } else {
        let radius = 0.5 * (distance + a.radius + b.radius);
        Sphere {
            center: a.center + offset * ((radius - a.radius) / distance),
            radius,
        }
    }
}

/// A ball around all of `balls`: the smallest one, to 1e-9 of its radius, for up to four; for more a bound by merging
/// one after the other. No balls give the zero ball.
///
/// Contains every member up to rounding in the last places (relative 1e-15): the radius is taken from the final center.
pub fn enclosing(balls: &[Sphere]) -> Sphere {
    let center = match *balls {
        [] => return Sphere::default(),
        [one] => return one,
        [a, b] => of_two(a, b).center,
        [a, b, c] => center_of_three([a, b, c]),
        [a, b, c, d] => center_of_four([a, b, c, d]),
        _ => {
            balls
                .iter()
                .copied()
                .reduce(of_two)
                .unwrap_or_default()
                .center
        }
    };
    Sphere {
        center,
        radius: radius_around(center, balls),
    }
}

/// Radius of the smallest ball around `center` that contains all of `balls`.
#[inline]
pub fn radius_around(center: DVec3, balls: &[Sphere]) -> f64 {
    balls
        .iter()
        .map(|ball| center.distance(ball.center) + ball.radius)
        .fold(0.0, f64::max)
}

/// Tells whether `ball` contains `member`, within [`TOLERANCE`].
#[inline]
fn contains(ball: &Sphere, member: &Sphere) -> bool {
    // Squared, so that no root is taken: |c - m| <= R (1 + t) - r.
    let room = ball.radius * (1.0 + TOLERANCE) - member.radius;
    room >= 0.0 && ball.center.distance_squared(member.center) <= room * room
}

fn center_of_three(balls: [Sphere; 3]) -> DVec3 {
    let extents = [
        extent(&balls[0], &balls[1]),
        extent(&balls[0], &balls[2]),
        extent(&balls[1], &balls[2]),
    ];
    // If the ball of a pair is the answer, it is that of the pair with the largest extent: any other pair's ball is
    // too small for this one. If a single ball contains all, it is a member of such a pair.
    let (i, j, k) = if extents[0] >= extents[1] && extents[0] >= extents[2] {
        (0, 1, 2)
    } else if extents[1] >= extents[2] {
        (0, 2, 1)
    } else {
        (1, 2, 0)
    };
    let pair = of_two(balls[i], balls[j]);
    if contains(&pair, &balls[k]) {
        return pair.center;
    }
    if let Some(ball) = tangent_to_three([&balls[i], &balls[j], &balls[k]]) {
        return ball.center;
    }
    of_two(pair, balls[k]).center
}

fn center_of_four(balls: [Sphere; 4]) -> DVec3 {
    const PAIRS: [[usize; 4]; 6] = [
        [0, 1, 2, 3],
        [0, 2, 1, 3],
        [0, 3, 1, 2],
        [1, 2, 0, 3],
        [1, 3, 0, 2],
        [2, 3, 0, 1],
    ];
    let extents = PAIRS.map(|[i, j, ..]| extent(&balls[i], &balls[j]));
    let mut widest = 0;
    for pair in 1..6 {
        if extents[pair] > extents[widest] {
            widest = pair;
        }
    }
    let [i, j, k, l] = PAIRS[widest];
    let pair = of_two(balls[i], balls[j]);
    let excess = |m: usize| pair.center.distance(balls[m].center) + balls[m].radius;
    let (excess_k, excess_l) = (excess(k), excess(l));
    // f: the member that sticks out farthest; g: the other one.
    let (f, g) = if excess_k >= excess_l { (k, l) } else { (l, k) };
    if excess_k.max(excess_l) <= pair.radius * (1.0 + TOLERANCE) {
        return pair.center;
    }
    // The minimal ball of a subset that contains all balls is the minimal ball of all. The widest pair does not
    // contain f, so the minimal ball of these three is tangent to all of them.
    let mut best = pair;
    if let Some(ball) = tangent_to_three([&balls[i], &balls[j], &balls[f]]) {
        if contains(&ball, &balls[g]) {
            return ball.center;
        }
        best = ball;
    }
    // g sticks out of that ball, so it is in the support.
    for (a, b, rest) in [(i, j, f), (i, f, j), (j, f, i)] {
        if pair_contains_third([&balls[a], &balls[b], &balls[g]]) {
            continue;
        }
        if let Some(ball) = tangent_to_three([&balls[a], &balls[b], &balls[g]])
            && contains(&ball, &balls[rest])
        {
            return ball.center;
        }
    }
    if let Some(ball) = tangent_to_four([&balls[i], &balls[j], &balls[f], &balls[g]])
        && balls.iter().all(|member| contains(&ball, member))
    {
        return ball.center;
    }
    // Only rounding leads here (nearly coplanar centers): merging still contains.
    [balls[f], balls[g]].into_iter().fold(best, of_two).center
}

/// Diameter of the smallest ball around two balls that do not contain each other.
#[inline]
fn extent(a: &Sphere, b: &Sphere) -> f64 {
    a.center.distance(b.center) + a.radius + b.radius
}

/// Tells whether the smallest ball of two of the three contains the third.
fn pair_contains_third([a, b, c]: [&Sphere; 3]) -> bool {
    let (ab, ac, bc) = (extent(a, b), extent(a, c), extent(b, c));
    if ab >= ac && ab >= bc {
        contains(&of_two(*a, *b), c)
    } else if ac >= bc {
        contains(&of_two(*a, *c), b)
    } else {
        contains(&of_two(*b, *c), a)
    }
}

/// Smallest radius rho >= `least` with |a + rho b| = rho - r0, from |a|^2, a.b, |b|^2.
#[inline]
fn solve_radius(aa: f64, ab: f64, bb: f64, r0: f64, least: f64) -> Option<f64> {
    // (|b|^2 - 1) rho^2 + 2 (a.b + r0) rho + |a|^2 - r0^2 = 0
    let (quadratic, half, constant) = (bb - 1.0, ab + r0, aa - r0 * r0);
    let floor = least * (1.0 - 1e-12);
    if quadratic.abs() < 1e-14 {
        let root = -constant / (2.0 * half);
        return (root >= floor && root.is_finite()).then_some(root);
    }
    let discriminant = half * half - quadratic * constant;
    if discriminant < 0.0 {
        return None;
    }
    // Both roots without cancellation.
    let sum = -(half + discriminant.sqrt().copysign(half));
    let (one, two) = (sum / quadratic, constant / sum);
    let (low, high) = if one < two { (one, two) } else { (two, one) };
    if low >= floor && low.is_finite() {
        Some(low)
    } else {
        (high >= floor && high.is_finite()).then_some(high)
    }
}

/// The ball with its center in the plane of three centers that touches the three balls from around.
fn tangent_to_three([b0, b1, b2]: [&Sphere; 3]) -> Option<Sphere> {
    let (d1, d2) = (b1.center - b0.center, b2.center - b0.center);
    let (g11, g12, g22) = (d1.length_squared(), d1.dot(d2), d2.length_squared());
    let determinant = g11 * g22 - g12 * g12;
    if determinant <= SINGULAR * g11 * g22 {
        return None;
    }
    let inverse = 1.0 / determinant;
    let r0 = b0.radius;
    let p = [
        0.5 * (g11 + r0 * r0 - b1.radius * b1.radius),
        0.5 * (g22 + r0 * r0 - b2.radius * b2.radius),
    ];
    let q = [b1.radius - r0, b2.radius - r0];
    let solve = |v: [f64; 2]| {
        [
            (v[0] * g22 - v[1] * g12) * inverse,
            (v[1] * g11 - v[0] * g12) * inverse,
        ]
    };
    let (x, y) = (solve(p), solve(q));
    // With G y = q: |b|^2 = y.q, a.b = y.p, |a|^2 = x.p.
    let dot = |u: [f64; 2], v: [f64; 2]| u[0] * v[0] + u[1] * v[1];
    let least = r0.max(b1.radius).max(b2.radius);
    let radius = solve_radius(dot(x, p), dot(y, p), dot(y, q), r0, least)?;
    Some(Sphere {
        center: b0.center + d1 * (x[0] + radius * y[0]) + d2 * (x[1] + radius * y[1]),
        radius,
    })
}

/// The ball that touches four balls from around.
fn tangent_to_four([b0, b1, b2, b3]: [&Sphere; 4]) -> Option<Sphere> {
    let d = [b1, b2, b3].map(|ball| ball.center - b0.center);
    // Rows of the inverse of [d1 d2 d3]^T: x with d_i . x = v_i is the sum of v_i times these over the determinant.
    let rows = [d[1].cross(d[2]), d[2].cross(d[0]), d[0].cross(d[1])];
    let determinant = d[0].dot(rows[0]);
    let scale = d[0].length_squared() * d[1].length_squared() * d[2].length_squared();
    if determinant * determinant <= SINGULAR * scale {
        return None;
    }
    let inverse = 1.0 / determinant;
    let r0 = b0.radius;
    let (mut a, mut b) = (DVec3::ZERO, DVec3::ZERO);
    for (index, ball) in [b1, b2, b3].into_iter().enumerate() {
        let p = 0.5 * (d[index].length_squared() + r0 * r0 - ball.radius * ball.radius);
        a += rows[index] * (p * inverse);
        b += rows[index] * ((ball.radius - r0) * inverse);
    }
    let least = r0.max(b1.radius).max(b2.radius).max(b3.radius);
    let radius = solve_radius(a.length_squared(), a.dot(b), b.length_squared(), r0, least)?;
    Some(Sphere {
        center: b0.center + a + b * radius,
        radius,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    /// A small generator, so that the tests need no crate and repeat exactly.
    struct SeededRandom(u64);

    impl SeededRandom {
        fn unit(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
        }

        fn vector(&mut self) -> DVec3 {
            DVec3::new(self.unit() - 0.5, self.unit() - 0.5, self.unit() - 0.5)
        }
    }

    /// Minimum over centers of the radius needed, a convex function: subgradient steps of shrinking length.
    fn brute_force(balls: &[Sphere]) -> f64 {
        let mut center = balls.iter().map(|b| b.center).sum::<DVec3>() / balls.len() as f64;
        let mut step = 1.0;
        let mut best = radius_around(center, balls);
        while step > 1e-13 {
            let mut improved = false;
            for direction in 0..26 {
                let code = if direction < 13 {
                    direction
                } else {
                    direction + 1
                };
                let offset = DVec3::new(
                    f64::from(code % 3 - 1),
                    f64::from(code / 3 % 3 - 1),
                    f64::from(code / 9 - 1),
                );
                let radius = radius_around(center + offset * step, balls);
                if radius < best {
                    best = radius;
                    center += offset * step;
                    improved = true;
                    break;
                }
            }
            // A toward-the-farthest step escapes the ridges on which the fixed directions stall.
            let farthest = balls
                .iter()
                .max_by(|a, b| {
                    let reach = |s: &Sphere| center.distance(s.center) + s.radius;
                    reach(a).total_cmp(&reach(b))
                })
                .unwrap();
            let toward = center + (farthest.center - center).normalize_or_zero() * step;
            let radius = radius_around(toward, balls);
            if radius < best {
                best = radius;
                center = toward;
                improved = true;
            }
            if !improved {
                step *= 0.7;
            }
        }
        best
    }

    #[test]
    fn tetrahedron_of_unit_spheres() {
        // Edge a: radius 1 + a sqrt(6) / 4.
        let balls = [
            DVec3::new(1.0, 1.0, 1.0),
            DVec3::new(1.0, -1.0, -1.0),
            DVec3::new(-1.0, 1.0, -1.0),
            DVec3::new(-1.0, -1.0, 1.0),
        ]
        .map(|center| Sphere {
            center,
            radius: 1.0,
        });
        let ball = enclosing(&balls);
        let edge = 8f64.sqrt();
        assert!((ball.radius - (1.0 + edge * 6f64.sqrt() / 4.0)).abs() < 1e-12);
        assert!(ball.center.length() < 1e-12);
    }

    #[test]
    fn random_balls_match_a_search_over_centers() {
        let mut random = SeededRandom(7);
        for case in 0..3000 {
            let count = 2 + case % 3;
            let spread = [0.0, 0.05, 1.0][case / 3 % 3];
            let flat = case % 5 == 0;
            let balls: Vec<Sphere> = (0..count)
                .map(|_| {
                    let mut center = random.vector();
                    if flat {
                        center.z = 0.0;
                    }
                    Sphere {
                        center,
                        radius: spread * random.unit(),
                    }
                })
                .collect();
            let ball = enclosing(&balls);
            for member in &balls {
                let reach = ball.center.distance(member.center) + member.radius;
                assert!(reach <= ball.radius * (1.0 + 1e-14), "case {case}");
            }
            let searched = brute_force(&balls);
            // The search ends on ridges: it may be above the minimum by a little, never below.
            assert!(
                ball.radius <= searched * (1.0 + 1e-9),
                "case {case}: {} above a found ball of {searched}",
                ball.radius
            );
        }
    }

    #[test]
    fn nested_equal_and_collinear_balls() {
        let at = |x: f64, radius: f64| Sphere {
            center: DVec3::new(x, 0.0, 0.0),
            radius,
        };
        let big = at(0.0, 5.0);
        assert_eq!(
            enclosing(&[at(1.0, 1.0), big, at(-2.0, 0.5), at(2.0, 3.0)]),
            big
        );
        assert_eq!(enclosing(&[big; 4]), big);
        assert_eq!(enclosing(&[at(3.0, 0.0); 3]), at(3.0, 0.0));
        let row = enclosing(&[at(0.0, 1.0), at(2.0, 1.0), at(9.0, 1.0), at(4.0, 1.0)]);
        assert!((row.radius - 5.5).abs() < 1e-12 && (row.center.x - 4.5).abs() < 1e-12);
        assert_eq!(enclosing(&[]), Sphere::default());
    }

    #[test]
    fn ball_is_no_larger_than_bendas() {
        // Three centers' circle plus the largest radius: a bound, not a minimum.
        let mut random = SeededRandom(3);
        for _ in 0..2000 {
            let balls = [(); 3].map(|()| Sphere {
                center: random.vector(),
                radius: random.unit() * 0.5,
            });
            let circle = of_triangle(balls.map(|b| b.center));
            let largest = balls.iter().map(|b| b.radius).fold(0.0, f64::max);
            assert!(enclosing(&balls).radius <= (circle.radius + largest) * (1.0 + 1e-12));
        }
    }

    #[test]
    fn triangle_spheres() {
        let right = of_triangle([DVec3::ZERO, DVec3::X, DVec3::Y]);
        assert!((right.radius - 0.5f64.sqrt()).abs() < 1e-12);
        let equilateral =
            of_triangle([DVec3::ZERO, DVec3::X, DVec3::new(0.5, 0.75f64.sqrt(), 0.0)]);
        assert!((equilateral.radius - 1.0 / 3f64.sqrt()).abs() < 1e-12);
        let obtuse = of_triangle([DVec3::ZERO, DVec3::X * 4.0, DVec3::new(1.0, 0.1, 0.0)]);
        assert_eq!((obtuse.center, obtuse.radius), (DVec3::X * 2.0, 2.0));
        let point = of_triangle([DVec3::ONE; 3]);
        assert_eq!((point.center, point.radius), (DVec3::ONE, 0.0));
        let segment = of_triangle([DVec3::ZERO, DVec3::ZERO, DVec3::Z * 2.0]);
        assert_eq!((segment.center, segment.radius), (DVec3::Z, 1.0));
        let mut random = SeededRandom(1);
        for _ in 0..10_000 {
            let v = [random.vector(), random.vector(), random.vector() * 0.01];
            let ball = of_triangle(v);
            let longest = v[0]
                .distance(v[1])
                .max(v[1].distance(v[2]))
                .max(v[2].distance(v[0]));
            assert!(ball.radius <= longest / 3f64.sqrt() * (1.0 + 1e-12));
            let best = enclosing(&v.map(|center| Sphere {
                center,
                radius: 0.0,
            }));
            assert!((ball.radius - best.radius).abs() < 1e-8 * longest);
        }
    }

    #[test]
    fn rounding_is_upward() {
        for x in [0.0, 1.0, 0.1, 1.0 + 1e-12, 3.3e38, 1e-45, 1e-50] {
            assert!(f64::from(round_up(x)) >= x);
            assert!(x == 0.0 || f64::from(round_up(x).next_down()) < x);
        }
        assert_eq!(round_up(1e39), f32::INFINITY);
    }
}
