//! The cut over the pages that are in memory, and the pages that it wants.
//!
//! Each page is cut as a small model by the same tests as a whole one. The leaves of an upper page are nodes of the pages
//! below: one that is small enough is drawn as it is; of one that is not, the page is cut where it is in memory, and
//! else it is wanted and drawn as it is meanwhile. So nothing is ever missing, only coarser.

use super::format::PageEntry;
use super::page::DecodedPage;
use crate::cut::{
    CutSelector, CutSettings, CutStats, FacingTest, NodeTester, PartMarks, PartTests, SharedDepth,
    SplatFootprints, WholeSphere,
};
use crate::math::camera::View;
use crate::patches::{PatchCut, PatchSelector};
use crate::threads;
use std::sync::Arc;

/// The pages that are in memory.
pub trait ResidentPages {
    /// A page, where it is there.
    fn page(&self, id: u32) -> Option<Arc<DecodedPage>>;
}

/// What is drawn of a page.
#[derive(Debug, Clone)]
pub struct PagePart {
    /// The page's number.
    pub id: u32,
    /// The page: ids are of its model.
    pub page: Arc<DecodedPage>,
    /// What is drawn. Leaves of upper pages stand for the pages below them, as points.
    pub cut: PatchCut,
}

/// A page that is needed for the picture, but is not in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WantedPage {
    /// Where it lies.
    pub entry: PageEntry,
    /// How wide its root is on the screen, pixels; infinite where it reaches the near plane.
    pub size_px: f32,
}

/// A page in memory that a cut walked over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeededPage {
    /// The page's number.
    pub id: u32,
    /// Width of its root on the screen, as of [`WantedPage`].
    pub size_px: f32,
}

/// The cut over pages.
#[derive(Debug, Clone, Default)]
pub struct PagedCut {
    /// What is drawn, page by page, in the order of the file.
    pub parts: Vec<PagePart>,
    /// Pages that would make the picture finer, the largest first.
    pub wanted: Vec<WantedPage>,
    /// All pages that were walked over, by ascending number: they must stay in memory for this cut to come out again.
    pub needed: Vec<NeededPage>,
    /// The work, added up.
    pub stats: CutStats,
}

/// Chooses the cut of one page's model: told selectors, what is asked, and where the cut goes.
pub type PageChoice<'a> = dyn Fn(&mut PageSelectors, PageQuestion<'_>, &mut PatchCut) + Sync + 'a;

/// Question about one page: what of it is drawn.
#[derive(Debug)]
pub struct PageQuestion<'a> {
    /// The page's number.
    pub id: u32,
    /// The page.
    pub page: &'a DecodedPage,
    /// Keeps what faces away, and lets nothing hide anything.
    pub keeps_back: bool,
    /// Depths and tests of pages that hide each other; `None` where they do not.
    pub hiding: Option<PageHiding<'a>>,
}

/// Selectors with which a thread cuts pages.
#[derive(Debug)]
pub struct PageSelectors {
    /// Selector by the size of nodes.
    pub by_size: CutSelector,
    /// Selector by their errors as patches.
    pub by_error: PatchSelector,
    /// Working memory: what is drawn of a page from both sides.
    both_sides: PatchCut,
}

/// Depths and tests that leaf pages share, so that they hide each other.
#[derive(Debug)]
pub struct PageHiding<'a> {
    /// The depths that all share.
    pub depth: &'a SharedDepth,
    /// View and settings of all cuts.
    pub tests: &'a PartTests<'a>,
    /// Notes of the questions that the page asks.
    pub marks: &'a mut PartMarks,
}

/// How the cut of a frame is chosen.
#[derive(Clone, Copy)]
pub struct PageTests<'a> {
    /// The view, in model space.
    pub view: &'a View,
    /// What decides which nodes and pages are drawn.
    pub settings: &'a CutSettings,
    /// Chooses what is drawn of a page, by these settings.
    pub choose: &'a PageChoice<'a>,
    /// Shape of splats, and a sphere around all pages; none where pages do not hide each other.
    pub hides: Option<(SplatFootprints, WholeSphere)>,
}

/// What was found of one page.
#[derive(Debug, Default)]
struct PageVerdict {
    cut: PatchCut,
    /// Notes of the questions that are asked again once all pages are cut.
    marks: PartMarks,
    /// Tells whether there are such notes.
    is_marked: bool,
    /// Pages below it with a leaf that is too large to be drawn as a splat, whether they are there or not, in their order.
    open: Vec<OpenPage>,
    /// Leaves that are so large, ascending.
    large: Vec<u32>,
}

/// A page below another.
#[derive(Debug, Clone, Copy)]
struct OpenPage {
    /// Index of its entry.
    index: usize,
    wanted: WantedPage,
}

impl PageVerdict {
    /// Empties it and keeps its memory.
    fn clear(&mut self) {
        self.cut.clear();
        self.is_marked = false;
        self.open.clear();
        self.large.clear();
    }

    /// Leaves what is below pages in memory to these, and draws the leaves of those that are missing. Puts the former into `band`,
    /// the latter into `missing`.
    fn settle(
        &mut self,
        page: &DecodedPage,
        pages: &(dyn ResidentPages + Sync),
        (band, missing): (&mut Vec<WantedPage>, &mut Vec<WantedPage>),
    ) {
        let Some(below) = &page.children else { return };
        let tree = &page.model.tree;
        let mut is_open = vec![false; below.entries.len()];
        for open in &self.open {
            is_open[open.index] = pages.page(open.wanted.entry.id).is_some();
            match is_open[open.index] {
                true => band.push(open.wanted),
                false => missing.push(open.wanted),
            }
        }
        let PatchCut {
            patches, rest: cut, ..
        } = &mut self.cut;
        let is_left = |index: usize| !is_open.get(index).copied().unwrap_or(false);
        if below.shared_levels > 0 && !self.open.is_empty() {
            let is_own = |node: u32| below.page_of_node(node).is_none_or(is_left);
            patches.retain(|&node| is_own(node));
            cut.nodes.retain(|&node| is_own(node));
            cut.strips.retain(|strip| is_own(strip.node));
            cut.leaves
                .retain(|&leaf| is_left(below.page_of_leaf(tree, leaf)));
        }
        let large = self.large.iter();
        let drawn = large.filter(|&&leaf| is_left(below.page_of_leaf(tree, leaf)));
        cut.leaves.extend(drawn);
        cut.leaves.sort_unstable();
    }
}

/// Cuts over pages, and keeps its working memory from one to the next.
#[derive(Debug)]
pub struct PageCutSelector {
    /// Selectors of each thread. Pages are small: many are cut at once, each by one thread.
    workers: Vec<PageSelectors>,
    depth: SharedDepth,
    /// Verdicts and cuts of earlier frames. Threads that fill new ones wait for each other in the allocator.
    spare: Vec<PageVerdict>,
    spare_cuts: Vec<PatchCut>,
}

impl Default for PageCutSelector {
    fn default() -> Self {
        let worker = || PageSelectors {
            by_size: CutSelector::with_threads(1),
            by_error: PatchSelector::with_threads(1),
            both_sides: PatchCut::default(),
        };
        Self {
            workers: (0..threads::count()).map(|_| worker()).collect(),
            depth: SharedDepth::default(),
            spare: Vec::new(),
            spare_cuts: Vec::new(),
        }
    }
}

impl PageCutSelector {
    /// As [`CutSelector::with_subpixel_bits`].
    #[must_use]
    pub fn with_subpixel_bits(mut self, bits: u32) -> Self {
        let workers = std::mem::take(&mut self.workers).into_iter();
        self.workers = workers
            .map(|worker| PageSelectors {
                by_size: worker.by_size.with_subpixel_bits(bits),
                ..worker
            })
            .collect();
        self
    }

    /// Takes a cut that is no longer drawn: the next one uses its memory.
    pub fn recycle(&mut self, old: PagedCut) {
        self.spare_cuts
            .extend(old.parts.into_iter().map(|part| part.cut));
    }

    /// An empty verdict with the memory of an earlier one.
    fn spare_verdict(&mut self) -> PageVerdict {
        let mut verdict = self.spare.pop().unwrap_or_default();
        if let Some(cut) = self.spare_cuts.pop() {
            verdict.cut = cut;
        }
        verdict.clear();
        verdict
    }

    /// Leaves out of all pages what any of them hides.
    fn leave_out_hidden(
        &mut self,
        depth: &SharedDepth,
        tests: &PartTests<'_>,
        all: &mut [FoundPage],
    ) {
        let work = all.iter().filter(|own| own.verdict.is_marked);
        threads::share(&mut self.workers, work, |_, own| {
            depth.repair(tests, &own.verdict.marks);
        });
        let work = all.iter_mut().filter(|own| own.verdict.is_marked);
        threads::share(&mut self.workers, work, |_, own| {
            let PageVerdict { cut, marks, .. } = &mut own.verdict;
            depth.finish(tests, &mut cut.rest, marks);
        });
    }

    /// The cut over the pages below `root`, all of them in model space ([`DecodedPage::in_model_space`]). Where nothing is
    /// in memory it draws nothing and wants the first page.
    pub fn select(
        &mut self,
        root: Option<PageEntry>,
        pages: &(dyn ResidentPages + Sync),
        tests: PageTests<'_>,
    ) -> PagedCut {
        let mut out = PagedCut::default();
        let first = root.map(|entry| WantedPage {
            entry,
            size_px: f32::INFINITY,
        });
        let mut shared = std::mem::take(&mut self.depth);
        let hides = (tests.hides).filter(|(_, whole)| shared.begin(tests.view, *whole));
        let hiding = hides.map(|(footprints, _)| PartTests {
            view: tests.view,
            settings: tests.settings,
            footprints,
        });
        let depth = &shared;
        let hiding = hiding.as_ref().map(|tests| (depth, tests));
        let mut band: Vec<WantedPage> = first.into_iter().collect();
        let mut all: Vec<FoundPage> = Vec::new();
        while !band.is_empty() {
            // Pages of one band do not depend on one another.
            let mut found: Vec<FoundPage> = Vec::new();
            for own in band.drain(..) {
                match pages.page(own.entry.id) {
                    Some(page) => found.push(FoundPage::new(own, page, self.spare_verdict())),
                    None => out.wanted.push(own),
                }
            }
            let mut work: Vec<&mut FoundPage> = found.iter_mut().collect();
            if hiding.is_some() {
                // What is near hides what is far.
                work.sort_by_cached_key(|own| own.distance_key(tests.view));
            }
            threads::share(&mut self.workers, work.into_iter(), |worker, own| {
                look_at(worker, own, tests, hiding);
            });
            for mut own in found {
                out.needed.push(NeededPage {
                    id: own.id,
                    size_px: own.size_px,
                });
                let missing = &mut out.wanted;
                own.verdict.settle(&own.page, pages, (&mut band, missing));
                all.push(own);
            }
        }
        if let Some((depth, tests)) = hiding {
            self.leave_out_hidden(depth, tests, &mut all);
        }
        for own in all {
            let FoundPage {
                id,
                page,
                mut verdict,
                ..
            } = own;
            out.stats.add(&verdict.cut.rest.stats);
            if verdict.cut.primitives() > 0 {
                let cut = std::mem::take(&mut verdict.cut);
                out.parts.push(PagePart { id, page, cut });
            }
            self.spare.push(verdict);
        }
        self.depth = shared;
        out.wanted.sort_by(|a, b| {
            b.size_px
                .total_cmp(&a.size_px)
                .then(a.entry.id.cmp(&b.entry.id))
        });
        out
    }
}

/// A page in memory that is walked over.
#[derive(Debug)]
struct FoundPage {
    id: u32,
    size_px: f32,
    page: Arc<DecodedPage>,
    verdict: PageVerdict,
}

impl FoundPage {
    fn new(wanted: WantedPage, page: Arc<DecodedPage>, verdict: PageVerdict) -> Self {
        Self {
            id: wanted.entry.id,
            size_px: wanted.size_px,
            page,
            verdict,
        }
    }

    /// Distance of the middle along the view direction, as a number that orders.
    fn distance_key(&self, view: &View) -> i64 {
        let center = WholeSphere::of(&self.page.model).center;
        let z = view.view_from_model.transform_point3(center).z;
        // Floats that are not negative order like their bits.
        let bits = i64::from(z.abs().to_bits());
        if z > 0.0 { -bits } else { bits }
    }
}

/// Cuts a page with leaves of the model.
fn look_at_leaves(
    selectors: &mut PageSelectors,
    own: &mut FoundPage,
    tests: PageTests<'_>,
    hiding: Option<(&SharedDepth, &PartTests<'_>)>,
) {
    let FoundPage {
        id, page, verdict, ..
    } = own;
    if hiding.is_some_and(|(depth, tests)| depth.hides(tests, WholeSphere::of(&page.model))) {
        return;
    }
    verdict.is_marked = hiding.is_some();
    let marks = &mut verdict.marks;
    let hiding = hiding.map(|(depth, tests)| PageHiding {
        depth,
        tests,
        marks,
    });
    let asked = PageQuestion {
        id: *id,
        page,
        keeps_back: false,
        hiding,
    };
    (tests.choose)(selectors, asked, &mut verdict.cut);
}

/// Cuts one page. Its leaves that are drawn are in the cut; those to be opened are named.
///
/// Nodes of an upper page are replaced where pages below it are in memory, so that they hide nothing.
fn look_at(
    selectors: &mut PageSelectors,
    own: &mut FoundPage,
    tests: PageTests<'_>,
    hiding: Option<(&SharedDepth, &PartTests<'_>)>,
) {
    let PageTests {
        view,
        settings,
        choose,
        ..
    } = tests;
    let FoundPage {
        id, page, verdict, ..
    } = own;
    let PageVerdict {
        cut, open, large, ..
    } = verdict;
    let Some(below) = &page.children else {
        return look_at_leaves(selectors, own, tests, hiding);
    };
    let asked = |keeps_back| PageQuestion {
        id: *id,
        page,
        keeps_back,
        hiding: None,
    };
    choose(selectors, asked(false), cut);
    // The test of leaves is that of points, by one normal, which is not that of a whole page.
    let cut = &mut cut.rest;
    cut.leaves.clear();
    cut.triangles.clear();
    let mut all = std::mem::take(&mut selectors.both_sides);
    all.clear();
    choose(selectors, asked(true), &mut all);
    let tester = NodeTester::new(&page.model, view, settings);
    for &leaf in &all.rest.leaves {
        let sphere = page.model.tree.leaves[leaf as usize];
        let cone = below.cones[leaf as usize];
        let faces_away = settings.cull_back
            && tester.facing(sphere.center, sphere.radius, cone) == FacingTest::Away;
        if faces_away {
            continue;
        }
        if tester.is_small(sphere.center, sphere.radius) {
            cut.leaves.push(leaf);
            continue;
        }
        large.push(leaf);
        let index = below.page_of_leaf(&page.model.tree, leaf);
        if open.last().is_none_or(|last| last.index != index) {
            let (center, radius) = below.sphere(&page.model.tree, index);
            let wanted = WantedPage {
                entry: below.entries[index],
                size_px: tester.size_px(center, radius) as f32,
            };
            open.push(OpenPage { index, wanted });
        }
    }
    selectors.both_sides = all;
}

#[cfg(test)]
mod tests;
