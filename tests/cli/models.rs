//! `check`: generated models, every real one, and the formats that are not read.

use super::common_models::{models, ring_file, scan_file};
use super::harness::{expect, surfel};
use std::path::{Path, PathBuf};

fn all_files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(all_files(&path));
        } else {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The ending of a name in lower case, below `.gz`.
fn ending(path: &Path) -> String {
    let name = path.file_name().unwrap().to_string_lossy().to_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    name.rsplit_once('.').map_or("", |(_, e)| e).to_owned()
}

#[test]
fn generated_models_are_clean() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut words = String::from("check --json");
    for shape in ["square", "sphere", "torus", "statue"] {
        for triangles in [1, 2, 3, 7, 100, 5_000, 50_000] {
            words += &format!(" generate:{shape}:{triangles}");
        }
    }
    let rows = expect(at, 0, &words).json();
    let rows = rows.as_array().unwrap();
    assert_eq!(rows.len(), 28);
    for row in rows {
        assert_eq!(row["clean"], true, "{row}");
        assert!(row["triangles"].as_u64().unwrap() > 0);
    }
    let text = expect(at, 0, "check generate:torus:5000").text();
    assert!(
        text.starts_with("generate:torus:5000: clean (generated; "),
        "{text}"
    );
}

#[test]
fn a_check_goes_on_after_what_cannot_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("bad.off"), "OFF\n3 1 0\n0 0 0\n1 0 0\n").unwrap();
    expect(at, 0, "generate sphere --triangles 500 -o good.ply");
    let run = expect(at, 2, "check --json bad.off good.ply missing.obj");
    let rows = run.json();
    assert_eq!(rows.as_array().map(Vec::len), Some(3));
    assert!(
        rows[0]["error"].as_str().unwrap().contains("bad.off, line"),
        "{rows}"
    );
    assert_eq!(rows[1]["clean"], true);
    assert!(
        rows[2]["error"].as_str().unwrap().contains("missing.obj"),
        "{rows}"
    );
}

#[test]
fn every_real_model_is_clean() {
    let Some(folder) = models() else { return };
    // What is in `dialects` is damaged on purpose.
    let dialects = folder.join("dialects");
    let files: Vec<PathBuf> = all_files(&folder)
        .into_iter()
        .filter(|f| !f.starts_with(&dialects))
        .filter(|f| ["obj", "ply", "stl", "off"].contains(&ending(f).as_str()))
        .collect();
    assert!(files.len() >= 30, "{} models", files.len());
    are_clean(&files);
}

#[test]
fn our_own_scan_and_ring_are_clean() {
    are_clean(&[scan_file(), ring_file()]);
}

/// Checks files, and sees a row of each.
fn are_clean(files: &[PathBuf]) {
    let mut args: Vec<String> = vec!["check".into(), "--json".into()];
    args.extend(files.iter().map(|f| f.to_string_lossy().into_owned()));
    let run = surfel(&args);
    assert_eq!(run.code, 0, "{}", run.err);
    let rows = run.json();
    let rows = rows.as_array().unwrap();
    assert_eq!(rows.len(), files.len());
    for (row, file) in rows.iter().zip(files) {
        let name = file.to_string_lossy();
        assert_eq!(row["file"].as_str(), Some(&*name));
        assert_eq!(
            (
                row["clean"].as_bool(),
                row["violations"].as_array().map(Vec::len)
            ),
            (Some(true), Some(0)),
            "{row}"
        );
        let format = row["format"].as_str().unwrap();
        assert!(
            format.to_lowercase().starts_with(&ending(file)),
            "{name} as {format}"
        );
        assert!(row["vertices"].as_u64().unwrap() > 0, "{name}");
    }
    // Where something had to be repaired or left out, the user is told; nothing else is said.
    for line in run.err.lines() {
        assert!(line.contains(": warning: "), "{line}");
    }
}

/// Beginnings of files, by the marks that the formats' specifications give.
fn beginnings(at: &Path) -> Vec<PathBuf> {
    let las = |point_format: u8, record: &[u8]| {
        let mut bytes = b"LASF".to_vec();
        bytes.resize(400, 0);
        bytes[104] = point_format;
        bytes[377..377 + record.len()].copy_from_slice(record);
        bytes
    };
    let files: [(&str, Vec<u8>); 8] = [
        ("a.las", las(3, b"")),
        ("a.laz", las(0x83, b"")),
        ("a.copc.laz", las(0x86, b"copc")),
        ("a.e57", b"ASTM-E57\x01\0\0\0".to_vec()),
        (
            "a.pcd",
            b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\n".to_vec(),
        ),
        ("a.glb", b"glTF\x02\0\0\0".to_vec()),
        ("a.qs", b"QSplat11\0\0\0\0".to_vec()),
        ("a.xyz", b"0 0 0\n1 0 0.5\n0 1 0\n".to_vec()),
    ];
    let write = |(name, bytes): (&str, Vec<u8>)| {
        std::fs::write(at.join(name), bytes).unwrap();
        at.join(name)
    };
    files.into_iter().map(write).collect()
}

#[test]
fn formats_that_are_not_read_are_named() {
    let made = tempfile::tempdir().unwrap();
    are_named(beginnings(made.path()));
    if let Some(folder) = models() {
        are_named(all_files(&folder));
    }
}

/// Every file of a format without a reader is refused by its name; there is one of each.
fn are_named(files: Vec<PathBuf>) {
    let mut seen = Vec::new();
    for file in files {
        let name = file.to_string_lossy().into_owned();
        let wanted = match ending(&file).as_str() {
            "las" => "LAS",
            "laz" if name.contains(".copc.") => "COPC",
            "laz" => "LAZ",
            "e57" => "E57",
            "pcd" => "PCD",
            "glb" => "glTF",
            "qs" => "QSplat",
            "xyz" => "XYZ",
            _ => continue,
        };
        let run = surfel(["info", &name]);
        assert_eq!((run.code, run.out.len()), (2, 0), "{name}: {}", run.err);
        assert!(
            run.err.contains(&name) && run.err.contains(wanted) && run.err.contains("not read yet"),
            "{name}: {}",
            run.err
        );
        // By content, not by name.
        let disguised = tempfile::tempdir().unwrap();
        let disguise = disguised.path().join("model.ply");
        std::fs::copy(&file, &disguise).unwrap();
        let run = surfel([Path::new("info"), &disguise]);
        assert_eq!(run.code, 2, "{name} as a PLY file: {}", run.err);
        assert!(
            wanted == "XYZ" || run.err.contains(wanted),
            "{name} as a PLY file: {}",
            run.err
        );
        seen.push(wanted);
    }
    seen.sort_unstable();
    seen.dedup();
    assert_eq!(
        seen,
        ["COPC", "E57", "LAS", "LAZ", "PCD", "QSplat", "XYZ", "glTF"]
    );
}
