//! Draw lists written by several threads, in the order of one.

use crate::pack::splats::PackedSplats;
use crate::threads;
use std::ops::Range;
use std::sync::Mutex;

/// Items of a cut that one thread writes at a time.
pub(crate) const PART: usize = 4096;

/// A list of fewer records is written by the calling thread: waking another takes as long as some thousand records.
const MANY: usize = 4 * PART;

/// How far ahead of the item that is written the memory of another one is asked for.
pub(crate) const AHEAD: usize = 40;

/// Where the records of one part go.
#[derive(Debug)]
pub(crate) struct RecordSink<'a, R> {
    out: &'a mut [R],
    points: usize,
    quads: Vec<R>,
}

impl<R> RecordSink<'_, R> {
    /// The next record from the start of the list.
    ///
    /// # Panics
    /// When the part has no room left.
    #[inline]
    pub(crate) fn point(&mut self, record: R) {
        self.out[self.points] = record;
        self.points += 1;
    }

    /// The records from the start of the list.
    #[inline]
    pub(super) fn written(&self) -> &[R] {
        &self.out[..self.points]
    }

    /// How many more records there is room for.
    #[inline]
    pub(crate) fn room(&self) -> usize {
        self.out.len() - self.points
    }

    /// The next record of those at the end of the list.
    pub(super) fn quad(&mut self, record: R) {
        self.quads.push(record);
    }
}

/// What a thread takes: the part's number, what it writes, and where.
type Job<'a, I, R> = (usize, I, &'a mut [R]);

/// Lets `write` write every part, each with the most records that it may have, and moves the points together to the start
/// of `out` and the quads to the end of the room that the parts have. The records and their order do not depend on
/// the number of threads.
///
/// # Panics
/// When `out` is shorter than all parts together, or a part has more records than it said.
pub(crate) fn write<I: Send, R: Copy + Send>(
    parts: Vec<(I, usize)>,
    out: &mut [R],
    write: impl Fn(I, &mut RecordSink<'_, R>) + Sync,
) -> PackedSplats {
    with_threads(threads::count(), parts, out, write)
}

/// The same, of parts without quads, whose records stay where the room of each begins; which they are.
///
/// # Panics
/// As [`write()`].
pub(super) fn write_apart<I: Send, R: Copy + Send>(
    parts: Vec<(I, usize)>,
    out: &mut [R],
    write: impl Fn(I, &mut RecordSink<'_, R>) + Sync,
) -> Vec<Range<usize>> {
    let written = each_with_threads(threads::count(), parts, out, write);
    written.into_iter().map(|part| part.points).collect()
}

/// Moves the records of parts together to the start of a list; how many they are.
pub(super) fn close_gaps<R: Copy>(parts: &[Range<usize>], out: &mut [R]) -> usize {
    let mut end = 0;
    for part in parts {
        if part.start != end {
            out.copy_within(part.clone(), end);
        }
        end += part.len();
    }
    end
}

/// What a part has become.
struct FinishedPart<R> {
    /// Places of the records from the start of its room.
    points: Range<usize>,
    quads: Vec<R>,
}

fn with_threads<I: Send, R: Copy + Send>(
    threads: usize,
    parts: Vec<(I, usize)>,
    out: &mut [R],
    write: impl Fn(I, &mut RecordSink<'_, R>) + Sync,
) -> PackedSplats {
    let end: usize = parts.iter().map(|part| part.1).sum();
    let written = each_with_threads(threads, parts, out, write);
    let points: Vec<Range<usize>> = written.iter().map(|part| part.points.clone()).collect();
    let packed = PackedSplats {
        points: close_gaps(&points, out),
        quads: written.iter().map(|part| part.quads.len()).sum(),
    };
    let quads = written.iter().flat_map(|part| &part.quads);
    for (out, quad) in out[end - packed.quads..end].iter_mut().zip(quads) {
        *out = *quad;
    }
    packed
}

fn each_with_threads<I: Send, R: Copy + Send>(
    threads: usize,
    parts: Vec<(I, usize)>,
    out: &mut [R],
    write: impl Fn(I, &mut RecordSink<'_, R>) + Sync,
) -> Vec<FinishedPart<R>> {
    let sizes: Vec<usize> = parts.iter().map(|part| part.1).collect();
    let end = sizes.iter().sum();
    let mut rest = &mut out[..end];
    let jobs: Vec<Job<'_, I, R>> = parts
        .into_iter()
        .enumerate()
        .map(|(index, (items, size))| {
            let (own, others) = std::mem::take(&mut rest).split_at_mut(size);
            rest = others;
            (index, items, own)
        })
        .collect();
    let count = jobs.len();
    let written = Mutex::new(Vec::with_capacity(count));
    // Of few records the calling thread writes all.
    let threads = if end < MANY { 1 } else { threads };
    threads::share(
        &mut vec![(); threads.min(count).max(1)],
        jobs.into_iter(),
        |(), (index, items, out)| {
            let mut sink = RecordSink {
                out,
                points: 0,
                quads: Vec::new(),
            };
            write(items, &mut sink);
            let RecordSink { points, quads, .. } = sink;
            // A poisoned lock means that another thread panicked, which the scope passes on.
            if let Ok(mut written) = written.lock() {
                written.push((index, points, quads));
            }
        },
    );
    let mut written = written.into_inner().unwrap_or_default();
    written.sort_unstable_by_key(|part| part.0);

    let mut start = 0;
    let parts = sizes.iter().zip(written);
    parts
        .map(|(&size, (_, points, quads))| {
            let points = start..start + points;
            start += size;
            FinishedPart { points, quads }
        })
        .collect()
}

/// Does all jobs, which write `records` records together, on several threads if these are many.
pub(crate) fn share<J: Send>(
    records: usize,
    jobs: impl Iterator<Item = J> + Send,
    work: impl Fn(J) + Sync,
) {
    let threads = if records < MANY { 1 } else { threads::count() };
    threads::share(&mut vec![(); threads], jobs, |(), job| work(job));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in parts of uneven room: multiples of 5 are left out, multiples of 7 are quads.
    fn written(threads: usize, numbers: u32) -> (PackedSplats, Vec<u32>, usize) {
        let all: Vec<u32> = (1..=numbers).collect();
        let parts: Vec<_> = all.chunks(997).map(|p| (p, p.len())).collect();
        let mut out = vec![0; all.len() + 3];
        let packed = with_threads(threads, parts, &mut out, |part, sink| {
            for &n in part {
                match (n % 5, n % 7) {
                    (0, _) => {}
                    (_, 0) => sink.quad(n),
                    _ => sink.point(n),
                }
            }
        });
        (packed, out, all.len())
    }

    #[test]
    fn the_order_is_that_of_one_thread_and_gaps_are_closed() {
        for numbers in [0, 1, 996, 40_000] {
            let kept = |n: &u32| !n.is_multiple_of(5);
            let points: Vec<u32> = (1..=numbers)
                .filter(kept)
                .filter(|n| !n.is_multiple_of(7))
                .collect();
            let quads: Vec<u32> = (1..=numbers)
                .filter(kept)
                .filter(|n| n.is_multiple_of(7))
                .collect();
            for threads in [1, 2, 5] {
                let (packed, out, end) = written(threads, numbers);
                assert_eq!(packed.points, points.len(), "{numbers}, {threads}");
                assert_eq!(out[..packed.points], points, "{numbers}, {threads}");
                assert_eq!(out[end - packed.quads..end], quads, "{numbers}, {threads}");
                assert_eq!(out[end..], [0; 3], "beyond the parts");
            }
        }
    }

    #[test]
    #[should_panic(expected = "index out of bounds")]
    fn a_part_that_is_too_full_is_a_panic() {
        let mut out = [0; 4];
        with_threads(1, vec![((), 2), ((), 2)], &mut out, |(), sink| {
            (0..3).for_each(|n| sink.point(n));
        });
    }
}
