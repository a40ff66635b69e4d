//! Threads that wait for work of frames.
//!
//! To start a thread and wait for its end takes a tenth of a millisecond, and a frame of a millisecond divides its work some
//! eight times. These threads wait instead, and are awake while a frame asks for them again and again. They are not those
//! that build trees: while another model is loaded, a frame would wait for a place among them.

use rayon::{ThreadPool, ThreadPoolBuilder, Yield};
use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{LazyLock, Mutex};
use std::time::{Duration, Instant};

/// Most threads that work for one frame.
const MOST: usize = 16;

/// How long a thread stays awake when there is nothing to do: a little longer than what a frame does alone between two works that
/// are shared.
const AWAKE: Duration = Duration::from_micros(150);

/// How many threads work for a frame: as many as the machine runs at once, at most 16.
pub(crate) fn count() -> usize {
    static COUNT: LazyLock<usize> = LazyLock::new(|| {
        std::thread::available_parallelism()
            .map_or(1, NonZero::get)
            .min(MOST)
    });
    *COUNT
}

/// None where one thread does all, or others cannot be started.
static OTHERS: LazyLock<Option<ThreadPool>> = LazyLock::new(|| {
    let others = count().saturating_sub(1);
    let pool = ThreadPoolBuilder::new()
        .num_threads(others)
        .thread_name(|index| format!("frame {index}"));
    (others > 0).then(|| pool.build().ok()).flatten()
});

/// Does all of the work, in as many threads as there are `workers`, the calling one among them; each takes what comes next
/// with a worker of its own. With none nothing is done.
pub(crate) fn share<W: Send, T: Send>(
    workers: &mut [W],
    work: impl Iterator<Item = T> + Send,
    run: impl Fn(&mut W, T) + Sync,
) {
    let [first, others @ ..] = workers else {
        return;
    };
    let work = Mutex::new(work);
    // A poisoned lock means that another thread panicked, which the scope passes on.
    let next = || work.lock().ok().and_then(|mut work| work.next());
    let all = |worker: &mut W| {
        while let Some(item) = next() {
            run(worker, item);
        }
    };
    match OTHERS.as_ref().filter(|_| !others.is_empty()) {
        Some(pool) => {
            let at_work = AtomicUsize::new(others.len());
            pool.in_place_scope(|scope| {
                for other in others {
                    scope.spawn(|_| {
                        all(other);
                        pool.spawn(stay_awake);
                        at_work.fetch_sub(1, Ordering::Relaxed);
                    });
                }
                all(first);
                // The scope waits for them, asleep. After a panic this number stays.
                let start = Instant::now();
                while at_work.load(Ordering::Relaxed) > 0 && start.elapsed() < AWAKE {
                    std::thread::yield_now();
                }
            });
        }
        None => all(first),
    }
}

/// Waits for work without falling asleep, and does it. Others that want to run have the processor first.
fn stay_awake() {
    let start = Instant::now();
    // What was done has asked for the next wait: this one ends, lest each lie within the one before.
    while rayon::yield_now() != Some(Yield::Executed) && start.elapsed() < AWAKE {
        std::thread::yield_now();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the number of workers, and of threads that help them.
    #[test]
    fn everything_is_done_once() {
        for workers in [1, 2, 5, 40] {
            let mut sums = vec![0u64; workers];
            for numbers in [0, 1, 1000] {
                sums.fill(0);
                share(&mut sums, 0..numbers, |sum, number| *sum += number + 1);
                assert_eq!(sums.iter().sum::<u64>(), numbers * (numbers + 1) / 2);
            }
        }
    }

    #[test]
    fn work_may_be_shared_by_many_callers() {
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..200 {
                        let mut sums = [0u32; 3];
                        share(&mut sums, 0..50, |sum, number| *sum += number);
                        assert_eq!(sums.iter().sum::<u32>(), 49 * 25);
                    }
                });
            }
        });
    }

    /// One work after the other without an end: waits end when they have found work, and do not lie within one another.
    #[test]
    fn frames_may_go_on_for_ever() {
        let mut sums = [0u64; 3];
        for _ in 0..30_000 {
            share(&mut sums, 0..4, |sum, number| *sum += number);
        }
        assert_eq!(sums.iter().sum::<u64>(), 30_000 * 6);
    }

    #[test]
    #[should_panic(expected = "the seventh")]
    fn a_panic_is_passed_on() {
        share(&mut [(); 3], 0..50, |(), number| {
            assert_ne!(number, 7, "the seventh");
        });
    }
}
