//! Exposures brought together: a factor of each photograph and channel from what photographs show in common.
//!
//! After Brown and Lowe, *Automatic Panoramic Image Stitching using Invariant Features* (2007), section 6, with logarithms:
//! minimize, over the logarithms g of the gains, the sum over pairs of n_ij (g_i - g_j - r_ij)² + s g_i², where r_ij is the
//! median of log(color in j / color in i) of the n_ij common places. The median does not mind what moved or shines. Factors
//! are of encoded values: a power of linear light is a factor of these too.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Common places of two photographs below which they say nothing of each other.
const FEWEST_COMMON: usize = 20;

/// Most places of a pair that are looked at.
const MOST_COMMON: usize = 4000;

/// Weight of a gain of 1, in places: keeps photographs without neighbors as they are.
const PRIOR: f64 = 1.0;

/// Keeps the part of a photograph in its own pose finite, and far above that of all others together.
const LEAST_APART: f64 = 1e-3;

/// Rounds of Gauss-Seidel, at most.
const ROUNDS: usize = 500;

/// Change of every logarithm in a round below which there is no other: a thousandth of a level.
const SMALLEST_MOVE: f64 = 4e-6;

/// Largest factor either way.
const LARGEST: f64 = 4.0;

/// Values (of 1) between which a color is neither dark nor clipped.
const USABLE: [f32; 2] = [0.03, 0.97];

/// The gains of photographs whose colors at the same places are `colors[photo][place]`; `None` where a photograph does not
/// show the place. Their geometric mean is 1, and 1 is the gain of a photograph that shares too little.
pub fn exposure_gains<C: AsRef<[Option<Vec3>]> + Sync>(colors: &[C]) -> Vec<Vec3> {
    let count = colors.len();
    let mut gains = vec![Vec3::ONE; count];
    for channel in 0..3 {
        // Of each pair i < j: the median of log ratios, and how many.
        let of_first = |i: usize| -> Vec<PairRatio> {
            let of_pair = |j: usize| {
                let (ratio, weight) =
                    median_ratio([colors[i].as_ref(), colors[j].as_ref()], channel)?;
                Some(PairRatio {
                    photos: [i, j],
                    ratio,
                    weight,
                })
            };
            (i + 1..count).filter_map(of_pair).collect()
        };
        let pairs: Vec<Vec<PairRatio>> = (0..count).into_par_iter().map(of_first).collect();
        let pairs = pairs.concat();
        let logs = solve(count, &pairs);
        for (gain, log) in gains.iter_mut().zip(logs) {
            gain[channel] = log.exp().clamp(1.0 / LARGEST, LARGEST) as f32;
        }
    }
    gains
}

/// Part that a photograph of this worth at a place has in the exposure of a view: by the square of the angle to the nearest
/// ray, as worth falls. With the angle alone, far photographs count so much that the exposure steps where one of them comes
/// or goes; with higher powers it goes over within a few frames.
pub(crate) fn exposure_part(worth: f32) -> f64 {
    match worth > 0.0 {
        true => 1.0 / ((1.0 / f64::from(worth) - 1.0).max(0.0) + LEAST_APART),
        false => 0.0,
    }
}

/// Gain that brings photographs to the exposure of a view: the mean of their gains, each by its part ([`exposure_part`]) added
/// up over places of the view; 1 where none has a part. Places that are shown from nearby count most, so that a photograph's
/// own pose has its own exposure, and what is between two photographs has one between theirs.
pub(crate) fn gain_of_view(photos: impl Iterator<Item = (Vec3, f64)>) -> Vec3 {
    let (mut logs, mut parts) = (DVec3::ZERO, 0.0);
    for (gain, part) in photos {
        logs += gain.as_dvec3().map(f64::ln) * part;
        parts += part;
    }
    match parts > 0.0 {
        true => (logs / parts).map(f64::exp).as_vec3(),
        false => Vec3::ONE,
    }
}

/// Median of log(second / first) and the number of places.
fn median_ratio(pair: [&[Option<Vec3>]; 2], channel: usize) -> Option<(f64, f64)> {
    let usable = |v: f32| v > USABLE[0] && v < USABLE[1];
    let mut ratios: Vec<f64> = (pair[0].iter().zip(pair[1]))
        .filter_map(|(a, b)| {
            let (a, b) = (a.as_ref()?[channel], b.as_ref()?[channel]);
            (usable(a) && usable(b)).then(|| f64::from(b / a).ln())
        })
        .take(MOST_COMMON)
        .collect();
    if ratios.len() < FEWEST_COMMON {
        return None;
    }
    let middle = ratios.len() / 2;
    let (_, median, _) = ratios.select_nth_unstable_by(middle, f64::total_cmp);
    Some((*median, ratios.len() as f64))
}

/// Ratio of the colors of two photographs.
#[derive(Clone, Copy)]
struct PairRatio {
    photos: [usize; 2],
    /// Median of log(second / first).
    ratio: f64,
    /// Number of common places.
    weight: f64,
}

/// Logarithms of the gains, with mean 0.
fn solve(count: usize, pairs: &[PairRatio]) -> Vec<f64> {
    let mut logs = vec![0.0; count];
    // Of each photograph the others, what its logarithm is above theirs, and how many places say so: g_i - g_j = ratio brings
    // both to one value.
    let mut others: Vec<Vec<(usize, f64, f64)>> = vec![Vec::new(); count];
    for pair in pairs {
        let [i, j] = pair.photos;
        others[i].push((j, pair.ratio, pair.weight));
        others[j].push((i, -pair.ratio, pair.weight));
    }
    for _ in 0..ROUNDS {
        let mut moved = 0.0_f64;
        for photo in 0..count {
            let (mut sum, mut weights) = (0.0, PRIOR);
            for (other, ratio, weight) in &others[photo] {
                sum += weight * (logs[*other] + ratio);
                weights += weight;
            }
            moved = moved.max((sum / weights - logs[photo]).abs());
            logs[photo] = sum / weights;
        }
        if moved < SMALLEST_MOVE {
            break;
        }
    }
    let is_tied = |photo: usize| pairs.iter().any(|pair| pair.photos.contains(&photo));
    let tied: Vec<usize> = (0..count).filter(|photo| is_tied(*photo)).collect();
    let mean = tied.iter().map(|i| logs[*i]).sum::<f64>() / tied.len().max(1) as f64;
    tied.iter().for_each(|i| logs[*i] -= mean);
    logs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposures_are_found_from_overlaps_despite_outliers() {
        let truth = [
            Vec3::new(1.2, 1.1, 1.0),
            Vec3::new(0.8, 0.9, 1.0),
            Vec3::new(1.0, 1.0, 1.1),
        ];
        let colors: Vec<Vec<Option<Vec3>>> = (0..3_usize)
            .map(|photo| {
                (0..600_usize)
                    .map(|place| {
                        // Photographs 0 and 2 share nothing; a tenth of the places shows something else.
                        let is_seen = match photo {
                            0 => place < 400,
                            1 => true,
                            _ => place >= 420,
                        };
                        let base = 0.2 + 0.4 * ((place * 37) % 100) as f32 / 100.0;
                        let other = if (place + photo) % 10 == 0 { 0.5 } else { 1.0 };
                        is_seen.then_some(Vec3::splat(base * other) / truth[photo])
                    })
                    .collect()
            })
            .collect();
        let gains = exposure_gains(&colors);
        for channel in 0..3 {
            let mean: f32 = truth
                .iter()
                .map(|t| t[channel])
                .product::<f32>()
                .powf(1.0 / 3.0);
            for (gain, t) in gains.iter().zip(truth) {
                let wanted = t[channel] / mean;
                assert!(
                    (gain[channel] / wanted - 1.0).abs() < 0.02,
                    "{gains:?} {wanted}"
                );
            }
        }
    }

    #[test]
    fn exposure_goes_over_between_two_poses_and_far_ones_count_little() {
        // Rays from the way between two poses, 0.2 apart, and five others a radian away: worth by half the square of the angle.
        let worth = |angle: f64| (1e-4 / (1e-4 + 0.5 * angle * angle)) as f32;
        let share = |at: f64| {
            let [first, second] = [at, 0.2 - at].map(|angle| exposure_part(worth(angle)));
            let far = 5.0 * exposure_part(worth(1.0));
            [first, second, far].map(|part| part / (first + second + far))
        };
        assert!(share(0.0)[0] > 0.999 && share(0.2)[1] > 0.999);
        for step in 0..20 {
            let [before, after] = [step, step + 1].map(|step| share(0.01 * f64::from(step)));
            assert!(before[2] < 0.05, "{before:?}");
            // A twentieth of the way changes it by at most a tenth.
            assert!((after[1] - before[1]).abs() <= 0.11, "{before:?} {after:?}");
        }
        assert_eq!(exposure_part(0.0), 0.0);
        assert!(exposure_part(1e-6) < 1e-5);
    }

    #[test]
    fn a_pose_has_its_own_exposure_though_others_show_its_borders() {
        // The own photograph's ray is that of the view at nine places of ten, and it fades at the tenth.
        let own = 9.0 * exposure_part(1.0) + exposure_part(0.1);
        let other = 9.0 * exposure_part(0.05) + exposure_part(0.5);
        let gains = [1.5, 0.8].map(Vec3::splat);
        let found = gain_of_view(gains.into_iter().zip([own, other]));
        assert!((found - gains[0]).abs().max_element() < 1e-3, "{found}");
        // Between two photographs that are as near it is between theirs.
        let between = gain_of_view(gains.into_iter().zip([own, own]));
        assert!((between.x - 1.2f32.sqrt()).abs() < 1e-6, "{between}");
        assert_eq!(gain_of_view(std::iter::once((gains[0], 0.0))), Vec3::ONE);
    }

    #[test]
    fn a_photograph_that_shares_nothing_keeps_its_colors() {
        let dark = vec![Some(Vec3::splat(0.2)); 50];
        let light = vec![Some(Vec3::splat(0.4)); 50];
        let gains = exposure_gains(&[dark, light, vec![None; 50]]);
        assert_eq!(gains[2], Vec3::ONE);
        assert!((gains[0].x / gains[1].x - 2.0).abs() < 0.05, "{gains:?}");
        assert!(exposure_gains::<&[_]>(&[]).is_empty());
        // Clipped places say nothing.
        let clipped = vec![Some(Vec3::ONE); 50];
        assert_eq!(exposure_gains(&[clipped.clone(), clipped]), [Vec3::ONE; 2]);
    }
}
