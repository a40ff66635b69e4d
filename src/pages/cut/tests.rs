#![allow(clippy::unwrap_used, reason = "a test may panic")]

use super::*;

use crate::cut::Cut;
use crate::mesh::Mesh;
use crate::pages::file::PagedFile;
use crate::pages::join::whole_model;
use crate::pages::page::DecodeOptions;
use crate::pages::tests::{GeneratedShape, SMALL_PAGES, model, opened};
use crate::pages::write::{PagedOptions, to_bytes, to_bytes_with_patches};
use crate::patches::{ErrorTolerances, PatchCutSettings, ResidentPatches};
use crate::progress::SilentProgress;
use crate::tree::{self, BuildOptions, Model};
use glam::Vec3;
use std::collections::{BTreeMap, BTreeSet};

const LARGE_PAGES: PagedOptions = PagedOptions {
    page_leaves: 1024,
    colors: None,
};

/// Levels that the first page shares with those below it.
fn shared_levels_of(file: &PagedFile) -> usize {
    let top = file
        .read_page(&file.root().unwrap(), in_space_of(file))
        .unwrap();
    top.children.unwrap().shared_levels
}

fn in_space_of(file: &PagedFile) -> DecodeOptions {
    DecodeOptions {
        moments: false,
        model_origin: Some(file.origin()),
    }
}

/// The cut of a file by the plain tests of a tree.
fn selected(
    selector: &mut PageCutSelector,
    file: &PagedFile,
    pages: &KnownPages,
    (view, settings): (&View, &CutSettings),
) -> PagedCut {
    let choose = |selectors: &mut PageSelectors, asked: PageQuestion<'_>, cut: &mut PatchCut| {
        let settings = CutSettings {
            cull_back: settings.cull_back && !asked.keeps_back,
            ..*settings
        };
        let model = &asked.page.model;
        (selectors.by_size).select(model, view, &settings, &mut cut.rest);
    };
    let tests = PageTests {
        view,
        settings,
        choose: &choose,
        hides: None,
    };
    selector.select(file.root(), pages, tests)
}

/// Pages in memory, and numbers in the joined model of the first node of each level and the first leaf.
struct KnownPages {
    pages: BTreeMap<u32, Arc<DecodedPage>>,
    places: BTreeMap<u32, (Vec<u32>, u32)>,
}

impl ResidentPages for KnownPages {
    fn page(&self, id: u32) -> Option<Arc<DecodedPage>> {
        self.pages.get(&id).cloned()
    }
}

fn all_pages(file: &PagedFile, joined: &Model) -> KnownPages {
    let mut known = KnownPages {
        pages: BTreeMap::new(),
        places: BTreeMap::new(),
    };
    let mut wanted = vec![file.root().unwrap()];
    let (mut level, mut next_leaf) = (0, 0);
    while !wanted.is_empty() {
        let mut below = Vec::new();
        let mut levels = 0;
        let mut starts: Vec<u32> = joined.tree.level_starts[level..].to_vec();
        for entry in wanted {
            let page = file.read_page(&entry, in_space_of(file)).unwrap();
            let tree = &page.model.tree;
            let count = tree.level_count();
            levels = count
                - page
                    .children
                    .as_ref()
                    .map_or(0, |below| below.shared_levels);
            known.places.insert(entry.id, (starts.clone(), next_leaf));
            for (l, start) in starts.iter_mut().enumerate().take(count) {
                *start += tree.level(l).len() as u32;
            }
            // The leaves of an upper page are nodes of the model.
            if page.children.is_some() {
                starts[count] += tree.leaf_count();
            }
            match &page.children {
                Some(children) => below.extend(children.entries.iter().copied()),
                None => next_leaf += page.model.tree.leaf_count(),
            }
            known.pages.insert(entry.id, Arc::new(page));
        }
        level += levels;
        wanted = below;
    }
    known
}

/// Ids of the joined model that a cut over pages draws: nodes, leaves, triangles.
fn in_joined(cut: &PagedCut, known: &KnownPages, joined: &Model) -> [BTreeSet<u32>; 3] {
    let mut out: [BTreeSet<u32>; 3] = Default::default();
    for part in &cut.parts {
        let tree = &part.page.model.tree;
        let (starts, first_leaf) = &known.places[&part.id];
        let strips = part.cut.rest.strips.iter().map(|strip| strip.node);
        for id in part.cut.rest.nodes.iter().copied().chain(strips) {
            let level = tree.level_of(id);
            assert!(out[0].insert(starts[level] + id - tree.level(level).start));
        }
        for &leaf in &part.cut.rest.leaves {
            let is_new = match &part.page.children {
                // A node of the page below.
                Some(_) => out[0].insert(starts[tree.level_count()] + leaf),
                None => out[1].insert(first_leaf + leaf),
            };
            assert!(is_new);
        }
        out[2].extend(part.cut.rest.triangles.iter().map(|t| first_leaf + t));
    }
    let _ = joined;
    out
}

#[test]
fn over_all_pages_it_is_the_cut_of_the_whole_tree() {
    // Small pages are leaves of the page above; large ones share two levels with it.
    for (is_cloud, pages, shared) in [
        (false, SMALL_PAGES, 0),
        (true, SMALL_PAGES, 0),
        (false, LARGE_PAGES, 2),
        (true, LARGE_PAGES, 2),
    ] {
        let whole = model(GeneratedShape::Statue, 12_000, is_cloud);
        let file = opened(to_bytes(&whole, &pages).unwrap()).unwrap();
        assert_eq!(shared_levels_of(&file), shared);
        let joined = whole_model(&file, &SilentProgress).unwrap();
        let known = all_pages(&file, &joined);
        let mut selector = PageCutSelector::default();
        for (fill, threshold_px, cull_back) in [
            (1.0, 1.0, true),
            (1.0, 8.0, true),
            (6.0, 2.0, false),
            (30.0, 1.0, true),
            (0.05, 4.0, false),
        ] {
            let camera = joined.orbit_camera((640, 480), 0.7, 0.3, fill);
            let settings = CutSettings {
                threshold_px,
                cull_back: cull_back && !is_cloud,
                ..CutSettings::default()
            };
            let view = camera.view(joined.origin).unwrap();
            let found = selected(&mut selector, &file, &known, (&view, &settings));
            assert!(found.wanted.is_empty());
            let ids = in_joined(&found, &known, &joined);
            let mut expected = Cut::default();
            CutSelector::default().select(&joined, &view, &settings, &mut expected);
            let strips = expected.strips.iter().map(|strip| strip.node);
            let lists = [
                expected
                    .nodes
                    .iter()
                    .copied()
                    .chain(strips)
                    .collect::<BTreeSet<u32>>(),
                expected.leaves.into_iter().collect(),
                expected.triangles.into_iter().collect(),
            ];
            // Pages have zeros of their own: what is at a limit may be rounded to the other side.
            let count: usize = lists.iter().map(BTreeSet::len).sum();
            let off: usize = ids
                .iter()
                .zip(&lists)
                .map(|(a, b)| a.symmetric_difference(b).count())
                .sum();
            if fill < 0.1 {
                // Far off all is in the upper pages, in which rows of splats are as short as in small trees: what is a
                // row in the whole tree may be some nodes below it here.
                let own: usize = ids.iter().map(BTreeSet::len).sum();
                assert!(own >= count / 2 && own <= count * 2, "{own} of {count}");
                continue;
            }
            assert!(
                off <= count / 500 + 4,
                "{fill} {threshold_px}: {off} of {count}"
            );
            assert!(count > 0);
        }
    }
}

/// Ids of the joined model of a page's nodes that are patches.
fn patches_in_joined(cut: &PagedCut, known: &KnownPages) -> BTreeSet<u32> {
    let mut out = BTreeSet::new();
    for part in &cut.parts {
        let tree = &part.page.model.tree;
        let (starts, _) = &known.places[&part.id];
        for &id in &part.cut.patches {
            let level = tree.level_of(id);
            assert!(out.insert(starts[level] + id - tree.level(level).start));
        }
    }
    out
}

#[test]
fn by_error_it_is_the_cut_of_the_whole_tree_too() {
    // Of the torus some nodes of an upper page are patches where others of the same page below are not.
    for (shape, pages, shared) in [
        (GeneratedShape::Statue, SMALL_PAGES, 0),
        (GeneratedShape::Statue, LARGE_PAGES, 2),
        (GeneratedShape::Torus, LARGE_PAGES, 2),
    ] {
        let whole = model(shape, 12_000, false);
        let bytes = to_bytes_with_patches(&whole, &pages, &SilentProgress).unwrap();
        let file = opened(bytes).unwrap();
        assert!(file.has_patches());
        assert_eq!(shared_levels_of(&file), shared);
        let joined = whole_model(&file, &SilentProgress).unwrap();
        let known = all_pages(&file, &joined);
        let conditions = |model: &Model| ResidentPatches::build(model, &SilentProgress).unwrap();
        let of_joined = conditions(&joined);
        let mut selector = PageCutSelector::default();
        for (fill, cull_back) in [
            (0.05, false),
            (0.1, false),
            (0.3, false),
            (0.5, true),
            (1.0, true),
            (4.0, true),
        ] {
            let camera = joined.orbit_camera((640, 480), 0.7, 0.3, fill);
            let view = camera.view(joined.origin).unwrap();
            let settings = PatchCutSettings {
                cut: CutSettings {
                    cull_back,
                    ..CutSettings::default()
                },
                tolerances: ErrorTolerances::within(2.0),
                ..PatchCutSettings::default()
            };
            let choose =
                |selectors: &mut PageSelectors, asked: PageQuestion<'_>, cut: &mut PatchCut| {
                    let mut settings = settings;
                    settings.cut.cull_back &= !asked.keeps_back;
                    let model = &asked.page.model;
                    let own = conditions(model);
                    let own = own.conditions(model, false);
                    (selectors.by_error).select(model, own, &view, &settings, cut);
                };
            let tests = PageTests {
                view: &view,
                settings: &settings.cut,
                choose: &choose,
                hides: None,
            };
            let found = selector.select(file.root(), &known, tests);
            assert!(found.wanted.is_empty());
            let mut expected = PatchCut::default();
            let own = of_joined.conditions(&joined, false);
            PatchSelector::default().select(&joined, own, &view, &settings, &mut expected);
            let patches = patches_in_joined(&found, &known);
            let expected_patches: BTreeSet<u32> = expected.patches.iter().copied().collect();
            let off = patches.symmetric_difference(&expected_patches).count();
            let count = expected_patches.len();
            // From near the lowest nodes are too large, which have no records; from afar few are larger than a pixel.
            assert!(
                count > 100 || !(0.2..=1.0).contains(&fill),
                "{fill}: {count} patches"
            );
            // Pages have zeros of their own: what is at a limit may be rounded to the other side.
            assert!(off <= count / 500 + 4, "{fill}: {off} of {count}");
            let triangles = in_joined(&found, &known, &joined)[2].len();
            let wanted = expected.rest.triangles.len();
            assert!(
                triangles.abs_diff(wanted) <= wanted / 500 + 4,
                "{fill}: {triangles} triangles, {wanted} of the whole tree"
            );
        }
    }
}

/// Points on a line, each gap larger than the one before: of nodes with as many points some are ten times as wide as their
/// siblings, so that pages are opened some of whose first nodes are small enough.
#[test]
fn whatever_the_density_every_leaf_is_drawn_once() {
    let at = |i: i32| 1.006f32.powi(i);
    let mesh = Mesh {
        positions: (0..2100)
            .map(|i| Vec3::new(at(i), 0.1 * at(i), 0.0))
            .collect(),
        ..Mesh::default()
    };
    let whole = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    let file = opened(to_bytes(&whole, &LARGE_PAGES).unwrap()).unwrap();
    assert_eq!(shared_levels_of(&file), 2);
    let joined = whole_model(&file, &SilentProgress).unwrap();
    let known = all_pages(&file, &joined);
    let camera = joined.orbit_camera((640, 480), 0.2, 0.1, 0.5);
    let view = camera.view(joined.origin).unwrap();
    let mut counts = BTreeSet::new();
    for step in 0..40 {
        let settings = CutSettings {
            threshold_px: 0.5 * 1.2f32.powi(step),
            cull_back: false,
            ..CutSettings::default()
        };
        let mut selector = PageCutSelector::default();
        let found = selected(&mut selector, &file, &known, (&view, &settings));
        let ids = in_joined(&found, &known, &joined);
        let mut covered = BTreeSet::new();
        for &id in &ids[0] {
            let leaves = joined.tree.leaf_range(id);
            leaves.for_each(|leaf| assert!(covered.insert(leaf), "{step}"));
        }
        for &leaf in ids[1].iter().chain(&ids[2]) {
            assert!(covered.insert(leaf), "{step}");
        }
        assert_eq!(covered.len(), 2100, "{step}");
        counts.insert(found.parts.len());
    }
    assert!(counts.len() > 2, "{counts:?}");
}

#[test]
fn what_is_missing_is_drawn_coarser_and_wanted_largest_first() {
    for (pages, least) in [(SMALL_PAGES, 20), (LARGE_PAGES, 8)] {
        refined_page_by_page(&pages, least);
    }
}

fn refined_page_by_page(pages: &PagedOptions, least: usize) {
    let whole = model(GeneratedShape::Torus, 12_000, false);
    let file = opened(to_bytes(&whole, pages).unwrap()).unwrap();
    let joined = whole_model(&file, &SilentProgress).unwrap();
    let all = all_pages(&file, &joined);
    let mut known = KnownPages {
        pages: BTreeMap::new(),
        places: all.places.clone(),
    };
    let camera = joined.orbit_camera((640, 480), 0.7, 0.3, 2.0);
    let settings = CutSettings::default();
    let mut selector = PageCutSelector::default();
    let mut rounds = 0;
    loop {
        let view = camera.view(joined.origin).unwrap();
        let found = selected(&mut selector, &file, &known, (&view, &settings));
        // Every leaf of the model that is in view is below exactly one id: no two ids overlap.
        let ids = in_joined(&found, &all, &joined);
        let mut covered = BTreeSet::new();
        for &id in &ids[0] {
            joined
                .tree
                .leaf_range(id)
                .for_each(|leaf| assert!(covered.insert(leaf)));
        }
        for &leaf in ids[1].iter().chain(&ids[2]) {
            assert!(covered.insert(leaf));
        }
        let sizes: Vec<f32> = found.wanted.iter().map(|wanted| wanted.size_px).collect();
        assert!(sizes.windows(2).all(|w| w[0] >= w[1]));
        assert!(found.needed.windows(2).all(|w| w[0].id < w[1].id));
        let Some(next) = found.wanted.first() else {
            break;
        };
        if rounds > 0 {
            assert!(!covered.is_empty());
        }
        known
            .pages
            .insert(next.entry.id, all.pages[&next.entry.id].clone());
        rounds += 1;
    }
    assert!(rounds > least && rounds <= all.pages.len(), "{rounds}");
}
