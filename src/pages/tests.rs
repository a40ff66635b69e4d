#![allow(clippy::unwrap_used, reason = "a test may panic")]

use super::check::check;
use super::file::PagedFile;
use super::format::{HEADER, PageError};
use super::join::whole_model;
use super::page::{ColorBits, DecodeOptions};
use super::quantize::TestNumbers;
use super::source::MemorySource;
use super::write::{PagedOptions, to_bytes, to_bytes_with_patches, write};
pub(super) use crate::generate::GeneratedShape;
use crate::generate::{self, ShapeSpec};
use crate::mesh::Mesh;
use crate::progress::SilentProgress;
use crate::tree::{self, BuildOptions, Model, PackedPatch};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// A shape of about that many triangles with colors, or the cloud of its vertices.
pub(in crate::pages) fn model(shape: GeneratedShape, triangles: u64, is_cloud: bool) -> Model {
    let spec = ShapeSpec::with_triangles(shape, triangles).unwrap();
    let mut mesh = generate::mesh(&spec);
    mesh.colors = mesh
        .positions
        .iter()
        .map(|p| {
            let [r, g, b] = (*p * 80.0 + 128.0).to_array().map(|c| c as u8);
            [r, g, b, 255]
        })
        .collect();
    if is_cloud {
        mesh.triangles.clear();
    }
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

pub(super) fn opened(bytes: Vec<u8>) -> Result<PagedFile, PageError> {
    PagedFile::open(Arc::new(MemorySource::new("t.surfel", bytes)))
}

pub(super) const SMALL_PAGES: PagedOptions = PagedOptions {
    page_leaves: 64,
    colors: None,
};

#[test]
fn a_paged_file_is_clean_and_joins_to_the_same_tree() {
    for is_cloud in [false, true] {
        for (leaves, page_leaves) in [(12, 64), (1000, 64), (20_000, 64), (20_000, 4096)] {
            let model = model(GeneratedShape::Statue, leaves, is_cloud);
            let options = PagedOptions {
                page_leaves,
                colors: None,
            };
            let bytes = to_bytes(&model, &options).unwrap();
            let file = opened(bytes.clone()).unwrap();
            let report = check(&file, &SilentProgress);
            assert!(
                report.is_clean(),
                "{leaves} {is_cloud}: {:?}",
                report.violations
            );
            assert_eq!(report.leaves, model.tree.leaves.len() as u64);
            assert_eq!(
                (leaves > 4096 || page_leaves == 64 && leaves > 64),
                report.pages > 1
            );

            let joined = whole_model(&file, &SilentProgress).unwrap();
            let (one, two) = (&model.tree, &joined.tree);
            assert_eq!(one.level_starts, two.level_starts);
            assert_eq!(
                (&one.parents, &one.first_leaf),
                (&two.parents, &two.first_leaf)
            );
            assert!(one.nodes.iter().zip(two.nodes.iter()).all(|(a, b)| {
                (a.first_child, a.child_count, a.flags) == (b.first_child, b.child_count, b.flags)
            }));
            assert_eq!(
                (joined.is_closed, joined.has_colors),
                (model.is_closed, true)
            );
            // The same bytes whatever the threads.
            assert_eq!(to_bytes(&model, &options).unwrap(), bytes);
        }
    }
}

#[test]
fn records_of_patches_are_those_of_what_is_decoded() {
    // Small pages are leaves of the page above; large ones share levels with it; the last model is one page.
    for (leaves, page_leaves) in [(4000, 64), (12_000, 1024), (1000, 4096)] {
        let options = PagedOptions {
            page_leaves,
            colors: None,
        };
        let mut model = model(GeneratedShape::Statue, leaves, false);
        // Far from the zero single precision has coarse places.
        model.origin = DVec3::new(4.0e5, 5.0e6, 100.0);
        let plain = to_bytes(&model, &options).unwrap();
        let bytes = to_bytes_with_patches(&model, &options, &SilentProgress).unwrap();
        let file = opened(bytes.clone()).unwrap();
        let report = check(&file, &SilentProgress);
        assert!(report.is_clean(), "{leaves}: {:?}", report.violations);
        let joined = whole_model(&file, &SilentProgress).unwrap();
        let mut made = whole_model(&opened(plain.clone()).unwrap(), &SilentProgress).unwrap();
        assert!(made.patches.is_none());
        crate::patches::add_records(&mut made, &SilentProgress).unwrap();
        // The last level has none: its nodes are a few triangles.
        let recorded = joined.tree.level(joined.tree.level_count() - 1).start;
        let records = made.patches.unwrap().of_nodes(0..recorded);
        let count = joined.tree.nodes.len();
        assert_eq!(joined.patches.unwrap(), Arc::new(records.filled(count)));
        // 48 bytes a node, some of which are in two pages.
        let added = bytes.len() - plain.len();
        let least = 48 * recorded as usize;
        assert!(
            added >= least && added < least * 14 / 10,
            "{added} of {least}"
        );
    }
}

/// Records made thinner, with right checksums: those of the first page, which lie above all others, and of a leaf page.
#[test]
fn records_that_do_not_bound_what_is_below_are_found() {
    let model = model(GeneratedShape::Sphere, 4000, false);
    let bytes = to_bytes_with_patches(&model, &SMALL_PAGES, &SilentProgress).unwrap();
    let places = damage::places(&bytes);
    for page in [0, places.len() - 1] {
        let file = opened(bytes.clone()).unwrap();
        let place = places[page];
        let decoded = file.read_page(&place, DecodeOptions::default()).unwrap();
        let tree = &decoded.model.tree;
        let recorded = match decoded.children {
            Some(_) => tree.nodes.len() as u32,
            None => tree.level(tree.level_count() - 1).start,
        };
        let patches = decoded.model.patches.unwrap().of_nodes(0..recorded);
        let mut own = Vec::new();
        patches.append_to(&mut own);
        let range = place.offset as usize..place.end() as usize;
        let at = bytes[range].windows(own.len()).position(|part| part == own);
        let at = place.offset as usize + at.unwrap();
        let mut damaged = bytes.clone();
        let end = at + size_of_val(&patches.records[..]);
        for record in damaged[at..end].chunks_exact_mut(size_of::<PackedPatch>()) {
            let thickness = &mut record[std::mem::offset_of!(PackedPatch, thickness)];
            *thickness = thickness.saturating_sub(64);
        }
        damage::repair(&mut damaged, &places);
        let report = check(&opened(damaged).unwrap(), &SilentProgress);
        let named = report.violations.iter();
        let named = named.filter(|what| what.contains("from the plane")).count();
        assert!(named > 0, "page {page}: {:?}", report.violations);
    }
}

#[test]
fn what_is_decoded_is_near_what_was_written() {
    for is_cloud in [false, true] {
        let model = model(GeneratedShape::Torus, 10_000, is_cloud);
        let options = PagedOptions {
            page_leaves: 512,
            colors: Some(ColorBits::All),
        };
        let file = opened(to_bytes(&model, &options).unwrap()).unwrap();
        let joined = whole_model(&file, &SilentProgress).unwrap();
        let mut worst = 0.0f32;
        for (leaf, (own, decoded)) in model
            .tree
            .leaves
            .iter()
            .zip(joined.tree.leaves.iter())
            .enumerate()
        {
            let parent = joined.tree.parent_of_leaf(leaf as u32).unwrap();
            let scale = joined.tree.nodes[parent as usize].radius;
            worst = worst.max(own.center.distance(decoded.center) / scale);
            let contains =
                own.center.distance(decoded.center) + own.radius <= decoded.radius * 1.000_01;
            // Points' balls are held; of triangles they are those of the moved corners.
            assert!(!is_cloud || contains);
        }
        // Half a step an axis, of the parent's radius.
        let most = if is_cloud { 3f32.sqrt() / 126.0 } else { 0.002 };
        assert!(worst < most * 1.01 && worst > most * 0.2, "{worst}");
        for id in 0..model.tree.nodes.len() {
            let (own, decoded) = (&model.tree.nodes[id], &joined.tree.nodes[id]);
            let off = own.center.as_dvec3().distance(decoded.center.as_dvec3());
            assert!(
                off + f64::from(own.radius) <= f64::from(decoded.radius) * 1.000_001,
                "{id}"
            );
            let (a, b) = (&model.tree.attributes[id], &joined.tree.attributes[id]);
            assert_eq!(a.has_normal(), b.has_normal());
            assert!(!a.has_normal() || a.normal().dot(b.normal()) > 0.999);
            assert!(b.half_thickness() >= 0.0 && b.splat_radius <= decoded.radius);
            // Radii of points are rounded up to parts of 32 of their parent's: areas grow, of the smallest most.
            let most = if is_cloud { 8.0 } else { 1.01 };
            assert!(
                (a.area * 0.99..=a.area * most).contains(&b.area),
                "{} {}",
                a.area,
                b.area
            );
            // Means are weighted by those areas.
            let most = if is_cloud { 12 } else { 2 };
            for k in 0..3 {
                assert!(
                    a.color[k].abs_diff(b.color[k]) <= most,
                    "{:?} {:?}",
                    a.color,
                    b.color
                );
            }
        }
    }
}

/// A quad far from zero, coincident points, no points, one point, a needle.
#[test]
fn degenerate_models_are_written_and_read() {
    let cloud = |positions: Vec<Vec3>| Mesh {
        positions,
        ..Mesh::default()
    };
    let mut needle = cloud(vec![
        Vec3::ZERO,
        Vec3::X * 1e6,
        Vec3::new(1.0, 1e-3, 0.0),
        Vec3::Z,
    ]);
    needle.triangles = vec![[0, 1, 2], [0, 1, 1], [2, 2, 2], [0, 2, 3]];
    let mut far = cloud(vec![
        Vec3::splat(1e7),
        Vec3::new(1e7, 1e7, 1e7 + 8.0),
        Vec3::new(1e7 + 8.0, 1e7, 1e7),
    ]);
    far.triangles = vec![[0, 1, 2]];
    let mut flat = cloud(vec![Vec3::ONE; 9]);
    flat.triangles = vec![[0, 1, 2]; 40];
    for mesh in [
        cloud(Vec::new()),
        cloud(vec![Vec3::ONE]),
        cloud(vec![Vec3::ONE; 2]),
        cloud(vec![Vec3::splat(-3e5); 100]),
        cloud((0..50).map(|i| Vec3::X * (1.5f32).powi(i)).collect()),
        needle,
        far,
        flat,
    ] {
        let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
        let bytes = to_bytes(&model, &SMALL_PAGES).unwrap();
        let file = opened(bytes).unwrap();
        let report = check(&file, &SilentProgress);
        assert!(report.is_clean(), "{:?}", report.violations);
        let joined = whole_model(&file, &SilentProgress).unwrap();
        assert_eq!(joined.tree.leaves.len(), model.tree.leaves.len());
        assert_eq!(joined.kind(), model.kind());
    }
}

/// Two pages share an edge: its vertices are at the same place in both, so that no crack opens.
#[test]
fn vertices_of_several_pages_stay_together() {
    let model = model(GeneratedShape::Sphere, 6000, false);
    let file = opened(to_bytes(&model, &SMALL_PAGES).unwrap()).unwrap();
    let joined = whole_model(&file, &SilentProgress).unwrap();
    let mut places = std::collections::HashMap::new();
    for (own, decoded) in model.triangles.iter().zip(&joined.triangles) {
        for k in 0..3 {
            let place = joined.vertices[decoded[k] as usize].position;
            let known = places.entry(own[k]).or_insert(place);
            assert_eq!(*known, place);
        }
    }
    assert!(joined.vertices.len() > model.vertices.len() + 500);
}

#[test]
fn every_flipped_bit_is_found() {
    for (is_cloud, has_patches) in [(false, false), (true, false), (false, true)] {
        let count = if has_patches { 150 } else { 300 };
        let model = model(GeneratedShape::Torus, count, is_cloud);
        let bytes = match has_patches {
            true => to_bytes_with_patches(&model, &SMALL_PAGES, &SilentProgress),
            false => to_bytes(&model, &SMALL_PAGES),
        };
        let bytes = bytes.unwrap();
        assert!(check(&opened(bytes.clone()).unwrap(), &SilentProgress).is_clean());
        // Of the larger file every fifth, which is each place of a bit in a byte.
        let step = if has_patches { 5 } else { 1 };
        for bit in (0..bytes.len() * 8).step_by(step) {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            let is_found = match opened(damaged) {
                Ok(file) => !check(&file, &SilentProgress).is_clean(),
                Err(_) => true,
            };
            assert!(is_found, "bit {bit}");
        }
        for length in 0..bytes.len() {
            assert!(opened(bytes[..length].to_vec()).is_err());
        }
    }
}

/// Damages that know the format: checksums are made right again, so that what is behind them must hold.
#[test]
fn damages_with_right_checksums_neither_panic_nor_leave_the_file() {
    let rounds: usize = match std::env::var("SURFEL_DAMAGES") {
        Ok(count) => count.parse().unwrap(),
        Err(_) => 4_000,
    };
    let mut numbers = TestNumbers(123);
    let (mut read, mut sound) = (0, 0);
    let sharing = PagedOptions {
        page_leaves: 256,
        colors: None,
    };
    // The last one's leaf pages share a level with the page above.
    for (count, is_cloud, pages, has_patches) in [
        (260, false, SMALL_PAGES, false),
        (260, true, SMALL_PAGES, false),
        (260, false, SMALL_PAGES, true),
        (900, true, sharing, false),
    ] {
        let model = model(GeneratedShape::Torus, count, is_cloud);
        let bytes = match has_patches {
            true => to_bytes_with_patches(&model, &pages, &SilentProgress),
            false => to_bytes(&model, &pages),
        };
        let bytes = bytes.unwrap();
        let places = damage::places(&bytes);
        assert!(places.len() > 3);
        for _ in 0..rounds / 4 {
            let damaged = damage::apply(&bytes, &places, &mut numbers);
            let Ok(file) = opened(damaged) else { continue };
            read += 1;
            let _ = check(&file, &SilentProgress);
            if let Ok(model) = whole_model(&file, &SilentProgress) {
                sound += 1;
                // A walk over all of it.
                assert_eq!(model.tree.leaf_range(0).len(), model.tree.leaves.len());
                let _ = tree::check(&model);
                if has_patches {
                    let _ =
                        crate::patches::ResidentPatches::build(&model, &SilentProgress).unwrap();
                }
            }
        }
    }
    assert!(read > rounds / 2 && sound > rounds / 20, "{read} {sound}");
}

mod damage {
    use super::*;
    use crate::pages::format::{PageEntry, PagedHeader};
    use crate::tree::file::hash;

    /// Entries of all pages, in the order of the file.
    pub(super) fn places(bytes: &[u8]) -> Vec<PageEntry> {
        let file = opened(bytes.to_vec()).unwrap();
        let mut entries: Vec<PageEntry> = file.root().into_iter().collect();
        let mut at = 0;
        while at < entries.len() {
            let page = file
                .read_page(&entries[at], DecodeOptions::default())
                .unwrap();
            entries.extend(
                page.children
                    .iter()
                    .flat_map(|below| below.entries.iter().copied()),
            );
            at += 1;
        }
        entries
    }

    /// Changes some bytes or words of a page or the header, then all checksums from the lowest page up.
    pub(super) fn apply(bytes: &[u8], places: &[PageEntry], numbers: &mut TestNumbers) -> Vec<u8> {
        let mut damaged = bytes.to_vec();
        for _ in 0..1 + numbers.below(2) {
            let page = numbers.below(places.len() + 1);
            let (start, end) = match places.get(page) {
                Some(entry) => (entry.offset as usize, entry.end() as usize),
                None => (12, HEADER - 8),
            };
            // Headers are where most is decided.
            let span = if numbers.below(2) == 0 {
                (end - start).min(72)
            } else {
                end - start
            };
            let at = start + numbers.below(span);
            match numbers.below(5) {
                0 => damaged[at] ^= 1 << numbers.below(8),
                1 => damaged[at] = numbers.below(256) as u8,
                kind => {
                    let at = (at / 4 * 4).min(damaged.len() - 4);
                    let old = u32::from_le_bytes(*damaged[at..].first_chunk().unwrap());
                    let new = match kind {
                        2 => [0, u32::MAX, 0x7f80_0000, 0x7fc0_0000, 1 << 31][numbers.below(5)],
                        3 => old.wrapping_add(1),
                        _ => old.wrapping_sub(1),
                    };
                    damaged[at..at + 4].copy_from_slice(&new.to_le_bytes());
                }
            }
        }
        repair(&mut damaged, places);
        damaged
    }

    /// Writes the checksums of all pages that lie where they lay into the pages above, as far as those have them there.
    pub(super) fn repair(bytes: &mut [u8], places: &[PageEntry]) {
        for entry in places.iter().rev() {
            let own = hash(&bytes[entry.offset as usize..entry.end() as usize]);
            let old = entry.checksum.to_le_bytes();
            let limit = entry.offset as usize;
            if let Some(at) = bytes[..limit].windows(8).position(|word| word == old) {
                bytes[at..at + 8].copy_from_slice(&own.to_le_bytes());
            }
        }
        let mut header: PagedHeader = bytemuck::pod_read_unaligned(&bytes[..HEADER]);
        header.checksum = header.own_checksum();
        bytes[..HEADER].copy_from_slice(bytemuck::bytes_of(&header));
    }
}

#[test]
fn wrong_files_say_what_is_wrong() {
    let bytes = to_bytes(&model(GeneratedShape::Torus, 300, true), &SMALL_PAGES).unwrap();
    let cause = |bytes: Vec<u8>| opened(bytes).unwrap_err().to_string();
    assert!(cause(Vec::new()).contains("t.surfel, byte 0: ends within its header"));
    assert!(cause(vec![7; 500]).contains("not a paged tree file"));
    let mut version = bytes.clone();
    version[8] = 9;
    assert!(cause(version).contains("byte 8: version 9"));
    let mut longer = bytes.clone();
    longer.push(0);
    assert!(cause(longer).contains("its header says"));
    // A damaged page is named, and others are read.
    let mut page = bytes.clone();
    let last = page.len() - 1;
    page[last] ^= 1;
    let report = check(&opened(page).unwrap(), &SilentProgress);
    assert_eq!(report.count, 3, "{:?}", report.violations);
    assert!(
        report.violations[0].contains("(page "),
        "{:?}",
        report.violations
    );
    assert!(report.violations[0].contains("the checksum is wrong"));

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.surfel");
    write(
        &model(GeneratedShape::Torus, 300, true),
        &SMALL_PAGES,
        &path,
    )
    .unwrap();
    assert_eq!(std::fs::read(path).unwrap(), bytes);
    let _ = DVec3::ZERO;
}
