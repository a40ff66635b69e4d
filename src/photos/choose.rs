//! Choice of the photographs of a frame: for its view, and for what those leave uncovered.
//!
//! Princ, sections 2.3.3, 3.4 and 3.5.2, as mended in docs/METHODS.md: photographs are ranked by the angle between the view's
//! direction and theirs; normals of uncovered pixels are clustered by k-means on directions, and each cluster gets the
//! photographs that look against it. Everything is deterministic: ties go to the lower index.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::BinaryHeap;

/// Number of clusters.
pub const CLUSTERS: usize = 4;

/// Rounds of k-means.
const ROUNDS: usize = 5;

/// Clusters of fewer pixels than this part of the picture get no photograph for sure.
const LEAST_PART: f64 = 0.005;

/// Direction of a view for the choice of photographs: from outside of a box the direction from the eye to the middle of the
/// model, so that turning the camera changes nothing; inside, where the camera looks. Between, over a shell of a tenth of
/// the box's diagonal, a blend of both: without it the photographs would change at a step over the border.
pub fn view_direction(eye: Vec3, forward: Vec3, bounds: [Vec3; 2], middle: Vec3) -> Vec3 {
    let [min, max] = bounds;
    let outside = (middle - eye).normalize_or(forward);
    // Distance outside of the box.
    let away = (min - eye).max(eye - max).max(Vec3::ZERO).length();
    let shell = 0.1 * (max - min).length();
    let t = match shell > 0.0 {
        true => (1.0 - away / shell).clamp(0.0, 1.0),
        false => 0.0,
    };
    let inside = t * t * (3.0 - 2.0 * t);
    (outside * (1.0 - inside) + forward * inside).normalize_or(forward)
}

/// Indices of the `count` photographs whose directions are nearest to the view's, best first.
pub fn nearest_directions(view: Vec3, directions: &[Vec3], count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..directions.len()).collect();
    order.sort_by(|a, b| {
        let cos = |i: &usize| view.dot(directions[*i]);
        cos(b).total_cmp(&cos(a)).then(a.cmp(b))
    });
    order.truncate(count);
    order
}

/// Directions of uncovered surface that belong together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalCluster {
    /// Unit mean of the normals.
    pub direction: Vec3,
    /// Pixels.
    pub pixels: usize,
}

/// Clusters of unit normals, at most [`CLUSTERS`] and none empty. Starts from normals far apart; stops when no normal moves.
/// A cluster whose normals cancel (their mean is shorter than one half) is split if there is room. Zero vectors are left out.
pub fn cluster_normals(normals: &[Vec3]) -> Vec<NormalCluster> {
    let normals: Vec<Vec3> = normals
        .iter()
        .copied()
        .filter(|n| n.length_squared() > 0.25)
        .collect();
    let mut centers = farthest_apart(&normals, CLUSTERS);
    let mut assigned = vec![usize::MAX; normals.len()];
    let mut sums = vec![(DVec3::ZERO, 0_usize); centers.len()];
    for _ in 0..ROUNDS {
        let moved = assign(&normals, &centers, &mut assigned);
        sums = sums_of(&normals, &assigned, centers.len());
        if !moved {
            break;
        }
        for (center, (sum, count)) in centers.iter_mut().zip(&sums) {
            // An empty or cancelling cluster keeps its center.
            if *count > 0 {
                *center = unit_or(*sum, *center);
            }
        }
    }
    let mut found = Vec::new();
    for (index, (sum, count)) in sums.iter().enumerate() {
        if *count == 0 {
            continue;
        }
        let cluster = NormalCluster {
            direction: unit_or(*sum, centers[index]),
            pixels: *count,
        };
        if sum.length() < 0.5 * *count as f64 {
            let inside: Vec<Vec3> = (normals.iter().zip(&assigned))
                .filter(|(_, a)| **a == index)
                .map(|(n, _)| *n)
                .collect();
            found.extend(halves(&inside, cluster));
        } else {
            found.push(cluster);
        }
    }
    found.sort_by_key(|cluster| std::cmp::Reverse(cluster.pixels));
    found.truncate(CLUSTERS);
    found
}

/// Up to `count` normals, each as far from those before it as there is; the first is the first of all.
fn farthest_apart(normals: &[Vec3], count: usize) -> Vec<Vec3> {
    let Some(first) = normals.first() else {
        return Vec::new();
    };
    let mut centers = vec![*first];
    let mut nearest: Vec<f32> = normals.iter().map(|n| n.dot(*first)).collect();
    while centers.len() < count {
        let mut farthest = 0;
        for i in 1..normals.len() {
            if nearest[i] < nearest[farthest] {
                farthest = i;
            }
        }
        // All are where a center is.
        if nearest[farthest] > 1.0 - 1e-4 {
            break;
        }
        let center = normals[farthest];
        for (near, n) in nearest.iter_mut().zip(normals) {
            *near = near.max(n.dot(center));
        }
        centers.push(center);
    }
    centers
}

/// Assigns each normal to the center with the largest dot product, the first of equal ones; whether any moved.
fn assign(normals: &[Vec3], centers: &[Vec3], assigned: &mut [usize]) -> bool {
    let mut moved = false;
    for (normal, cluster) in normals.iter().zip(assigned) {
        let mut best = 0;
        for i in 1..centers.len() {
            if normal.dot(centers[i]) > normal.dot(centers[best]) {
                best = i;
            }
        }
        moved |= *cluster != best;
        *cluster = best;
    }
    moved
}

/// Sum and number of the normals of each cluster.
fn sums_of(normals: &[Vec3], assigned: &[usize], clusters: usize) -> Vec<(DVec3, usize)> {
    let mut sums = vec![(DVec3::ZERO, 0); clusters];
    for (normal, cluster) in normals.iter().zip(assigned) {
        sums[*cluster].0 += normal.as_dvec3();
        sums[*cluster].1 += 1;
    }
    sums
}

/// The direction of a sum, or another where it has none.
fn unit_or(sum: DVec3, other: Vec3) -> Vec3 {
    sum.try_normalize().map_or(other, |unit| unit.as_vec3())
}

/// A cluster whose normals cancel, as two.
fn halves(normals: &[Vec3], whole: NormalCluster) -> Vec<NormalCluster> {
    let centers = farthest_apart(normals, 2);
    if centers.len() < 2 {
        return vec![whole];
    }
    let mut assigned = vec![usize::MAX; normals.len()];
    assign(normals, &centers, &mut assigned);
    (sums_of(normals, &assigned, 2).into_iter().zip(centers))
        .filter(|((_, pixels), _)| *pixels > 0)
        .map(|((sum, pixels), center)| NormalCluster {
            direction: unit_or(sum, center),
            pixels,
        })
        .collect()
}

/// Photographs for uncovered directions: `count` shared among the clusters in proportion to their pixels (largest remainder,
/// and at least one for each of more than 0.5 % of the picture), for each those that look against its direction most and
/// are neither `taken` nor chosen yet.
pub fn supplementary_photos(
    clusters: &[NormalCluster],
    directions: &[Vec3],
    taken: &[usize],
    count: usize,
    picture_pixels: usize,
) -> Vec<usize> {
    let mut chosen = Vec::new();
    for (cluster, share) in clusters.iter().zip(shares(clusters, count, picture_pixels)) {
        let mut order: Vec<usize> = (0..directions.len()).collect();
        order.sort_by(|a, b| {
            let against = |i: &usize| -cluster.direction.dot(directions[*i]);
            against(b).total_cmp(&against(a)).then(a.cmp(b))
        });
        let mut left = share;
        for photo in order {
            // A photograph that looks along the normals sees the other side.
            let looks_against = cluster.direction.dot(directions[photo]) < 0.0;
            if left == 0 || chosen.len() == count || !looks_against {
                break;
            }
            if !taken.contains(&photo) && !chosen.contains(&photo) {
                chosen.push(photo);
                left -= 1;
            }
        }
    }
    chosen
}

/// `count` shared by pixels, with the largest remainders rounded up.
fn shares(clusters: &[NormalCluster], count: usize, picture_pixels: usize) -> Vec<usize> {
    let all: usize = clusters.iter().map(|cluster| cluster.pixels).sum();
    let exact = |i: usize| count as f64 * clusters[i].pixels as f64 / all.max(1) as f64;
    let mut shares: Vec<usize> = (0..clusters.len()).map(|i| exact(i) as usize).collect();
    let mut order: Vec<usize> = (0..clusters.len()).collect();
    order.sort_by(|a, b| {
        exact(*b)
            .fract()
            .total_cmp(&exact(*a).fract())
            .then(a.cmp(b))
    });
    let left = count - shares.iter().sum::<usize>().min(count);
    order.iter().take(left).for_each(|i| shares[*i] += 1);
    for (share, cluster) in shares.iter_mut().zip(clusters) {
        let is_seen = cluster.pixels as f64 > LEAST_PART * picture_pixels as f64;
        *share = (*share).max(usize::from(is_seen));
    }
    shares
}

/// Photographs that together serve some places of a picture best: `worth[photo][place]` is what a photograph is worth at a
/// place. Greedily, each next one is the one that adds most over the best chosen so far; none that adds nothing. Best first.
pub fn most_worth(worth: &[Vec<f32>], count: usize) -> Vec<usize> {
    let places = worth.first().map_or(0, Vec::len);
    let mut best = vec![0.0_f32; places];
    let mut chosen = Vec::new();
    while chosen.len() < count {
        let mut next = None;
        for (photo, row) in worth.iter().enumerate() {
            if chosen.contains(&photo) {
                continue;
            }
            let added = added_worth(row, 1.0, &best);
            if added > 0.0 && next.is_none_or(|(most, _)| added > most) {
                next = Some((added, photo));
            }
        }
        let Some((_, photo)) = next else { break };
        for (b, w) in best.iter_mut().zip(&worth[photo]) {
            *b = b.max(*w);
        }
        chosen.push(photo);
    }
    chosen
}

/// Photographs that are looked at together where it is not known what they are worth.
const LOOKED_AT: usize = 4;

/// A photograph in the order of what it adds at most.
#[derive(Debug, Clone, Copy, PartialEq)]
struct AddedWorth {
    most: f64,
    photo: usize,
    /// Photographs that were chosen when that was found.
    round: usize,
}

impl Eq for AddedWorth {}

impl Ord for AddedWorth {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let by_worth = self.most.total_cmp(&other.most);
        by_worth.then(other.photo.cmp(&self.photo))
    }
}

impl PartialOrd for AddedWorth {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Sum over all places of what a row, times a factor, adds to the best so far.
fn added_worth(row: &[f32], factor: f32, best: &[f32]) -> f64 {
    let places = row.iter().zip(best);
    let added = places.map(|(w, b)| f64::from((factor * w - b).max(0.0)));
    added.sum()
}

/// Worth of photographs at places, as far as it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct WorthRows {
    /// Worth of each photograph at each place, or the most that it may be.
    pub rows: Vec<Vec<f32>>,
    /// Factor of the worth of each photograph.
    pub factors: Vec<f32>,
    /// Rows are bounds.
    pub are_bounds: bool,
}

/// Finds what [`most_worth`] of rows times factors is, where rows may be bounds and `worth(photo)` gives the row itself, which
/// costs more: few are looked at (Minoux 1978, lazy evaluation). What a photograph adds only falls as others are chosen, so
/// whoever adds most by what is known is looked at first. Rows of all that are chosen are right at the end.
pub fn most_worth_of_bounds(
    known: &mut WorthRows,
    count: usize,
    worth: impl Fn(usize) -> Vec<f32> + Sync,
) -> Vec<usize> {
    let WorthRows { rows, factors, .. } = known;
    let mut best = vec![0.0_f32; rows.first().map_or(0, Vec::len)];
    let mut is_known = vec![!known.are_bounds; rows.len()];
    let entry = |photo: usize, row: &[f32], best: &[f32], round: usize| AddedWorth {
        most: added_worth(row, factors[photo], best),
        photo,
        round,
    };
    let first = rows.iter().enumerate();
    let mut waiting: BinaryHeap<AddedWorth> = first
        .map(|(photo, row)| entry(photo, row, &best, 0))
        .collect();
    let mut chosen = Vec::new();
    while chosen.len() < count {
        let round = chosen.len();
        let Some(next) = waiting.pop().filter(|next| next.most > 0.0) else {
            break;
        };
        if next.round < round {
            waiting.push(entry(next.photo, &rows[next.photo], &best, round));
        } else if is_known[next.photo] {
            for (b, w) in best.iter_mut().zip(&rows[next.photo]) {
                *b = b.max(factors[next.photo] * w);
            }
            chosen.push(next.photo);
        } else {
            let mut asked = vec![next.photo];
            while asked.len() < LOOKED_AT
                && let Some(other) = waiting.peek().filter(|own| !is_known[own.photo])
            {
                asked.push(other.photo);
                waiting.pop();
            }
            let found: Vec<Vec<f32>> = asked.par_iter().map(|photo| worth(*photo)).collect();
            for (photo, row) in asked.into_iter().zip(found) {
                waiting.push(entry(photo, &row, &best, round));
                (rows[photo], is_known[photo]) = (row, true);
            }
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrants_of_constant_normals_are_found_exactly() {
        let normals = [Vec3::X, Vec3::Y, -Vec3::X, Vec3::new(0.0, 0.6, 0.8)];
        let picture: Vec<Vec3> = (0..4096).map(|i| normals[i / 1024]).collect();
        let clusters = cluster_normals(&picture);
        assert_eq!(clusters.len(), 4);
        for normal in normals {
            let found = clusters
                .iter()
                .find(|c| (c.direction - normal).length() < 1e-6)
                .unwrap();
            assert_eq!(found.pixels, 1024);
        }
    }

    #[test]
    fn few_opposite_and_no_normals_leave_no_empty_cluster() {
        assert!(cluster_normals(&[]).is_empty());
        assert!(cluster_normals(&[Vec3::ZERO; 9]).is_empty());
        let one = cluster_normals(&[Vec3::Y; 7]);
        assert_eq!(
            one,
            [NormalCluster {
                direction: Vec3::Y,
                pixels: 7
            }]
        );
        let two: Vec<Vec3> = (0..100)
            .map(|i| if i % 2 == 0 { Vec3::X } else { -Vec3::X })
            .collect();
        let found = cluster_normals(&two);
        assert_eq!(found.len(), 2);
        assert!(
            found
                .iter()
                .all(|c| c.pixels == 50 && c.direction.x.abs() == 1.0)
        );
        // Every normal is in a cluster, also those opposite to all centers.
        let many: Vec<Vec3> = (0..500)
            .map(|i| {
                let a = i as f32 * 2.399_963;
                let z = 1.0 - 2.0 * (i as f32 + 0.5) / 500.0;
                let r = (1.0 - z * z).sqrt();
                Vec3::new(r * a.cos(), r * a.sin(), z)
            })
            .collect();
        let found = cluster_normals(&many);
        assert_eq!(found.iter().map(|c| c.pixels).sum::<usize>(), 500);
        assert_eq!(cluster_normals(&many), found, "the same twice");
    }

    #[test]
    fn cancelling_normals_are_split() {
        // Five groups for four clusters, two of which are opposite: they may share one.
        let mut normals = vec![Vec3::X; 40];
        normals.extend([-Vec3::X; 40]);
        let whole = NormalCluster {
            direction: Vec3::Y,
            pixels: 80,
        };
        let found = halves(&normals, whole);
        assert_eq!(found.len(), 2);
        assert_eq!(
            (found[0].direction, found[1].direction),
            (Vec3::X, -Vec3::X)
        );
    }

    #[test]
    fn photographs_are_ranked_by_angle_and_ties_by_index() {
        let directions = [Vec3::X, Vec3::Z, Vec3::new(0.6, 0.0, 0.8), Vec3::Z];
        assert_eq!(nearest_directions(Vec3::Z, &directions, 3), [1, 3, 2]);
        assert_eq!(nearest_directions(Vec3::Z, &directions, 9).len(), 4);
    }

    #[test]
    fn supplementary_photographs_look_against_the_uncovered() {
        let clusters = [
            NormalCluster {
                direction: Vec3::X,
                pixels: 600,
            },
            NormalCluster {
                direction: Vec3::Y,
                pixels: 300,
            },
            NormalCluster {
                direction: Vec3::Z,
                pixels: 10,
            },
        ];
        let directions = [
            -Vec3::X,
            -Vec3::Y,
            Vec3::new(-0.9, -0.1, 0.0),
            Vec3::X,
            Vec3::Z,
        ];
        // The last cluster is small and nothing looks against it; photograph 0 is taken.
        assert_eq!(
            supplementary_photos(&clusters, &directions, &[0], 3, 10_000),
            [2, 1]
        );
        assert_eq!(shares(&clusters, 6, 10_000), [4, 2, 0]);
        // Above 0.5 % of the picture one is certain.
        assert_eq!(shares(&clusters, 6, 1000), [4, 2, 1]);
        assert_eq!(
            supplementary_photos(&clusters, &directions, &[], 1, 1000),
            [0]
        );
        assert!(supplementary_photos(&[], &directions, &[], 4, 100).is_empty());
    }

    #[test]
    fn the_direction_of_the_view_does_not_jump_at_the_box() {
        let bounds = [Vec3::splat(-1.0), Vec3::splat(1.0)];
        let forward = Vec3::new(0.0, 1.0, 0.0);
        let mut last: Option<Vec3> = None;
        for step in 0..400 {
            let eye = Vec3::new(3.0 - 0.01 * step as f32, 0.2, 0.0);
            let direction = view_direction(eye, forward, bounds, Vec3::ZERO);
            if let Some(last) = last {
                assert!(last.angle_between(direction) < 0.15, "at {eye}");
            }
            last = Some(direction);
        }
        // Outside turning changes nothing, inside the camera decides.
        let eye = Vec3::new(3.0, 0.0, 0.0);
        assert_eq!(view_direction(eye, Vec3::Z, bounds, Vec3::ZERO), -Vec3::X);
        assert_eq!(
            view_direction(Vec3::splat(0.1), Vec3::Z, bounds, Vec3::ZERO),
            Vec3::Z
        );
    }

    #[test]
    fn the_most_worth_is_chosen_once_and_then_what_it_lacks() {
        let worth = vec![
            vec![0.9, 0.9, 0.0, 0.0],
            vec![0.8, 0.8, 0.1, 0.0],
            vec![0.0, 0.0, 0.5, 0.5],
            vec![0.0; 4],
        ];
        assert_eq!(most_worth(&worth, 4), [0, 2]);
        assert_eq!(most_worth(&worth, 1), [0]);
        assert!(most_worth(&[], 3).is_empty());
    }

    #[test]
    fn bounds_change_no_choice_and_few_are_looked_at() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        let chance = |seed: usize| {
            let mixed = (seed as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f32
                / (1 << 24) as f32
        };
        // Each serves places near its own, some well and some badly, twins alike; the bound is a little more than that.
        let worth: Vec<Vec<f32>> = (0..120)
            .map(|photo| {
                let twins = photo / 2;
                let strength = 0.93_f32.powi((twins * 17 % 60) as i32);
                let near = |place: usize| 1.0 / (1.0 + (place as f32 * 0.3 - twins as f32).powi(2));
                let rough = |place| 0.5 + 0.5 * chance(twins * 777 + place);
                let at = |place| strength * near(place) * rough(place);
                (0..200).map(at).collect()
            })
            .collect();
        let factors: Vec<f32> = (0..120)
            .map(|k| if k % 9 == 4 { 1.15 } else { 1.0 })
            .collect();
        let weighted = worth.iter().zip(&factors);
        let weighted: Vec<Vec<f32>> = weighted
            .map(|(row, factor)| row.iter().map(|w| factor * w).collect())
            .collect();
        for count in [1, 7, 16, 60, 200] {
            let asked = AtomicUsize::new(0);
            let more = |row: &Vec<f32>| row.iter().map(|w| (1.3 * w).min(1.0)).collect();
            let mut known = WorthRows {
                rows: worth.iter().map(more).collect(),
                factors: factors.clone(),
                are_bounds: true,
            };
            let chosen = most_worth_of_bounds(&mut known, count, |photo| {
                asked.fetch_add(1, Ordering::Relaxed);
                worth[photo].clone()
            });
            assert_eq!(chosen, most_worth(&weighted, count), "{count}");
            assert!(
                chosen
                    .iter()
                    .all(|photo| known.rows[*photo] == worth[*photo])
            );
            let asked = asked.into_inner();
            assert!(asked < 70, "{count}: {asked}");
        }
        let mut known = WorthRows {
            rows: worth.clone(),
            factors,
            are_bounds: false,
        };
        let unasked = |_: usize| panic!("rows are known");
        let chosen = most_worth_of_bounds(&mut known, 16, unasked);
        assert_eq!(chosen, most_worth(&weighted, 16));
    }
}
