//! Decoded pages in memory under a budget of bytes.

use super::cut::ResidentPages;
use super::page::DecodedPage;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A page in memory.
#[derive(Debug)]
struct CachedPage {
    page: Arc<DecodedPage>,
    bytes: u64,
    /// The frame that needed it last.
    frame: u64,
}

/// Bytes of memory that the system has free; `None` where it does not say.
pub fn free_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text
        .lines()
        .find(|line| line.starts_with("MemAvailable:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

/// The usual budget: half of the memory that the system has free, at most 4 GiB; 1 GiB where it does not say.
pub fn usual_budget() -> u64 {
    const MOST: u64 = 4 << 30;
    const UNKNOWN: u64 = 1 << 30;
    free_memory().map_or(UNKNOWN, |free| (free / 2).min(MOST))
}

/// What taking in a page changed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CacheChange {
    /// The page is in memory.
    pub is_held: bool,
    /// Numbers of the pages that went for it.
    pub gone: Vec<u32>,
}

/// Pages by number. What was needed least recently goes first; what the present frame needs stays.
#[derive(Debug)]
pub struct PageCache {
    budget: u64,
    bytes: u64,
    /// Of those, of pages that the present frame needs.
    pinned: u64,
    frame: u64,
    pages: BTreeMap<u32, CachedPage>,
    /// Pages by the frame that needed them last.
    order: BTreeSet<(u64, u32)>,
}

impl PageCache {
    /// Holds pages of at most `budget` bytes in all, and more only where the present frame needs them.
    pub fn new(budget: u64) -> Self {
        Self {
            budget,
            bytes: 0,
            pinned: 0,
            frame: 0,
            pages: BTreeMap::new(),
            order: BTreeSet::new(),
        }
    }

    /// Bytes of all pages in memory.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Number of pages in memory.
    pub fn len(&self) -> usize {
        self.pages.len()
    }

    /// Tells whether no page is in memory.
    pub fn is_empty(&self) -> bool {
        self.pages.is_empty()
    }

    /// All pages in memory, by number.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &Arc<DecodedPage>)> {
        self.pages.iter().map(|(&id, own)| (id, &own.page))
    }

    /// A new frame, which needs these pages; unknown ones are passed over.
    pub fn begin_frame(&mut self, needed: &[u32]) {
        self.frame += 1;
        self.pinned = 0;
        for &id in needed {
            self.need(id);
        }
    }

    /// Notes that the present frame needs a page.
    fn need(&mut self, id: u32) {
        if let Some(own) = self.pages.get_mut(&id)
            && own.frame != self.frame
        {
            self.order.remove(&(own.frame, id));
            own.frame = self.frame;
            self.order.insert((own.frame, id));
            self.pinned += own.bytes;
        }
    }

    /// Takes a page in, as one that the present frame needs, and lets others go until all fit. A page that does not fit
    /// beside what the present frame needs is not taken. The first page of all always is.
    pub fn insert(&mut self, id: u32, page: Arc<DecodedPage>) -> CacheChange {
        let bytes = page.memory_bytes();
        let mut change = CacheChange::default();
        if self.pages.contains_key(&id) {
            self.need(id);
            change.is_held = true;
            return change;
        }
        if self.pinned + bytes > self.budget && !self.pages.is_empty() {
            return change;
        }
        change.is_held = true;
        self.bytes += bytes;
        self.pinned += bytes;
        self.order.insert((self.frame, id));
        let frame = self.frame;
        self.pages.insert(id, CachedPage { page, bytes, frame });
        while self.bytes > self.budget {
            let Some(&(frame, oldest)) = self.order.first() else {
                break;
            };
            if frame == self.frame {
                break;
            }
            self.order.remove(&(frame, oldest));
            if let Some(gone) = self.pages.remove(&oldest) {
                self.bytes -= gone.bytes;
            }
            change.gone.push(oldest);
        }
        change
    }
}

impl ResidentPages for PageCache {
    fn page(&self, id: u32) -> Option<Arc<DecodedPage>> {
        self.pages.get(&id).map(|own| own.page.clone())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    use crate::pages::page::DecodeOptions;
    use crate::pages::tests::{GeneratedShape, SMALL_PAGES, model, opened};
    use crate::pages::write::to_bytes;

    fn page() -> Arc<DecodedPage> {
        let whole = model(GeneratedShape::Square, 40, true);
        let file = opened(to_bytes(&whole, &SMALL_PAGES).unwrap()).unwrap();
        let page = file.read_page(&file.root().unwrap(), DecodeOptions::default());
        Arc::new(page.unwrap())
    }

    fn ids(cache: &PageCache) -> Vec<u32> {
        (0..20).filter(|&id| cache.page(id).is_some()).collect()
    }

    #[test]
    fn the_least_recently_needed_goes_first_and_the_needed_stay() {
        let page = page();
        let bytes = page.memory_bytes();
        assert!(bytes > 1000);
        let mut cache = PageCache::new(3 * bytes + bytes / 2);
        assert!(cache.is_empty());
        for id in [5, 6, 7] {
            cache.begin_frame(&[]);
            assert!(cache.insert(id, page.clone()).is_held);
        }
        assert_eq!(
            (ids(&cache), cache.bytes(), cache.len()),
            (vec![5, 6, 7], 3 * bytes, 3)
        );
        // 5 is needed again, so 6 is the oldest.
        cache.begin_frame(&[5, 19]);
        let change = cache.insert(8, page.clone());
        assert_eq!((change.is_held, change.gone), (true, vec![6]));
        assert_eq!(ids(&cache), [5, 7, 8]);
        // All that fits is needed: nothing more comes in.
        cache.begin_frame(&[5, 7, 8]);
        assert_eq!(cache.insert(9, page.clone()), CacheChange::default());
        assert!(cache.insert(8, page.clone()).is_held);
        assert_eq!(ids(&cache), [5, 7, 8]);
        cache.begin_frame(&[8]);
        assert_eq!(cache.insert(9, page.clone()).gone, [5]);
        assert_eq!(cache.insert(10, page.clone()).gone, [7]);
        assert_eq!(ids(&cache), [8, 9, 10]);
        assert_eq!(cache.bytes(), 3 * bytes);
        // However small the budget, the first page is there.
        let mut small = PageCache::new(1);
        assert!(small.insert(0, page.clone()).is_held && !small.insert(1, page).is_held);
        assert_eq!(ids(&small), [0]);
    }
}
