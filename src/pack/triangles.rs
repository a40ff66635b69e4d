//! From a cut to the triangles of a draw list, written straight into the caller's memory.

use crate::pack::parallel;

/// How far ahead of a triangle the memory of another one is asked for: four siblings lie on two lines, so these are few.
const FAR_AHEAD: usize = 4 * parallel::AHEAD;

/// Writes what `of` has of each of the cut's triangles.
///
/// # Panics
/// When `out` is shorter than `ids`.
pub fn triangles<T>(ids: &[u32], of: impl Fn(u32) -> T, out: &mut [T]) {
    for (out, &id) in out[..ids.len()].iter_mut().zip(ids) {
        *out = of(id);
    }
}

/// Writes what `of` has of those triangles for which `is_first` says so to the start of one list, and of the others to the
/// start of another. Returns how many each list has then. The lists and their order do not depend on threads.
///
/// What the two look at may be asked for ahead: `prefetch` is called with an id some time before.
///
/// # Panics
/// When one of the lists is shorter than `ids`.
pub fn split_triangles<T: Copy + Send>(
    ids: &[u32],
    of: impl Fn(u32) -> T + Sync,
    (is_first, prefetch): (impl Fn(u32) -> bool + Sync, impl Fn(u32) + Sync),
    lists: [&mut [T]; 2],
) -> [usize; 2] {
    let [first, second] = lists.map(|list| &mut list[..ids.len()]);
    let own = ids
        .chunks(parallel::PART)
        .zip(first.chunks_mut(parallel::PART))
        .zip(second.chunks_mut(parallel::PART));
    let mut counts = vec![[0; 2]; ids.len().div_ceil(parallel::PART)];
    let jobs = own
        .zip(&mut counts)
        .map(|(((ids, first), second), counts)| (ids, [first, second], counts));
    parallel::share(ids.len(), jobs, |(ids, lists, counts)| {
        for (index, &id) in ids.iter().enumerate() {
            if let Some(&next) = ids.get(index + FAR_AHEAD) {
                prefetch(next);
            }
            let which = usize::from(!is_first(id));
            lists[which][counts[which]] = of(id);
            counts[which] += 1;
        }
    });
    let lists = [first, second];
    let mut written = [0; 2];
    for (counts, start) in counts.iter().zip((0..).step_by(parallel::PART)) {
        for which in 0..2 {
            let (count, end) = (counts[which], &mut written[which]);
            if start != *end {
                lists[which].copy_within(start..start + count, *end);
            }
            *end += count;
        }
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every fourth triangle of many, by three rules: the lists are those of one loop over all.
    #[test]
    fn both_lists_have_the_order_of_the_cut() {
        let corners: Vec<[u32; 3]> = (0..90_000).map(|i| [i, i + 1, i + 2]).collect();
        for many in [0, 1, 4096, 22_000] {
            let ids: Vec<u32> = (0..many).map(|i| 100 + 4 * i).collect();
            for rule in [
                |id: u32| id.is_multiple_of(3),
                |_: u32| true,
                |id: u32| id > 60_000,
            ] {
                let all = |is_first: bool| -> Vec<[u32; 3]> {
                    let own = ids.iter().filter(|&&id| rule(id) == is_first);
                    own.map(|&id| corners[id as usize - 100]).collect()
                };
                let mut first = vec![[u32::MAX; 3]; ids.len() + 1];
                let mut second = first.clone();
                let lists = [first.as_mut_slice(), second.as_mut_slice()];
                let of = |id: u32| corners[id as usize - 100];
                let counts = split_triangles(&ids, of, (rule, |_| {}), lists);
                assert_eq!(counts[0] + counts[1], ids.len());
                assert_eq!(first[..counts[0]], all(true), "{many}");
                assert_eq!(second[..counts[1]], all(false), "{many}");
                assert_eq!(first.last(), Some(&[u32::MAX; 3]), "beyond the list");
            }
        }
    }
}
