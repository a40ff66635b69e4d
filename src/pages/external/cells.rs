//! A sparse grid that counts leaves while they pass by, and its division into chunks of bounded size.
//!
//! Source: Schütz, Ohrhallinger and Wimmer, *Fast Out-of-Core Octree Generation for Massive Point Clouds* (2020): count
//! into cells, join cells into chunks, distribute. There the cells are those of an octree; here they are divided by planes, so
//! that chunks are compact and all about as large.
//!
//! The grid is anchored at the first leaf, and its cells grow until all leaves fit and few are counted. So it depends on the
//! order of the input alone. Cells with too many leaves are divided once more, which takes another look at the input.

use crate::pages::mix_hash::MixMap;
use glam::DVec3;
use rayon::prelude::*;

/// Cells along an axis, on either side of the anchor.
const REACH: i64 = 1 << 20;

/// Most cells of the grid: 24 bytes each.
const MOST_CELLS: usize = 1 << 19;

/// Cells along an axis of a cell that is divided once more.
const FINER: u32 = 64;

/// Times that a cell may be divided once more.
const DIVISIONS: usize = 4;

/// Part of a chunk that a cell may have before it is divided.
const HOT_PART: u64 = 8;

/// A chunk has at least this part of the most leaves, where there are several.
pub(super) const LEAST_PART: u64 = 16;

/// Cells of one size with their number of leaves.
#[derive(Debug, Clone, Default)]
pub(super) struct CountGrid {
    anchor: DVec3,
    /// Side of a cell, a power of two.
    side: f64,
    counts: MixMap<u64, u64>,
}

/// Joins cell coordinates, each from `-REACH` to `REACH - 1`.
fn key_of(cell: [i64; 3]) -> u64 {
    let [x, y, z] = cell.map(|c| (c + REACH) as u64);
    (x << 42) | (y << 21) | z
}

/// Takes a key apart.
fn cell_of(key: u64) -> [i64; 3] {
    [42, 21, 0].map(|shift| ((key >> shift) & (2 * REACH as u64 - 1)) as i64 - REACH)
}

impl CountGrid {
    /// Counts leaves at some places, all of them finite.
    pub(super) fn add(&mut self, places: &[DVec3]) {
        let Some(&first) = places.first() else {
            return;
        };
        let (min, max) = places
            .par_iter()
            .with_min_len(1 << 14)
            .map(|&p| (p, p))
            .reduce(
                || (DVec3::INFINITY, DVec3::NEG_INFINITY),
                |a, b| (a.0.min(b.0), a.1.max(b.1)),
            );
        if self.side == 0.0 {
            let extent = (max - min).max_element();
            let largest = min.abs().max(max.abs()).max_element();
            // Not below the steps of the numbers themselves.
            let side = (extent / 1024.0).max(largest * 1e-12);
            self.side = if side > 0.0 {
                side.log2().ceil().exp2()
            } else {
                1.0
            };
            self.anchor = first;
        }
        let far = (min - self.anchor)
            .abs()
            .max((max - self.anchor).abs())
            .max_element();
        while far / self.side >= (REACH - 1) as f64 {
            self.coarsen();
        }
        let mut keys: Vec<u64> = places.par_iter().map(|&place| self.key(place)).collect();
        keys.par_sort_unstable();
        for run in keys.chunk_by(|a, b| a == b) {
            *self.counts.entry(run[0]).or_default() += run.len() as u64;
        }
        while self.counts.len() > MOST_CELLS {
            self.coarsen();
        }
    }

    /// Doubles the side of the cells.
    fn coarsen(&mut self) {
        self.side *= 2.0;
        let old = std::mem::take(&mut self.counts);
        let mut old: Vec<(u64, u64)> = old.into_iter().collect();
        old.par_sort_unstable();
        for (key, count) in old {
            let key = key_of(cell_of(key).map(|c| c >> 1));
            *self.counts.entry(key).or_default() += count;
        }
    }

    fn key(&self, place: DVec3) -> u64 {
        let cell = ((place - self.anchor) / self.side).floor();
        // In range since the grid was made for all places.
        key_of(cell.to_array().map(|c| (c as i64).clamp(-REACH, REACH - 1)))
    }

    /// The place within its cell, each coordinate from 0 to 1.
    fn fraction(&self, place: DVec3) -> DVec3 {
        let scaled = (place - self.anchor) / self.side;
        scaled - scaled.floor()
    }
}

/// What a cell is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CellKind {
    /// A number of leaves, before it is in a chunk.
    Counted(u64),
    /// Divided into finer cells.
    Divided(u32),
    /// A part of a chunk.
    Chunk(u32),
}

/// Finer cells of a divided one, by their number: 6 bits an axis.
type FinerCells = MixMap<u32, CellKind>;

/// All cells, coarse and fine.
#[derive(Debug, Clone, Default)]
pub(super) struct ChunkCells {
    grid: CountGrid,
    coarse: MixMap<u64, CellKind>,
    finer: Vec<FinerCells>,
}

/// Number of a finer cell at a fraction of its cell, and the fraction within it.
fn finer_of(fraction: DVec3) -> (u32, DVec3) {
    let scaled = fraction * f64::from(FINER);
    let cell = scaled.floor().min(DVec3::splat(f64::from(FINER - 1)));
    let [x, y, z] = cell.to_array().map(|c| c as u32);
    ((x * FINER + y) * FINER + z, scaled - cell)
}

impl ChunkCells {
    /// Takes over the counts of a grid.
    pub(super) fn new(mut grid: CountGrid) -> Self {
        let counts = std::mem::take(&mut grid.counts);
        let coarse = (counts.into_iter())
            .map(|(key, count)| (key, CellKind::Counted(count)))
            .collect();
        Self {
            grid,
            coarse,
            finer: Vec::new(),
        }
    }

    /// Divides cells that have too many leaves for chunks of `most`; `false` where there are none, or none that can be divided.
    /// The leaves must then be counted again ([`ChunkCells::count`]), as many times as it says so.
    pub(super) fn divide(&mut self, most: u64, round: usize) -> bool {
        let is_hot = |kind: &CellKind| matches!(kind, CellKind::Counted(n) if *n > most / HOT_PART);
        if round >= DIVISIONS {
            return false;
        }
        let mut next = self.finer.len() as u32;
        let mut added = Vec::new();
        let mut hot: Vec<&mut CellKind> = Vec::new();
        for cells in &mut self.finer {
            hot.extend(cells.values_mut().filter(|kind| is_hot(kind)));
        }
        hot.extend(self.coarse.values_mut().filter(|kind| is_hot(kind)));
        for kind in hot {
            *kind = CellKind::Divided(next);
            next += 1;
            added.push(FinerCells::default());
        }
        let any = !added.is_empty();
        self.finer.extend(added);
        any
    }

    /// Counts leaves in the cells that were divided last.
    pub(super) fn count(&mut self, places: &[DVec3], first_new: usize) {
        let found: Vec<(u32, u32)> = places
            .par_iter()
            .filter_map(|&place| {
                let (cells, cell) = self.finest(place)?;
                (cells as usize >= first_new).then_some((cells, cell))
            })
            .collect();
        for (cells, cell) in found {
            let kind = self.finer[cells as usize]
                .entry(cell)
                .or_insert(CellKind::Counted(0));
            if let CellKind::Counted(count) = kind {
                *count += 1;
            }
        }
    }

    /// Number of divided cells.
    pub(super) fn divided(&self) -> usize {
        self.finer.len()
    }

    /// The divided cell and the finer one in it where a place lies; `None` where it lies in no divided cell.
    fn finest(&self, place: DVec3) -> Option<(u32, u32)> {
        let mut kind = self.coarse.get(&self.grid.key(place))?;
        let mut fraction = self.grid.fraction(place);
        loop {
            let CellKind::Divided(cells) = *kind else {
                return None;
            };
            let (cell, rest) = finer_of(fraction);
            match self.finer[cells as usize].get(&cell) {
                Some(next @ CellKind::Divided(_)) => (kind, fraction) = (next, rest),
                _ => return Some((cells, cell)),
            }
        }
    }

    /// Joins the cells into chunks of at most `most` leaves (more only where a cell that cannot be divided has more, or to
    /// leave no small rest) and returns the number of leaves of each. Neighbors in this order are neighbors in space.
    pub(super) fn join(&mut self, most: u64) -> Vec<u64> {
        let mut cells = self.counted();
        cells.par_sort_unstable_by_key(|cell| cell.home);
        let total = cells.iter().map(|cell| cell.count).sum();
        let mut counts = Vec::new();
        let mut put = |group: &[CountedCell]| {
            let chunk = CellKind::Chunk(counts.len() as u32);
            counts.push(group.iter().map(|cell| cell.count).sum());
            for cell in group {
                let kind = match cell.home {
                    CellHome::Coarse(key) => self.coarse.get_mut(&key),
                    CellHome::Finer(cells, cell) => self.finer[cells as usize].get_mut(&cell),
                };
                if let Some(kind) = kind {
                    *kind = chunk;
                }
            }
        };
        let largest = cells.iter().map(|cell| cell.count).max().unwrap_or(0);
        let division = CellDivision {
            most,
            least: (most / LEAST_PART).max(1),
            slack: (2 * largest).min(most / HOT_PART),
        };
        division.divide(&mut cells, (total, division.parts(total)), &mut put);
        counts
    }

    /// The cells that leaves were counted in, in no order.
    fn counted(&self) -> Vec<CountedCell> {
        let mut found = Vec::new();
        // Cells that are still to be looked at: what they are and where they are kept, lowest corner and side.
        let mut open: Vec<(CellKind, CellHome, DVec3, f64)> = (self.coarse.iter())
            .map(|(&key, &kind)| {
                let corner = cell_of(key).map(|c| c as f64).into();
                (kind, CellHome::Coarse(key), corner, 1.0)
            })
            .collect();
        while let Some((kind, home, corner, side)) = open.pop() {
            match kind {
                CellKind::Counted(count) => found.push(CountedCell {
                    middle: corner + 0.5 * side,
                    count,
                    home,
                }),
                CellKind::Divided(cells) => {
                    let side = side / f64::from(FINER);
                    open.extend(self.finer[cells as usize].iter().map(|(&cell, &kind)| {
                        let place = [cell / (FINER * FINER), cell / FINER % FINER, cell % FINER];
                        let own = corner + DVec3::from(place.map(f64::from)) * side;
                        (kind, CellHome::Finer(cells, cell), own, side)
                    }));
                }
                CellKind::Chunk(_) => {}
            }
        }
        found
    }

    /// The chunk of a leaf at a place; one that was counted.
    pub(super) fn chunk(&self, place: DVec3) -> Option<u32> {
        let mut kind = self.coarse.get(&self.grid.key(place))?;
        let mut fraction = self.grid.fraction(place);
        loop {
            match *kind {
                CellKind::Chunk(chunk) => return Some(chunk),
                CellKind::Counted(_) => return None,
                CellKind::Divided(cells) => {
                    let (cell, rest) = finer_of(fraction);
                    kind = self.finer[cells as usize].get(&cell)?;
                    fraction = rest;
                }
            }
        }
    }
}

/// Place where a cell is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum CellHome {
    /// Key of a coarse cell.
    Coarse(u64),
    /// Number of a divided cell, and of the finer one in it.
    Finer(u32, u32),
}

/// A cell with its number of leaves.
#[derive(Debug, Clone, Copy)]
struct CountedCell {
    /// Middle of the cell, in sides of coarse cells from the anchor; exact.
    middle: DVec3,
    count: u64,
    home: CellHome,
}

/// Rules by which cells are divided among chunks.
#[derive(Debug, Clone, Copy)]
struct CellDivision {
    /// Most leaves of a chunk.
    most: u64,
    /// Least leaves of a chunk, where there are several.
    least: u64,
    /// Leaves that chunks are planned to have less than `most`: borders of cells move each division by up to half a cell.
    slack: u64,
}

impl CellDivision {
    /// Number of chunks for some leaves.
    fn parts(&self, leaves: u64) -> u64 {
        leaves.div_ceil((self.most - self.slack).max(1)).max(1)
    }

    /// Divides cells among a number of chunks by planes across their longest extent, and gives each chunk's cells. The leaves
    /// are divided in the proportion of the chunks, as far as cells allow.
    fn divide(
        &self,
        cells: &mut [CountedCell],
        (leaves, planned): (u64, u64),
        put: &mut dyn FnMut(&[CountedCell]),
    ) {
        // The plan holds unless these cells came out larger or smaller.
        let own = self.parts(leaves);
        let has_room = leaves <= planned * self.most - planned * self.slack / 2;
        let parts = if has_room { planned.min(own) } else { own };
        if parts > 1 {
            sort_along(cells);
            let low_parts = parts / 2;
            let wanted = leaves * low_parts / parts;
            if let Some((index, before)) = self.border(cells, leaves, wanted) {
                let (low, high) = cells.split_at_mut(index);
                self.divide(low, (before, low_parts), put);
                self.divide(high, (leaves - before, parts - low_parts), put);
                return;
            }
        }
        put(cells);
    }

    /// Number of the first cells that have about `wanted` leaves of all together, and their leaves; `None` where either side
    /// would be small.
    fn border(&self, cells: &[CountedCell], leaves: u64, wanted: u64) -> Option<(usize, u64)> {
        let mut before = 0;
        let borders = cells.iter().enumerate().map(|(index, cell)| {
            let border = (index, before);
            before += cell.count;
            border
        });
        borders
            .filter(|&(_, before)| before.min(leaves - before) >= self.least)
            .min_by_key(|&(_, before)| before.abs_diff(wanted))
    }
}

/// Sorts cells along the longest extent of their box.
fn sort_along(cells: &mut [CountedCell]) {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (min, max) = (cells.iter()).fold(none, |(min, max), cell| {
        (min.min(cell.middle), max.max(cell.middle))
    });
    let first = (max - min).max_position();
    let axes = [first, (first + 1) % 3, (first + 2) % 3];
    cells.par_sort_unstable_by(|a, b| {
        let by = |axis: usize| a.middle[axis].total_cmp(&b.middle[axis]);
        by(axes[0]).then(by(axes[1])).then(by(axes[2]))
    });
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn random(count: usize, spread: impl Fn(f64) -> f64) -> Vec<DVec3> {
        let mut state = 1u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            spread((state >> 11) as f64 / (1u64 << 53) as f64)
        };
        (0..count)
            .map(|_| DVec3::new(next(), next(), next()))
            .collect()
    }

    /// Chunks of places, counted in pieces.
    fn chunks(places: &[DVec3], most: u64) -> (ChunkCells, Vec<u64>) {
        let mut grid = CountGrid::default();
        places.chunks(1000).for_each(|piece| grid.add(piece));
        let mut cells = ChunkCells::new(grid);
        let mut round = 0;
        loop {
            let first_new = cells.divided();
            if !cells.divide(most, round) {
                break;
            }
            places
                .chunks(1000)
                .for_each(|piece| cells.count(piece, first_new));
            round += 1;
        }
        let counts = cells.join(most);
        (cells, counts)
    }

    #[test]
    fn chunks_hold_every_leaf_and_none_is_small_or_large() {
        // Even; crowded at one corner; far outliers that leave all others in one cell.
        let mut outliers = random(30_000, |v| v);
        outliers[10] = DVec3::splat(1e9);
        outliers[20_000] = DVec3::splat(-1e9);
        let sets = [
            random(30_000, |v| v),
            random(30_000, |v| v.powi(9) * 1e4 + 5e5),
            outliers,
        ];
        for places in sets {
            let (cells, counts) = chunks(&places, 3000);
            assert_eq!(counts.iter().sum::<u64>(), 30_000);
            assert!(counts.len() >= 10);
            for &count in &counts {
                assert!(
                    (3000 / 16..=3000 + 3000 / 16 + 1).contains(&count),
                    "{counts:?}"
                );
            }
            let mut found = vec![0; counts.len()];
            for &place in &places {
                found[cells.chunk(place).unwrap() as usize] += 1u64;
            }
            assert_eq!(found, counts);
        }
    }

    #[test]
    fn leaves_at_one_place_are_one_chunk() {
        let mut places = vec![DVec3::ONE; 10_000];
        places.extend(random(5000, |v| v * 10.0));
        let (_, counts) = chunks(&places, 2048);
        assert!(counts.iter().any(|&count| count >= 10_000), "{counts:?}");
    }
}
