//! Threads that read and decode pages, the most wanted first.

use super::cut::WantedPage;
use super::file::PagedFile;
use super::format::{PageEntry, PageError};
use super::page::{DecodeOptions, DecodedPage};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How pages are loaded.
#[derive(Debug, Clone, Copy)]
pub struct LoaderOptions {
    /// Threads, at least 1.
    pub threads: usize,
    /// Pause before a page that failed is tried again; each further one is twice as long.
    pub first_pause: Duration,
    /// The longest pause.
    pub longest_pause: Duration,
    /// What is decoded.
    pub decode: DecodeOptions,
}

impl Default for LoaderOptions {
    fn default() -> Self {
        Self {
            threads: 2,
            first_pause: Duration::from_millis(250),
            longest_pause: Duration::from_secs(60),
            decode: DecodeOptions::default(),
        }
    }
}

/// A page that was read.
#[derive(Debug, Clone)]
pub struct LoadedPage {
    /// Number of the page.
    pub id: u32,
    /// The page.
    pub page: Arc<DecodedPage>,
    /// Width of its root on the screen when it was wanted, pixels.
    pub size_px: f32,
}

/// A page that failed.
#[derive(Debug, Clone, Copy)]
struct FailedPage {
    attempts: u32,
    again: Instant,
}

#[derive(Debug, Default)]
struct LoaderState {
    /// The most wanted last.
    queue: Vec<WantedPage>,
    reading: BTreeSet<u32>,
    done: Vec<LoadedPage>,
    failed: BTreeMap<u32, FailedPage>,
    /// Files that give no bytes, which was said.
    unread: BTreeSet<String>,
    messages: Vec<String>,
    is_over: bool,
}

impl LoaderState {
    /// Nothing is being read, and all that waits has failed before.
    fn is_stuck(&self) -> bool {
        let has_failed = |wanted: &WantedPage| self.failed.contains_key(&wanted.entry.id);
        self.reading.is_empty() && self.queue.iter().all(has_failed)
    }

    /// The most wanted page that may be tried now; else how long none may be, if any is wanted at all.
    fn next(&mut self, now: Instant) -> Result<WantedPage, Option<Duration>> {
        let may_be_tried = |wanted: &WantedPage| {
            let failed = self.failed.get(&wanted.entry.id);
            failed.is_none_or(|failed| failed.again <= now)
        };
        match self.queue.iter().rposition(may_be_tried) {
            Some(index) => Ok(self.queue.remove(index)),
            None => {
                let pauses = self.queue.iter().filter_map(|wanted| {
                    let failed = self.failed.get(&wanted.entry.id)?;
                    Some(failed.again.saturating_duration_since(now))
                });
                Err(pauses.min())
            }
        }
    }
}

/// Pages of a network that lie so near each other in the file are read by one request, bytes between them; and bytes of such a
/// request at most.
const LARGEST_GAP: u64 = 64 << 10;
const LARGEST_REQUEST: u64 = 256 << 10;

impl LoaderState {
    /// Notes what came of reading a page.
    fn end_read(
        &mut self,
        wanted: WantedPage,
        result: Result<DecodedPage, PageError>,
        options: &LoaderOptions,
    ) {
        let id = wanted.entry.id;
        self.reading.remove(&id);
        match result {
            Ok(page) => {
                if self.failed.remove(&id).is_some() {
                    self.unread.clear();
                }
                let page = Arc::new(page);
                let size_px = wanted.size_px;
                self.done.push(LoadedPage { id, page, size_px });
            }
            Err(error) => {
                let attempts = self.failed.get(&id).map_or(0, |failed| failed.attempts);
                // Said once, however often it fails, and a file that gives no bytes once for all pages, until one comes again.
                let message = error.to_string();
                let is_new = attempts == 0
                    && match error {
                        PageError::Io { name, .. } => self.unread.insert(name),
                        PageError::Damaged { .. } => !self.messages.contains(&message),
                    };
                if is_new {
                    self.messages.push(message);
                }
                let pause = options.first_pause * 2u32.saturating_pow(attempts.min(20));
                let failed = FailedPage {
                    attempts: attempts + 1,
                    again: Instant::now() + pause.min(options.longest_pause),
                };
                self.failed.insert(id, failed);
                // Still wanted, as far as anybody knows.
                if !self.queue.iter().any(|other| other.entry.id == id) {
                    self.queue.insert(0, wanted);
                }
            }
        }
    }

    /// Takes pages from the queue that lie right before or behind a page, so that all are one request; in the order of the file.
    fn with_neighbors(&mut self, wanted: WantedPage) -> Vec<WantedPage> {
        let mut all = vec![wanted];
        let (mut start, mut end) = (wanted.entry.offset, wanted.entry.end());
        let mut places: BTreeMap<u64, WantedPage> = BTreeMap::new();
        for own in &self.queue {
            let is_near = own.entry.end() + LARGEST_REQUEST > start
                && own.entry.offset < end + LARGEST_REQUEST;
            if is_near && !self.failed.contains_key(&own.entry.id) {
                places.insert(own.entry.offset, *own);
            }
        }
        while let Some((_, next)) = places.range(end..).next()
            && next.entry.offset - end <= LARGEST_GAP
            && next.entry.end() - start <= LARGEST_REQUEST
        {
            end = next.entry.end();
            all.push(*next);
        }
        while let Some((_, next)) = places.range(..start).next_back()
            && start.saturating_sub(next.entry.end()) <= LARGEST_GAP
            && end - next.entry.offset <= LARGEST_REQUEST
        {
            start = next.entry.offset;
            all.insert(0, *next);
        }
        let taken: BTreeSet<u32> = all.iter().map(|own| own.entry.id).collect();
        self.queue.retain(|own| !taken.contains(&own.entry.id));
        all
    }
}

#[derive(Debug)]
struct SharedLoader {
    file: PagedFile,
    options: LoaderOptions,
    state: Mutex<LoaderState>,
    /// Told of every change.
    changed: Condvar,
}

impl SharedLoader {
    fn state(&self) -> MutexGuard<'_, LoaderState> {
        // Nothing panics while it holds the lock; a state that was left is as good as any.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self) {
        let mut state = self.state();
        while !state.is_over {
            let wanted = match state.next(Instant::now()) {
                Ok(wanted) => wanted,
                Err(pause) => {
                    // Nothing to do: until something is wanted, or a pause is over.
                    let pause = pause.unwrap_or(Duration::from_secs(3600));
                    state = match self.changed.wait_timeout(state, pause) {
                        Ok((state, _)) => state,
                        Err(poisoned) => poisoned.into_inner().0,
                    };
                    continue;
                }
            };
            let all = match self.file.parallel_reads() {
                0 | 1 => vec![wanted],
                _ => state.with_neighbors(wanted),
            };
            let entries: Vec<PageEntry> = all.iter().map(|own| own.entry).collect();
            state.reading.extend(entries.iter().map(|entry| entry.id));
            drop(state);
            let results = self.file.read_neighbors(&entries, self.options.decode);
            state = self.state();
            for (wanted, result) in all.into_iter().zip(results) {
                state.end_read(wanted, result, &self.options);
            }
            self.changed.notify_all();
        }
    }
}

/// Reads the pages that are wanted, in threads of its own, until it is dropped.
///
/// A page that is damaged is said once ([`PageLoader::messages`]), and once for all pages where a file gives no bytes. It is tried
/// again with growing pauses while it is wanted; meanwhile the cut draws what stands for it.
#[derive(Debug)]
pub struct PageLoader {
    shared: Arc<SharedLoader>,
    threads: Vec<JoinHandle<()>>,
}

impl PageLoader {
    /// Begins with nothing wanted.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn new(file: PagedFile, options: LoaderOptions) -> std::io::Result<Self> {
        let mut loader = Self {
            shared: Arc::new(SharedLoader {
                file,
                options,
                state: Mutex::default(),
                changed: Condvar::new(),
            }),
            threads: Vec::new(),
        };
        for index in 0..options.threads.max(1) {
            let shared = loader.shared.clone();
            let thread = std::thread::Builder::new().name(format!("page loader {index}"));
            loader.threads.push(thread.spawn(move || shared.work())?);
        }
        Ok(loader)
    }

    /// What is wanted from now on, the largest first. Pages that were wanted before and are not any more are dropped, but
    /// for those that are being read.
    pub fn want(&self, wanted: &[WantedPage]) {
        let mut state = self.shared.state();
        let known: BTreeSet<u32> = state.done.iter().map(|page| page.id).collect();
        let is_new = |wanted: &&WantedPage| {
            !state.reading.contains(&wanted.entry.id) && !known.contains(&wanted.entry.id)
        };
        state.queue = wanted.iter().rev().filter(is_new).copied().collect();
        self.shared.changed.notify_all();
    }

    /// The pages that were read since the last call, in the order in which they came.
    pub fn take(&self) -> Vec<LoadedPage> {
        std::mem::take(&mut self.shared.state().done)
    }

    /// Tells whether there are pages that were not taken yet.
    pub fn has_pages(&self) -> bool {
        !self.shared.state().done.is_empty()
    }

    /// Tells whether nothing is under way, and all that waits has failed before.
    pub fn is_stuck(&self) -> bool {
        self.shared.state().is_stuck()
    }

    /// The messages since the last call: one for each page that is damaged, and for each file that gives no bytes.
    pub fn messages(&self) -> Vec<String> {
        std::mem::take(&mut self.shared.state().messages)
    }

    /// Number of pages that wait or are being read.
    pub fn pending(&self) -> usize {
        let state = self.shared.state();
        state.queue.len() + state.reading.len()
    }

    /// Waits until some page was read, or nothing is under way but what failed, or the time is over.
    pub fn wait(&self, longest: Duration) {
        let end = Instant::now() + longest;
        let mut state = self.shared.state();
        loop {
            let now = Instant::now();
            if !state.done.is_empty() || state.is_stuck() || now >= end {
                return;
            }
            state = match self.shared.changed.wait_timeout(state, end - now) {
                Ok((state, _)) => state,
                Err(poisoned) => poisoned.into_inner().0,
            };
        }
    }
}

impl Drop for PageLoader {
    fn drop(&mut self) {
        self.shared.state().is_over = true;
        self.shared.changed.notify_all();
        for thread in self.threads.drain(..) {
            // A thread that panicked has said so.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    use crate::pages::format::HEADER;
    use crate::pages::source::{ByteSource, MemorySource};
    use crate::pages::tests::{GeneratedShape, SMALL_PAGES, model};
    use crate::pages::write::to_bytes;
    use std::io;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Waits at a gate before each page, notes the order, and fails where it is told to.
    #[derive(Debug)]
    struct GatedSource {
        inner: MemorySource,
        gate: Mutex<()>,
        order: Mutex<Vec<u64>>,
        /// Reads of this place fail as often as this.
        broken: u64,
        failures: AtomicU32,
    }

    impl ByteSource for GatedSource {
        fn name(&self) -> &str {
            self.inner.name()
        }

        fn len(&self) -> u64 {
            self.inner.len()
        }

        fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
            if offset >= HEADER as u64 {
                self.order.lock().unwrap().push(offset);
                drop(self.gate.lock().unwrap());
                let left = self.failures.load(Ordering::Relaxed);
                if offset == self.broken && left > 0 {
                    self.failures.store(left - 1, Ordering::Relaxed);
                    return Err(io::Error::other("no network"));
                }
            }
            self.inner.read_at(offset, out)
        }
    }

    struct LoaderScene {
        source: Arc<GatedSource>,
        loader: PageLoader,
        entries: Vec<PageEntry>,
    }

    fn scene(failures: u32) -> LoaderScene {
        let whole = model(GeneratedShape::Torus, 3000, true);
        let bytes = to_bytes(&whole, &SMALL_PAGES).unwrap();
        let memory = MemorySource::new("t.surfel", bytes);
        let file = PagedFile::open(Arc::new(memory.clone())).unwrap();
        let top = file
            .read_page(&file.root().unwrap(), DecodeOptions::default())
            .unwrap();
        let entries = top.children.unwrap().entries;
        let source = Arc::new(GatedSource {
            inner: memory,
            gate: Mutex::new(()),
            order: Mutex::default(),
            broken: entries[0].offset,
            failures: AtomicU32::new(failures),
        });
        let options = LoaderOptions {
            threads: 1,
            first_pause: Duration::from_millis(5),
            ..LoaderOptions::default()
        };
        let file = PagedFile::open(source.clone()).unwrap();
        LoaderScene {
            loader: PageLoader::new(file, options).unwrap(),
            source,
            entries,
        }
    }

    fn wanted(entries: &[PageEntry]) -> Vec<WantedPage> {
        let sized = |(entry, size): (&PageEntry, u32)| WantedPage {
            entry: *entry,
            size_px: 1000.0 - size as f32,
        };
        entries.iter().zip(0..).map(sized).collect()
    }

    fn all(loader: &PageLoader, count: usize) -> Vec<LoadedPage> {
        let mut pages = Vec::new();
        for _ in 0..2000 {
            pages.extend(loader.take());
            if pages.len() >= count {
                break;
            }
            loader.wait(Duration::from_millis(10));
            std::thread::sleep(Duration::from_millis(1));
        }
        pages
    }

    #[test]
    fn the_most_wanted_comes_first_and_what_is_not_wanted_any_more_is_dropped() {
        let LoaderScene {
            source,
            loader,
            entries,
        } = scene(0);
        assert!(entries.len() > 6);
        let gate = source.gate.lock().unwrap();
        loader.want(&wanted(&entries[1..6]));
        // The first is being read; what waits is replaced.
        while source.order.lock().unwrap().is_empty() {
            std::thread::sleep(Duration::from_millis(1));
        }
        loader.want(&wanted(&[entries[1], entries[4], entries[3]]));
        assert_eq!(loader.pending(), 3);
        drop(gate);
        let ids: Vec<u32> = all(&loader, 3).iter().map(|page| page.id).collect();
        assert_eq!(ids, [entries[1].id, entries[4].id, entries[3].id]);
        assert_eq!(loader.pending(), 0);
        let order = source.order.lock().unwrap().clone();
        assert_eq!(
            order,
            [entries[1].offset, entries[4].offset, entries[3].offset]
        );
        assert!(loader.messages().is_empty());
    }

    #[test]
    fn a_page_that_fails_is_said_once_and_tried_again() {
        let LoaderScene {
            source,
            loader,
            entries,
        } = scene(3);
        let start = Instant::now();
        loader.want(&wanted(&entries[..2]));
        let ids: Vec<u32> = all(&loader, 2).iter().map(|page| page.id).collect();
        // The other does not wait for it.
        assert_eq!(ids, [entries[1].id, entries[0].id]);
        // Pauses of 5, 10 and 20 ms.
        assert!(start.elapsed() >= Duration::from_millis(35));
        assert_eq!(source.order.lock().unwrap().len(), 5);
        let messages = loader.messages();
        assert_eq!(messages.len(), 1, "{messages:?}");
        assert!(messages[0].contains("t.surfel, bytes") && messages[0].contains("no network"));
        assert!(loader.messages().is_empty());
    }

    #[test]
    fn dropping_it_ends_its_threads_whatever_waits() {
        let LoaderScene {
            source,
            loader,
            entries,
        } = scene(u32::MAX);
        loader.want(&wanted(&entries[..1]));
        loader.wait(Duration::from_secs(5));
        assert_eq!(loader.take().len(), 0);
        drop(loader);
        assert_eq!(Arc::strong_count(&source), 1);
    }
}
