//! Real models of other people, where they are, and the two small files in `assets/` that stand for them on every clone.

#![allow(dead_code, reason = "each test binary uses a part of it")]

use std::path::{Path, PathBuf};

/// Folder of the real models, or one printed line and `None`; with `SURFEL_REQUIRE_MODELS=1` their absence fails.
pub(crate) fn models() -> Option<PathBuf> {
    let folder = std::env::var_os("SURFEL_MODELS").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/models"),
        PathBuf::from,
    );
    if folder.is_dir() {
        return Some(folder);
    }
    is_absent(&folder);
    None
}

/// A real model, or one printed line and `None`; with `SURFEL_REQUIRE_MODELS=1` its absence fails.
pub(crate) fn real_file(name: &str) -> Option<PathBuf> {
    let path = models()?.join(name);
    if path.is_file() {
        return Some(path);
    }
    is_absent(&path);
    None
}

fn is_absent(path: &Path) {
    assert!(
        std::env::var_os("SURFEL_REQUIRE_MODELS").is_none(),
        "real models are required here: {} is absent",
        path.display()
    );
    println!("{} is absent: not tested with it", path.display());
}

/// Two range maps as a scanner gives them (`assets/README.md`): open borders, needles, triangles without area, colors.
pub(crate) fn scan_file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scan.ply.gz")
}

/// A ring of polygons of four and six corners with normals, whose material file is missing (`assets/README.md`).
pub(crate) fn ring_file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/ring.obj")
}

/// Our own scan, and those of the named real models that are there.
pub(crate) fn scan_files(real: &[&str]) -> Vec<(String, PathBuf)> {
    let real = real
        .iter()
        .filter_map(|name| Some(((*name).to_owned(), real_file(name)?)));
    std::iter::once(("scan".to_owned(), scan_file()))
        .chain(real)
        .collect()
}
