//! Broken files through the program: one reason with its place, exit code 2; never a panic, a hang or a flood.

use super::common_models::{models, ring_file, scan_file};
use super::harness::{expect, run_with, surfel, surfel_in};
use std::path::Path;

#[test]
fn broken_files_are_told_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let ply = |encoding: &str, vertices: u64, faces: u64, rest: &str| {
        format!(
            "ply\nformat {encoding} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
             property float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n{rest}"
        )
    };
    let corners = "0 0 0\n1 0 0\n0 1 0\n";
    let mut stl = vec![b' '; 80];
    stl.extend(7_u32.to_le_bytes());
    stl.extend([0; 60]);
    let huge = u64::from(u32::MAX) - 5;
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        (
            "cut.ply",
            ply("ascii", 3, 1, "0 0 0\n1 0 0\n").into(),
            "line",
        ),
        (
            "cut-binary.ply",
            ply("binary_little_endian", 3, 1, "0123456789").into(),
            "byte",
        ),
        (
            "cut-header.ply",
            "ply\nformat ascii 1.0\nelement vertex 3\n".into(),
            "line",
        ),
        (
            "lies.ply",
            ply("binary_little_endian", huge, huge, "0123456789").into(),
            "byte",
        ),
        (
            "lies-faces.ply",
            ply("ascii", 3, huge, &format!("{corners}3 0 1 2\n")).into(),
            "ends early",
        ),
        (
            "lies-list.ply",
            ply("binary_big_endian", 0, 3, "\u{7f}\u{7f}").into(),
            "lies-list.ply",
        ),
        (
            "index.ply",
            ply("ascii", 3, 1, &format!("{corners}3 0 1 3\n")).into(),
            "vertex 3",
        ),
        (
            "word.ply",
            ply("ascii", 3, 1, "0 0 zero\n1 0 0\n0 1 0\n3 0 1 2\n").into(),
            "zero",
        ),
        (
            "format.ply",
            ply("middle_endian", 3, 1, corners).into(),
            "middle_endian",
        ),
        (
            "cut.obj",
            "v 0 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n".into(),
            "line 3",
        ),
        (
            "index.obj",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n".into(),
            "line 4",
        ),
        (
            "zero.obj",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n".into(),
            "line 4",
        ),
        ("word.obj", "v 0 0 here\n".into(), "line 1"),
        ("faces.obj", "f 1 2 3\n".into(), "line 1"),
        ("cut.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n".into(), "line"),
        (
            "lies.off",
            format!("OFF\n{huge} {huge} 0\n0 0 0\n").into(),
            "line",
        ),
        (
            "index.off",
            format!("OFF\n3 1 0\n{corners}3 0 1 9\n").into(),
            "line 6",
        ),
        (
            "cut.stl",
            "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n".into(),
            "line",
        ),
        ("cut-binary.stl", stl, "byte"),
        (
            "cut.ply.gz",
            vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3, 1, 2],
            "cut.ply.gz",
        ),
        ("nan.obj", "v nan nan nan\nv inf 0 0\n".into(), "finite"),
    ];
    for (name, content, place) in cases {
        std::fs::write(at.join(name), content).unwrap();
        let run = limited(at, name);
        assert_eq!(run.code, 2, "{name}: {}", run.err);
        let last = run.err.lines().last().unwrap();
        assert!(
            last.starts_with(&format!("surfel: {name}")),
            "{name}: {}",
            run.err
        );
        assert!(
            last.contains(place),
            "{name}: {:?} names no {place:?}",
            run.err
        );
    }
}

/// `info` on a file with a gigabyte of address space: a header that lies must not take more.
fn limited(at: &Path, name: &str) -> super::harness::Run {
    #[cfg(unix)]
    let mut command = super::harness::command_after("ulimit -v 1000000");
    #[cfg(not(unix))]
    let mut command = super::harness::command();
    command.args(["info", name]).current_dir(at);
    run_with(command, None)
}

/// Small files of every format: generated, and real ones where they are.
fn seeds(at: &Path) -> Vec<(String, Vec<u8>, bool)> {
    // Name, bytes, and whether every truncation has to be noticed (text may end early and be whole).
    expect(at, 0, "generate statue --triangles 200 -o statue.ply");
    expect(at, 0, "build statue.ply --exact -o statue.surfel");
    let mut seeds: Vec<(String, Vec<u8>, bool)> = ["statue.ply", "statue.surfel"]
        .iter()
        .map(|n| ((*n).to_owned(), std::fs::read(at.join(n)).unwrap(), true))
        .collect();
    for (name, file, is_counted) in [
        ("scan.ply.gz", scan_file(), true),
        ("ring.obj", ring_file(), false),
    ] {
        seeds.push((name.to_owned(), std::fs::read(file).unwrap(), is_counted));
    }
    if let Some(folder) = models() {
        for (name, is_counted) in [
            ("sharp/joint.off", true),
            ("sharp/round.stl", true),
            ("sharp/office_chair.obj", false),
            ("photos/sceaux/Sparse.ply", true),
            ("thesis/dragon_vrip_res4.ply.gz", true),
        ] {
            let bytes = std::fs::read(folder.join(name)).unwrap();
            let name = name.rsplit('/').next().unwrap().to_owned();
            seeds.push((name, bytes, is_counted));
        }
    }
    seeds
}

/// A small generator of numbers, the same on every run (SplitMix64).
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % bound as u64) as usize
    }
}

#[test]
fn truncations_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut random = Random(1);
    for (name, bytes, is_counted) in seeds(at) {
        let mut lengths = vec![1, bytes.len() / 2, bytes.len() - 1];
        lengths.extend((0..4).map(|_| 1 + random.below(bytes.len() - 1)));
        for length in lengths {
            // The last byte of a text file may be the end of its line, of a PLY file a digit.
            let is_noticed = is_counted && (length + 1 < bytes.len() || !is_text(&bytes));
            std::fs::write(at.join(&name), &bytes[..length]).unwrap();
            let run = surfel_in(at, ["check", &name]);
            if is_noticed {
                assert_eq!(
                    run.code,
                    2,
                    "{name} of {length} bytes: {} {}",
                    run.text(),
                    run.err
                );
            } else {
                assert_ne!(
                    run.code,
                    1,
                    "{name} of {length} bytes: {} {}",
                    run.text(),
                    run.err
                );
            }
            if run.code == 2 {
                assert!(
                    run.err.contains(&name),
                    "{name} of {length} bytes: {}",
                    run.err
                );
            }
        }
    }
}

fn is_text(bytes: &[u8]) -> bool {
    bytes
        .iter()
        .all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace())
}

#[test]
fn flipped_bytes_give_a_clean_tree_or_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut random = Random(2);
    let mut refused = 0;
    for (name, bytes, _) in seeds(at) {
        for round in 0..8 {
            let mut broken = bytes.clone();
            // Half of them in the header, where the counts are.
            let range = if round % 2 == 0 {
                broken.len().min(400)
            } else {
                broken.len()
            };
            let place = random.below(range);
            broken[place] ^= 1 << random.below(8);
            std::fs::write(at.join(&name), &broken).unwrap();
            let run = surfel_in(at, ["check", &name]);
            assert!(
                run.code == 0 || run.code == 2,
                "{name}, byte {place} flipped: {} {}",
                run.text(),
                run.err
            );
            if run.code == 2 {
                assert!(
                    run.err.contains(&name),
                    "{name}, byte {place} flipped: {}",
                    run.err
                );
                refused += 1;
            }
            if name.ends_with(".surfel") && broken[..place] != [0] {
                // Everything but padding is under a checksum.
                assert!(
                    run.code == 2 || bytes[place] == 0,
                    "byte {place} of a tree file flipped unseen"
                );
            }
        }
    }
    assert!(
        refused > 8,
        "only {refused} were refused: were the files broken at all?"
    );
    assert_eq!(surfel(["check", "generate:square:2"]).code, 0);
}
