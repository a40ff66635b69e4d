//! Finds the value that divides a set of leaves by rank, exactly.

use super::sort_item::SortItem;

/// The item that is first on the right: everything before it, by coordinate and then by position, goes left.
#[derive(Clone, Copy)]
pub(super) struct SelectPivot {
    pub(super) key: f32,
    pub(super) position: u32,
}

/// Buffers of one task.
#[derive(Default)]
pub(super) struct SelectScratch {
    keys: Vec<f32>,
    candidates: Vec<u64>,
}

/// An integer that orders like the float; -0 equals +0.
#[inline]
pub(super) fn ordered(key: f32) -> u32 {
    let bits = (key + 0.0).to_bits();
    bits ^ (((bits as i32) >> 31) as u32 | 0x8000_0000)
}

#[inline]
fn unordered(code: u32) -> f32 {
    let mask = if code & 0x8000_0000 != 0 {
        0x8000_0000
    } else {
        u32::MAX
    };
    f32::from_bits(code ^ mask)
}

/// Collects position and key of all items with `low <= key < high`, and counts those below `low`.
fn collect(
    keys: impl Iterator<Item = f32>,
    low: f32,
    high: f32,
    candidates: &mut Vec<u64>,
) -> usize {
    const PIECE: usize = 1024;
    let mut below = 0usize;
    let mut found = 0usize;
    for (i, key) in keys.enumerate() {
        if i % PIECE == 0 && candidates.len() < found + PIECE {
            candidates.resize((found + PIECE).next_power_of_two(), 0);
        }
        below += usize::from(key < low);
        candidates[found] = (u64::from(ordered(key)) << 32) | i as u64;
        found += usize::from((key >= low) & (key < high));
    }
    candidates.truncate(found);
    below
}

/// The candidate of rank `rank`.
fn select(candidates: &mut [u64], rank: usize) -> SelectPivot {
    let (_, &mut code, _) = candidates.select_nth_unstable(rank);
    SelectPivot {
        key: unordered((code >> 32) as u32),
        position: code as u32,
    }
}

/// Splitting value of a large set (after Floyd and Rivest, 1975): a sample brackets it, one pass collects what lies in
/// the bracket, the exact element is selected there.
pub(super) fn pivot_by_sample(
    items: &[SortItem],
    k: usize,
    axis: usize,
    scratch: &mut SelectScratch,
) -> SelectPivot {
    let n = items.len();
    let count = if n > 1 << 18 { 4096 } else { 512 };
    scratch.keys.clear();
    // An odd stride pattern is not needed: a fixed one keeps the result a function of the input, and a bad sample
    // only costs time.
    scratch
        .keys
        .extend((0..count).map(|s| items[s * n / count].key(axis)));
    scratch.keys.sort_unstable_by(f32::total_cmp);
    let expected = (k as f64 / n as f64 * count as f64) as usize;
    // Four standard deviations of the rank in the sample at its middle.
    let margin = 2 * (count as f64).sqrt() as usize;
    let low = match expected.checked_sub(margin) {
        Some(rank) => scratch.keys[rank],
        None => f32::NEG_INFINITY,
    };
    let high = scratch
        .keys
        .get(expected + margin)
        .map_or(f32::INFINITY, |key| key.next_up());
    scratch.candidates.clear();
    let below = collect(
        items.iter().map(|item| item.key(axis)),
        low,
        high,
        &mut scratch.candidates,
    );
    if (below..below + scratch.candidates.len()).contains(&k) {
        select(&mut scratch.candidates, k - below)
    } else {
        // The sample misled: all items are candidates.
        scratch.candidates.clear();
        let all = items.iter().enumerate();
        scratch
            .candidates
            .extend(all.map(|(i, item)| (u64::from(ordered(item.key(axis))) << 32) | i as u64));
        select(&mut scratch.candidates, k)
    }
}

/// Splitting value of a set of up to 4096 with keys from `low` to `high`: counting passes over the bare keys, guided by interpolation, narrow a bracket.
pub(super) fn pivot_by_counting(
    items: &[SortItem],
    k: usize,
    axis: usize,
    (low, high): (f32, f32),
    scratch: &mut SelectScratch,
) -> SelectPivot {
    let n = items.len();
    scratch.keys.clear();
    scratch.keys.extend(items.iter().map(|item| item.key(axis)));
    let (mut low, mut low_rank) = (low, 0);
    let (mut high, mut high_rank) = (high.next_up(), n);
    let enough = (n / 16).max(8);
    for round in 0..6 {
        if high_rank - low_rank <= enough {
            break;
        }
        // Regula falsi, drawn towards the middle so that the bracket closes from both sides.
        let share = (k - low_rank) as f32 + 0.5;
        let width = (high_rank - low_rank) as f32;
        let pull = enough as f32 * 0.25 * if round % 2 == 0 { 1.0 } else { -1.0 };
        let guess = low + (high - low) * ((share + pull) / width).clamp(0.02, 0.98);
        if !(guess > low && guess < high) {
            break;
        }
        let rank = count_below(&scratch.keys, guess);
        if rank <= k {
            (low, low_rank) = (guess, rank);
        } else {
            (high, high_rank) = (guess, rank);
        }
    }
    scratch.candidates.clear();
    let below = collect(
        scratch.keys.iter().copied(),
        low,
        high,
        &mut scratch.candidates,
    );
    select(&mut scratch.candidates, k - below)
}

#[inline]
fn count_below(keys: &[f32], bound: f32) -> usize {
    let mut chunks = keys.chunks_exact(16);
    let mut lanes = [0u32; 16];
    for chunk in &mut chunks {
        for (lane, &key) in lanes.iter_mut().zip(chunk) {
            *lane += u32::from(key < bound);
        }
    }
    let rest = chunks
        .remainder()
        .iter()
        .filter(|&&key| key < bound)
        .count();
    lanes.iter().map(|&lane| lane as usize).sum::<usize>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ordered_integers_sort_like_floats() {
        let keys = [f32::MIN, -1.0, -1e-45, 0.0, 1e-45, 1.0, f32::MAX];
        assert!(keys.windows(2).all(|w| ordered(w[0]) < ordered(w[1])));
        assert!(keys.iter().all(|&key| unordered(ordered(key)) == key));
        assert_eq!(ordered(-0.0), ordered(0.0));
    }
}
