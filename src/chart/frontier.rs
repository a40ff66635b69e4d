//! The choices that no other beats.

/// Indices of the points (time, error) that no other point dominates: none is at most as large in both and smaller in
/// one. Ascending in time, so descending in error; of equal points all or none. Points that are not finite are on no
/// frontier and beat nothing. O(n log n).
pub fn frontier(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len())
        .filter(|&i| points[i].iter().all(|v| v.is_finite()))
        .collect();
    order.sort_by(|&a, &b| {
        let [a_time, a_error] = points[a];
        let [b_time, b_error] = points[b];
        // Zeros of both signs are equal.
        a_time
            .partial_cmp(&b_time)
            .unwrap_or(std::cmp::Ordering::Equal)
            .then(
                a_error
                    .partial_cmp(&b_error)
                    .unwrap_or(std::cmp::Ordering::Equal),
            )
            .then(a.cmp(&b))
    });
    let mut kept: Vec<usize> = Vec::new();
    for i in order {
        let is_kept = kept
            .last()
            .is_none_or(|&last| points[i][1] < points[last][1] || points[i] == points[last]);
        if is_kept {
            kept.push(i);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The definition, over all pairs.
    fn brute_force(points: &[[f64; 2]]) -> Vec<usize> {
        let finite = |p: &[f64; 2]| p.iter().all(|v| v.is_finite());
        let beats = |a: &[f64; 2], b: &[f64; 2]| {
            finite(a) && a[0] <= b[0] && a[1] <= b[1] && (a[0] < b[0] || a[1] < b[1])
        };
        (0..points.len())
            .filter(|&i| finite(&points[i]) && !points.iter().any(|p| beats(p, &points[i])))
            .collect()
    }

    /// Few different values, so that ties are frequent; now and then none at all.
    fn value() -> impl Strategy<Value = f64> {
        prop_oneof![
            8 => (0..12i32).prop_map(f64::from),
            4 => 0.0..12.0,
            1 => prop_oneof![
                Just(f64::NAN),
                Just(f64::INFINITY),
                Just(f64::NEG_INFINITY),
                Just(-0.0)
            ],
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

        #[test]
        fn it_is_what_the_definition_says(
            points in prop::collection::vec([value(), value()], 0..40)
        ) {
            let mut found = frontier(&points);
            for pair in found.windows(2) {
                let ([t0, e0], [t1, e1]) = (points[pair[0]], points[pair[1]]);
                prop_assert!(t0 <= t1 && e0 >= e1);
            }
            found.sort_unstable();
            prop_assert_eq!(found, brute_force(&points));
        }
    }
}
