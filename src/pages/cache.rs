//! Decoded pages in memory under a budget of bytes.

use super::cut::{NeededPage, ResidentPages};
use super::page::DecodedPage;
use crate::free_memory;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A page in memory.
#[derive(Debug)]
struct CachedPage {
    page: Arc<DecodedPage>,
    bytes: u64,
    /// Place among those that go.
    key: CacheKey,
}

/// Order in which pages go: by the frame that needed them last, then by the size that they had on the screen in it, then
/// by number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct CacheKey {
    frame: u64,
    /// Bits of the size in pixels: positive numbers order as their bits do.
    size: u32,
    id: u32,
}

impl CacheKey {
    fn new(frame: u64, page: NeededPage) -> Self {
        Self {
            frame,
            size: page.size_px.max(0.0).to_bits(),
            id: page.id,
        }
    }

    fn size_px(self) -> f32 {
        f32::from_bits(self.size)
    }
}

/// The usual budget: half of the memory that the system has free, at most 4 GiB; 1 GiB where it does not say.
pub fn usual_budget() -> u64 {
    const MOST: u64 = 4 << 30;
    const UNKNOWN: u64 = 1 << 30;
    free_memory::available().map_or(UNKNOWN, |free| (free / 2).min(MOST))
}

/// What taking in a page changed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CacheChange {
    /// The page is in memory.
    pub is_held: bool,
    /// Numbers of the pages that went for it.
    pub gone: Vec<u32>,
}

/// Pages by number. What was needed least recently goes first, pages with leaves before those that stand for others: these
/// are few, and without them a view from afar is coarse. What the present frame needs stays, but for pages at most
/// half as wide on the screen as one that is missing.
#[derive(Debug)]
pub struct PageCache {
    budget: u64,
    bytes: u64,
    /// Of those, of pages that the present frame needs.
    pinned: u64,
    frame: u64,
    pages: BTreeMap<u32, CachedPage>,
    /// Pages in the order in which they go: those with leaves, those that stand for others.
    orders: [BTreeSet<CacheKey>; 2],
}

/// Times that a page must be as large on the screen as one that the present frame needs to take its place. Above one, so that
/// pages of nearly one size do not take each other's place while the view moves.
const LARGER: f32 = 2.0;

/// Index of a page's order.
fn order_of(page: &DecodedPage) -> usize {
    usize::from(page.children.is_some())
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
            orders: Default::default(),
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
    pub fn begin_frame(&mut self, needed: &[NeededPage]) {
        self.frame += 1;
        self.pinned = 0;
        for &page in needed {
            self.need(page);
        }
    }

    /// Notes that the present frame needs a page.
    fn need(&mut self, page: NeededPage) {
        let key = CacheKey::new(self.frame, page);
        if let Some(own) = self.pages.get_mut(&page.id)
            && own.key.frame != self.frame
        {
            let order = &mut self.orders[order_of(&own.page)];
            order.remove(&own.key);
            own.key = key;
            order.insert(key);
            self.pinned += own.bytes;
        }
    }

    /// Takes a page in, as one that the present frame needs, and lets others go until all fit. A page that does not fit
    /// beside what the present frame needs, and is not much larger on the screen, is not taken. The first page of all always
    /// is.
    pub fn insert(&mut self, needed: NeededPage, page: Arc<DecodedPage>) -> CacheChange {
        let bytes = page.memory_bytes();
        let mut change = CacheChange::default();
        if self.pages.contains_key(&needed.id) {
            self.need(needed);
            change.is_held = true;
            return change;
        }
        let over = (self.pinned + bytes).saturating_sub(self.budget);
        if over > 0 && !self.pages.is_empty() {
            let Some(smaller) = self.smaller(needed.size_px, over) else {
                return change;
            };
            for key in smaller {
                self.pinned -= self.remove(key);
                change.gone.push(key.id);
            }
        }
        change.is_held = true;
        self.bytes += bytes;
        self.pinned += bytes;
        let key = CacheKey::new(self.frame, needed);
        self.orders[order_of(&page)].insert(key);
        self.pages
            .insert(needed.id, CachedPage { page, bytes, key });
        while self.bytes > self.budget {
            let firsts = self.orders.iter().map(|order| order.first());
            let unneeded = |key: &&CacheKey| key.frame != self.frame;
            let Some(&oldest) = firsts.flatten().find(unneeded) else {
                break;
            };
            self.remove(oldest);
            change.gone.push(oldest.id);
        }
        change
    }

    /// The smallest pages that the present frame needs, of so many bytes at least; `None` where some of them are not much
    /// smaller than this.
    fn smaller(&self, size_px: f32, mut bytes: u64) -> Option<Vec<CacheKey>> {
        let from = CacheKey {
            frame: self.frame,
            size: 0,
            id: 0,
        };
        let [leaves, upper] = &self.orders;
        let mut needed: Vec<CacheKey> = leaves
            .range(from..)
            .chain(upper.range(from..))
            .copied()
            .collect();
        needed.sort_unstable();
        let mut out = Vec::new();
        for key in needed {
            if bytes == 0 {
                break;
            }
            if key.size_px() * LARGER > size_px {
                return None;
            }
            bytes = bytes.saturating_sub(self.pages.get(&key.id)?.bytes);
            out.push(key);
        }
        (bytes == 0).then_some(out)
    }

    /// Lets a page go, and gives the bytes that it had.
    fn remove(&mut self, key: CacheKey) -> u64 {
        let Some(gone) = self.pages.remove(&key.id) else {
            return 0;
        };
        self.orders[order_of(&gone.page)].remove(&key);
        self.bytes -= gone.bytes;
        gone.bytes
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

    #[test]
    fn pages_that_stand_for_others_go_last() {
        let whole = model(GeneratedShape::Sphere, 4000, false);
        let file = opened(to_bytes(&whole, &SMALL_PAGES).unwrap()).unwrap();
        let read = |entry| Arc::new(file.read_page(&entry, DecodeOptions::default()).unwrap());
        let top = read(file.root().unwrap());
        let leaves = read(top.children.as_ref().unwrap().entries[0]);
        assert!(leaves.children.is_none());
        let mut cache = PageCache::new(top.memory_bytes() + 2 * leaves.memory_bytes());
        cache.begin_frame(&[]);
        cache.insert(sized(1, 9.0), top.clone());
        for id in [5, 6, 7, 8] {
            cache.begin_frame(&[]);
            let gone = cache.insert(sized(id, 9.0), leaves.clone()).gone;
            assert_eq!(gone, if id > 6 { vec![id - 2] } else { vec![] });
        }
        // Where all with leaves are needed, they go as well.
        cache.begin_frame(&[sized(7, 9.0), sized(8, 9.0)]);
        assert_eq!(cache.insert(sized(9, 9.0), leaves).gone, [1]);
        assert_eq!(ids(&cache), [7, 8, 9]);
    }

    fn sized(id: u32, size_px: f32) -> NeededPage {
        NeededPage { id, size_px }
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
            assert!(cache.insert(sized(id, 9.0), page.clone()).is_held);
        }
        assert_eq!(
            (ids(&cache), cache.bytes(), cache.len()),
            (vec![5, 6, 7], 3 * bytes, 3)
        );
        // 5 is needed again, so 6 is the oldest.
        cache.begin_frame(&[sized(5, 9.0), sized(19, 9.0)]);
        let change = cache.insert(sized(8, 9.0), page.clone());
        assert_eq!((change.is_held, change.gone), (true, vec![6]));
        assert_eq!(ids(&cache), [5, 7, 8]);
        // All that fits is needed: nothing more comes in.
        cache.begin_frame(&[sized(5, 9.0), sized(7, 9.0), sized(8, 9.0)]);
        assert_eq!(
            cache.insert(sized(9, 9.0), page.clone()),
            CacheChange::default()
        );
        assert!(cache.insert(sized(8, 9.0), page.clone()).is_held);
        assert_eq!(ids(&cache), [5, 7, 8]);
        cache.begin_frame(&[sized(8, 9.0)]);
        assert_eq!(cache.insert(sized(9, 9.0), page.clone()).gone, [5]);
        assert_eq!(cache.insert(sized(10, 9.0), page.clone()).gone, [7]);
        assert_eq!(ids(&cache), [8, 9, 10]);
        assert_eq!(cache.bytes(), 3 * bytes);
        // A page of twice the size takes the place of the smallest, one of less does not.
        cache.begin_frame(&[sized(8, 30.0), sized(9, 20.0), sized(10, 25.0)]);
        let change = cache.insert(sized(11, 39.0), page.clone());
        assert_eq!(change, CacheChange::default());
        let change = cache.insert(sized(11, 40.0), page.clone());
        assert_eq!((change.is_held, change.gone), (true, vec![9]));
        assert_eq!((ids(&cache), cache.bytes()), (vec![8, 10, 11], 3 * bytes));
        // However small the budget, the first page is there.
        let mut small = PageCache::new(1);
        assert!(
            small.insert(sized(0, 9.0), page.clone()).is_held
                && !small.insert(sized(1, 9.0), page).is_held
        );
        assert_eq!(ids(&small), [0]);
    }
}
