//! Proves a paged file: every byte is under a checksum, and what is decoded is held by what stands for it.

use super::file::PagedFile;
use super::format::{HEADER, PageEntry};
use super::page::{DecodeOptions, DecodedPage};
use crate::math::octahedral;
use crate::patches::{NodePatch, check_record, check_records};
use crate::progress::Progress;
use crate::tree::{Leaf, Node, NormalCone, Tree, geometric_normal};
use glam::{DVec3, Vec3};
use std::collections::VecDeque;
use std::sync::Arc;

/// Violations that are written out.
const LISTED: usize = 50;

/// How far a decoded ball may stick out of the sphere that stands for it, relative to that.
const TOLERANCE: f64 = 1e-6;

/// What is in a paged file, and what is wrong with it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PagedReport {
    /// Pages that were read.
    pub pages: u64,
    /// Leaves that were decoded.
    pub leaves: u64,
    /// Interior nodes that were decoded.
    pub nodes: u64,
    /// The first violations found (at most 50), each a sentence.
    pub violations: Vec<String>,
    /// Number of all violations.
    pub count: u64,
}

impl PagedReport {
    fn report(&mut self, violation: String) {
        self.count += 1;
        if self.violations.len() < LISTED {
            self.violations.push(violation);
        }
    }

    /// Adds what was found in a file of this name.
    fn join(&mut self, other: Self, name: &str) {
        self.pages += other.pages;
        self.leaves += other.leaves;
        self.nodes += other.nodes;
        let unlisted = other.count - other.violations.len() as u64;
        for violation in other.violations {
            // Faults of reading name the file.
            let is_named = violation.starts_with(name);
            self.report(if is_named {
                violation
            } else {
                format!("{name}: {violation}")
            });
        }
        self.count += unlisted;
    }

    /// Tells whether every promise holds.
    pub fn is_clean(&self) -> bool {
        self.count == 0
    }
}

/// A page to come, and the sphere that stands for it in the page above.
struct ExpectedPage {
    entry: PageEntry,
    outer: Option<(DVec3, f64)>,
    /// Records of the nodes above it.
    above: Arc<Vec<NodePatch>>,
}

/// Reads all pages in the order of the file and tests every promise of the format:
///
/// * every page has its checksum and its codes are ones; pages follow one another without a gap to the end of the file;
/// * each decoded triangle lies in the decoded spheres of all nodes above it in its page, each point's ball meets them (the
///   true one, which it holds, lies in them), and the page's root lies in the leaf that stands for it;
/// * a cone holds the normals of the triangles below, a splat reaches their corners;
/// * the record of an error patch bounds all triangles below its node, in its page and in the pages below;
/// * the counts are those of the header;
/// * the same of every file of a forest.
///
/// A page that cannot be read is one violation; what is below it is not looked at.
pub fn check(file: &PagedFile, progress: &dyn Progress) -> PagedReport {
    progress.stage("check pages", file.page_count());
    let mut report = PagedReport::default();
    let root = file.root().map(|entry| ExpectedPage {
        entry,
        outer: None,
        above: Arc::default(),
    });
    let mut waiting: VecDeque<ExpectedPage> = root.into_iter().collect();
    // Before the first page of a forest is the table of its files.
    let is_forest = file.member_names().len() > 0;
    let mut end = match is_forest {
        true => file.header().root.offset,
        false => HEADER as u64,
    };
    while let Some(ExpectedPage {
        entry,
        outer,
        above,
    }) = waiting.pop_front()
    {
        if progress.is_cancelled() {
            report.report("cancelled".to_owned());
            return report;
        }
        if let Some((index, _)) = file.member_of(&entry) {
            check_member(file, index, &entry, outer, &mut report, progress);
            continue;
        }
        if entry.offset != end || u64::from(entry.id) != report.pages {
            report.report(format!(
                "page {} does not follow the one before it",
                entry.id
            ));
        }
        end = entry.end();
        report.pages += 1;
        progress.advance(1);
        let page = match file.read_page(&entry, DecodeOptions::default()) {
            Ok(page) => page,
            Err(error) => {
                report.report(error.to_string());
                continue;
            }
        };
        let tree = &page.model.tree;
        let below = page.children.as_ref();
        report.nodes += below.map_or(tree.nodes.len(), |below| below.own_nodes(tree)) as u64;
        check_place(&page, outer, entry.id, &mut report);
        check_page(&page, entry.id, &mut report);
        let above = match file.has_patches() {
            true => check_patches(
                &page.clone().in_model_space(file.origin()),
                &above,
                &mut |what| {
                    report.report(format!("page {}: {what}", entry.id));
                },
            ),
            false => Vec::new(),
        };
        match &page.children {
            None => report.leaves += tree.leaves.len() as u64,
            Some(below) => {
                for (index, &entry) in below.entries.iter().enumerate() {
                    let (center, radius) = below.sphere(tree, index);
                    waiting.push_back(ExpectedPage {
                        entry,
                        outer: Some((center.as_dvec3(), f64::from(radius))),
                        above: above.get(index).cloned().unwrap_or_default(),
                    });
                }
            }
        }
    }
    let header = file.header();
    for (what, found, said) in [
        ("bytes", end, header.file_length),
        ("pages", report.pages, file.page_count()),
        ("leaves", report.leaves, header.leaf_count),
        ("nodes", report.nodes, header.node_count),
    ] {
        if found != said {
            report.report(format!("{found} {what}, where the header says {said}"));
        }
    }
    report
}

/// Tests a file whose tree a forest has, and that its first page lies in the sphere that stands for it.
fn check_member(
    forest: &PagedFile,
    index: usize,
    entry: &PageEntry,
    outer: Option<(DVec3, f64)>,
    report: &mut PagedReport,
    progress: &dyn Progress,
) {
    let first = forest.read_page(entry, DecodeOptions::default());
    match first.and_then(|page| Ok((page, forest.open_member(index)?))) {
        Ok((page, file)) => {
            check_place(&page, outer, entry.id, report);
            report.join(check(&file, progress), file.name());
        }
        Err(error) => report.report(error.to_string()),
    }
}

/// Tests that a page lies in the sphere that stands for it.
fn check_place(
    page: &DecodedPage,
    outer: Option<(DVec3, f64)>,
    page_id: u32,
    report: &mut PagedReport,
) {
    let tree = &page.model.tree;
    let own = tree.nodes.first().map(|node| (node.center, node.radius));
    let own = own.or_else(|| tree.leaves.first().map(|leaf| (leaf.center, leaf.radius)));
    if let (Some((center, radius)), Some(outer)) = (own, outer)
        && !holds(outer, page.base + center.as_dvec3(), f64::from(radius))
    {
        report.report(format!("page {page_id}: sticks out of what stands for it"));
    }
}

/// Tests the records of a page in model space: those of a leaf page, and those above it, must bound its triangles. Gives the
/// records above each of the pages below an upper page.
fn check_patches(
    page: &DecodedPage,
    above: &Arc<Vec<NodePatch>>,
    report: &mut dyn FnMut(String),
) -> Vec<Arc<Vec<NodePatch>>> {
    let (model, tree) = (&page.model, &page.model.tree);
    let Some(below) = &page.children else {
        check_records(model).into_iter().for_each(&mut *report);
        let wrong = above.iter().filter_map(|patch| check_record(model, patch));
        wrong.for_each(|cause| report(format!("a patch above it: {cause}")));
        return Vec::new();
    };
    let Some(records) = &model.patches else {
        return Vec::new();
    };
    // Those of shared levels are in the pages below as well.
    let records_of = |index: usize| {
        let mut all = above.to_vec();
        let mut next = match below.shared_levels {
            0 => tree.parent_of_leaf(index as u32),
            _ => parent(tree, below.first_shared + index as u32),
        };
        while let Some(id) = next {
            let patch = records.record(id as usize, &tree.nodes[id as usize]);
            all.extend(Some(patch).filter(NodePatch::may_be_drawn));
            next = parent(tree, id);
        }
        Arc::new(all)
    };
    (0..below.entries.len()).map(records_of).collect()
}

fn parent(tree: &Tree, node: u32) -> Option<u32> {
    (node > 0).then(|| tree.parents[node as usize])
}

fn holds((center, radius): (DVec3, f64), inner: DVec3, reach: f64) -> bool {
    center.distance(inner) + reach <= radius * (1.0 + TOLERANCE) + f64::from(f32::MIN_POSITIVE)
}

fn check_page(page: &DecodedPage, page_id: u32, report: &mut PagedReport) {
    let (model, tree) = (&page.model, &page.model.tree);
    let is_surface = !model.triangles.is_empty();
    for (id, node) in tree.nodes.iter().enumerate() {
        let sphere = (node.center.as_dvec3(), f64::from(node.radius));
        let attributes = &tree.attributes[id];
        if attributes.splat_radius > node.radius {
            report.report(format!(
                "page {page_id}, node {id}: a splat larger than its sphere"
            ));
        }
        for leaf in tree.leaf_range(id as u32) {
            let Leaf { center, radius } = tree.leaves[leaf as usize];
            // Of points the true ball is in both: they meet.
            let reach = if is_surface { radius } else { -radius };
            if !holds(sphere, center.as_dvec3(), f64::from(reach)) {
                report.report(format!("page {page_id}, node {id}: leaf {leaf} sticks out"));
            }
            let Some(triangle) = model.triangles.get(leaf as usize) else {
                continue;
            };
            let corners = triangle.map(|index| model.vertices[index as usize].position);
            let splat = (sphere.0, f64::from(attributes.splat_radius));
            if !corners.iter().all(|p| holds(splat, p.as_dvec3(), 0.0)) {
                report.report(format!(
                    "page {page_id}, node {id}: leaf {leaf} out of its splat"
                ));
            }
            if !is_in_cone(node, corners) {
                report.report(format!(
                    "page {page_id}, node {id}: leaf {leaf} out of its cone"
                ));
            }
            if attributes.has_normal() {
                let normal = octahedral::decode(attributes.normal);
                let far = |p: &Vec3| (*p - node.center).dot(normal).abs();
                let most = corners.iter().map(far).fold(0.0, f32::max);
                if most > attributes.half_thickness() + 2e-4 * attributes.splat_radius {
                    report.report(format!("page {page_id}, node {id}: leaf {leaf} is thicker"));
                }
            }
        }
    }
}

fn is_in_cone(node: &Node, corners: [Vec3; 3]) -> bool {
    if node.cone.sin_half_angle == NormalCone::NEVER || node.flags & Node::FLAT != 0 {
        return true;
    }
    let (normal, _) = geometric_normal(corners);
    let axis = node.cone.axis().as_dvec3();
    normal == DVec3::ZERO
        || (normal.dot(axis) > 0.0
            && normal.cross(axis).length() <= f64::from(node.cone.sin_half_angle()) + 1e-6)
}
