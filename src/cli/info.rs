//! `surfel info`

use super::progress::JobBar;
use super::source::{ColorArgs, ModelArgs};
use super::{CommandFailure, Outcome, bytes, count, print};
use serde_json::json;
use std::fmt::Write;
use surfel::OpenedModel;
use surfel::input::FilePart;
use surfel::mesh::placement::MeshPlacement;
use surfel::open::PageReading;
use surfel::pages::file::PagedFile;
use surfel::photos::formats::locate_scene;

/// Say what is in a model file, or in a scene of photographs.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  surfel info dragon.ply.gz\n  surfel info --json scan.ply\n  surfel info castle/scene.mvs      cameras of photographs, and whether their conventions look right"
)]
pub(crate) struct InfoArgs {
    #[command(flatten)]
    source: ModelArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Facts about a model, as JSON.
pub(crate) fn facts(ready: &OpenedModel) -> serde_json::Value {
    let m = &ready.model;
    let world = |v: glam::Vec3| {
        let v = m.origin + v.as_dvec3();
        [v.x, v.y, v.z]
    };
    let memory = m.memory_bytes();
    let mut facts = json!({
        "file": ready.name,
        "format": ready.format.name(),
        "file_bytes": ready.file_bytes,
        "vertices": m.vertices.len(),
        "used_vertices": m.used_vertices,
        "triangles": m.triangles.len(),
        "is_cloud": !m.kind().is_surface(),
        "is_closed": m.is_closed,
        "has_colors": m.has_colors,
        "with_normals": m.vertices.iter().filter(|vertex| vertex.color[3] != 0).count(),
        "has_estimated_normals": ready.has_estimated_normals,
        "min": world(m.min),
        "max": world(m.max),
        "center": world(m.orbit_center),
        "radius": m.orbit_radius,
        "origin": [m.origin.x, m.origin.y, m.origin.z],
        "tree": {
            "nodes": m.tree.nodes.len() + m.tree.leaves.len(),
            "interior_nodes": m.tree.nodes.len(),
            "leaves": m.tree.leaves.len(),
            "levels": m.tree.level_starts.len(),
            "bytes": memory.tree(),
        },
        "memory_bytes": memory,
        "patch_bytes": m.patches.as_ref().filter(|_| ready.paged.is_none()).map(|patches| patches.bytes()),
        "parts": ready.parts.iter().map(part).collect::<Vec<_>>(),
        "remarks": ready.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "load_ms": ready.load_ms,
        "build_ms": ready.build_ms,
    });
    // The model stands in for pages, of which the file's header tells.
    if let Some(file) = &ready.paged {
        let header = file.header();
        let leaves = header.leaf_count;
        facts["is_cloud"] = json!(!file.is_surface());
        facts["triangles"] = json!(if file.is_surface() { leaves } else { 0 });
        facts["vertices"] = match file.is_surface() {
            true => json!(null),
            false => json!(leaves),
        };
        facts["used_vertices"] = facts["vertices"].clone();
        facts["tree"] = json!({
            "nodes": header.node_count + leaves,
            "interior_nodes": header.node_count,
            "leaves": leaves,
            "pages": file.page_count(),
            "has_patches": file.has_patches(),
            "bytes": file.total_bytes(),
            "files": file.member_names().collect::<Vec<_>>(),
        });
    }
    facts
}

/// A part of the file, as JSON.
fn part(part: &FilePart) -> serde_json::Value {
    json!({
        "name": part.name,
        "count": part.count,
        "fate": part.fate.name(),
        "note": part.note,
    })
}

/// Most lines of parts that are printed; the rest is in the JSON.
const MOST_PARTS: usize = 60;

/// The files whose trees a forest has.
fn files(forest: &PagedFile) -> String {
    let names = forest.member_names();
    let (all, mut out) = (names.len(), String::new());
    if all == 0 {
        return out;
    }
    // Writing to a string cannot fail.
    let _ = writeln!(
        out,
        "  joined of {} files, {} in all:",
        count(all as u64),
        bytes(forest.total_bytes())
    );
    for name in names.take(MOST_PARTS) {
        let _ = writeln!(out, "    {name}");
    }
    if all > MOST_PARTS {
        let _ = writeln!(out, "    and {} more", all - MOST_PARTS);
    }
    out
}

/// Tells of how many points of a cloud the normals are known; nothing of what is no cloud, or is not read whole.
fn normals_of_points(ready: &OpenedModel) -> String {
    let model = &ready.model;
    if !model.kind().is_points() || ready.paged.is_some() {
        return String::new();
    }
    let known = model.vertices.iter().filter(|own| own.color[3] != 0);
    match known.count() as u64 {
        0 => ", no normals".to_owned(),
        known if ready.has_estimated_normals => {
            let side = match ready.knows_scanners {
                true => ", toward the scanners",
                false => "",
            };
            format!(", normals of {} points estimated{side}", count(known))
        }
        known => format!(", normals of {} points", count(known)),
    }
}

/// The parts of the file, a line each, with what became of them.
fn parts(parts: &[FilePart]) -> String {
    let mut out = String::new();
    if parts.is_empty() {
        return out;
    }
    out += "  in the file:\n";
    let shown = &parts[..parts.len().min(MOST_PARTS)];
    let width = shown.iter().map(|part| part.name.chars().count());
    let width = width.max().unwrap_or(0).min(44);
    for part in shown {
        let note = if part.note.is_empty() {
            String::new()
        } else {
            format!(": {}", part.note)
        };
        let (name, rows, fate) = (&part.name, count(part.count), part.fate);
        // Writing to a string cannot fail.
        let _ = writeln!(out, "    {name:<width$} {rows:>12}  {fate}{note}");
    }
    if parts.len() > MOST_PARTS {
        let more = parts.len() - MOST_PARTS;
        let _ = writeln!(out, "    and {more} more, in the output of --json");
    }
    out
}

pub(crate) fn run(args: InfoArgs, quiet: bool) -> Outcome {
    let path = &args.source.model;
    if path.is_dir() || locate_scene(path).is_ok() {
        return super::photos::info(path, args.json);
    }
    let ready = (args.source).open_as(
        &ColorArgs::default(),
        PageReading::ByPage,
        MeshPlacement::default(),
        &JobBar::new(quiet),
    )?;
    let facts = facts(&ready);
    if args.json {
        let text =
            serde_json::to_string_pretty(&facts).map_err(|e| CommandFailure::Run(e.into()))?;
        return print(&(text + "\n"));
    }
    let m = &ready.model;
    let mut out = String::new();
    let leaves = m.tree.leaves.len().max(1) as f64;
    let tree_bytes = m.memory_bytes().tree();
    // Writing to a string cannot fail.
    let _ = writeln!(
        out,
        "{} ({}, {})",
        ready.name,
        ready.format,
        bytes(ready.file_bytes)
    );
    let (leaf_count, kind) = match &ready.paged {
        Some(file) if file.is_surface() => (file.header().leaf_count, "triangles"),
        Some(file) => (file.header().leaf_count, "points"),
        None => (0, ""),
    };
    if ready.paged.is_some() {
        let _ = writeln!(out, "  {} {kind}", count(leaf_count));
    } else {
        let _ = writeln!(
            out,
            "  {} vertices ({} used), {} triangles{}",
            count(m.vertices.len() as u64),
            count(u64::from(m.used_vertices)),
            count(m.triangles.len() as u64),
            if !m.kind().is_surface() {
                ": a point cloud"
            } else {
                ""
            }
        );
    }
    let _ = writeln!(
        out,
        "  {}, {}{}",
        if m.is_closed {
            "closed and oriented outward: what faces away is culled"
        } else {
            "open or not oriented outward: both sides are drawn"
        },
        if m.has_colors {
            "vertex colors"
        } else {
            "no colors"
        },
        normals_of_points(&ready)
    );
    let corner = |v: glam::Vec3| {
        let v = m.origin + v.as_dvec3();
        format!("({} {} {})", v.x, v.y, v.z)
    };
    let _ = writeln!(out, "  box {} to {}", corner(m.min), corner(m.max));
    if let Some(file) = &ready.paged {
        let header = file.header();
        let _ = writeln!(
            out,
            "  tree: {} nodes ({} interior) in {} pages, {:.2} bytes a leaf",
            count(header.node_count + header.leaf_count),
            count(header.node_count),
            count(file.page_count()),
            file.total_bytes() as f64 / header.leaf_count.max(1) as f64
        );
        out += &files(file);
    } else {
        let _ = writeln!(
            out,
            "  tree: {} nodes ({} interior) on {} levels, {} ({:.1} bytes a leaf)",
            count((m.tree.nodes.len() + m.tree.leaves.len()) as u64),
            count(m.tree.nodes.len() as u64),
            m.tree.level_starts.len(),
            bytes(tree_bytes),
            tree_bytes as f64 / leaves
        );
    }
    if ready.paged.as_ref().is_some_and(PagedFile::has_patches) {
        let _ = writeln!(
            out,
            "  error patches: records of all nodes but the lowest, in the pages"
        );
    } else if let Some(patches) = &m.patches {
        let of_patches = patches.bytes() as u64;
        let _ = writeln!(
            out,
            "  error patches: records of all nodes, {} ({:.1} bytes a leaf)",
            bytes(of_patches),
            of_patches as f64 / leaves
        );
    }
    let _ = writeln!(
        out,
        "  read in {:.0} ms, built in {:.0} ms",
        ready.load_ms, ready.build_ms
    );
    out += &parts(&ready.parts);
    print(&out)
}
