//! Clouds of scanners: files made here byte by byte, the real ones against their verified counts, damage of all kinds.

mod color_by;
mod e57;
mod gltf;
mod las;
mod pcd;
mod text;

use std::path::{Path, PathBuf};

use surfel::input::{self, LoadedMesh, ReadOptions};
use surfel::mesh::attributes::AttributeColumn;
use surfel::progress::SilentProgress;

use super::common_models::real_file;
use super::{check, try_read};

/// The next number of a fixed sequence (Steele and others, SplitMix64).
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Memory for points and their attributes that a damaged file may ask for, bytes.
fn allowed(bytes: usize) -> usize {
    4 * bytes + (64 << 20)
}

/// Reads a damaged file: a mesh that keeps its promises in bounded memory, or an error that names the file.
fn survives(name: &str, bytes: &[u8]) -> bool {
    match try_read(name, bytes) {
        Ok(loaded) => {
            check(&loaded, allowed(bytes.len()));
            let points = loaded.mesh.positions.len();
            let columns = &loaded.attributes.columns;
            assert!(columns.iter().all(|column| column.values.len() == points));
            let kept = points * (16 + loaded.attributes.bytes_a_point());
            assert!(
                kept <= allowed(bytes.len()),
                "{kept} bytes of {}",
                bytes.len()
            );
            true
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.starts_with(name) && text.len() < 600, "{text}");
            false
        }
    }
}

/// Tries every truncation and `times` seeded damages of a good file. Returns how many of the damaged ones were read.
fn damage(name: &str, bytes: &[u8], times: u64) -> u64 {
    assert!(survives(name, bytes), "{name}: the good file");
    for length in 0..bytes.len() {
        survives(name, &bytes[..length]);
    }
    let mut state = bytes.len() as u64;
    let mut read = 0;
    for _ in 0..times {
        let mut damaged = bytes.to_vec();
        for _ in 0..=next(&mut state) % 4 {
            // Half of the damage goes to the beginning, where the numbers are that ask for memory.
            let reach = if next(&mut state).is_multiple_of(2) {
                damaged.len()
            } else {
                damaged.len().min(400)
            };
            let at = (next(&mut state) % reach as u64) as usize;
            match next(&mut state) % 4 {
                0 => damaged[at] ^= 1 << (next(&mut state) % 8),
                1 => damaged[at] = next(&mut state) as u8,
                2 => damaged[at] = [0, 0xff, 0x7f, 0x80][(next(&mut state) % 4) as usize],
                _ => drop(damaged.remove(at)),
            }
        }
        read += u64::from(survives(name, &damaged));
    }
    read
}

/// A file of the real scans; `None` where they are absent.
fn scan(name: &str) -> Option<(PathBuf, LoadedMesh)> {
    let path = real_file(&format!("scans/{name}"))?;
    let loaded = scan_at(&path);
    Some((path, loaded))
}

/// A file of the disk.
fn scan_at(path: &Path) -> LoadedMesh {
    let loaded = input::load(path, &ReadOptions::default(), &SilentProgress);
    let loaded = loaded.unwrap_or_else(|error| panic!("{error}"));
    check(&loaded, usize::MAX);
    loaded
}

fn column<'a>(loaded: &'a LoadedMesh, name: &str) -> &'a AttributeColumn {
    let found = loaded.attributes.find(name);
    found.unwrap_or_else(|| panic!("no column {name}: {:?}", loaded.parts))
}

/// How many points have each value.
fn histogram(column: &AttributeColumn) -> Vec<(i64, usize)> {
    let mut counts = std::collections::BTreeMap::new();
    for at in 0..column.values.len() {
        *counts.entry(column.value(at).unwrap() as i64).or_insert(0) += 1;
    }
    counts.into_iter().collect()
}

fn remarks(loaded: &LoadedMesh) -> String {
    let lines: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    lines.join("\n")
}
