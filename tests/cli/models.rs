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
        .filter(|f| {
            let read = [
                "obj", "ply", "stl", "off", "las", "laz", "e57", "pcd", "xyz",
            ];
            read.contains(&ending(f).as_str())
        })
        .collect();
    assert!(files.len() >= 40, "{} models", files.len());
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
const BEGINNINGS: [(&str, &[u8]); 8] = [
    ("a.las", b"LASF\0\0\0\0"),
    ("a.e57", b"ASTM-E57\x01\0\0\0"),
    ("a.pcd", b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\n"),
    ("a.glb", b"glTF\x02\0\0\0"),
    ("a.gltf", b"{\"asset\": {\"version\": \"2.0\"}}"),
    ("a.qs", b"QSplat11\0\0\0\0"),
    ("a.fbx", b"Kaydara FBX Binary\0"),
    ("a.3mf", b"PK\x03\x04"),
];

#[test]
fn beginnings_are_refused_by_their_content() {
    let made = tempfile::tempdir().unwrap();
    for (name, bytes) in BEGINNINGS {
        let words = match ending(Path::new(name)).as_str() {
            "las" => "a LAS header has 227 bytes",
            "e57" => "the description",
            "pcd" => "the header has no line DATA",
            "glb" => "the description",
            "gltf" => "the file has no vertices",
            "qs" => "the file ends within a header",
            "fbx" => "FBX, which is not read yet",
            _ => "a ZIP archive, which is not read yet",
        };
        // By content, not by name.
        for name in [name, "model.ply", "model"] {
            let path = made.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            let run = surfel([Path::new("info"), &path]);
            assert_eq!((run.code, run.out.len()), (2, 0), "{name}: {}", run.err);
            let named = run.err.contains(&*path.to_string_lossy());
            assert!(named && run.err.contains(words), "{name}: {}", run.err);
        }
    }
}

#[test]
fn the_tree_of_another_program_is_a_cloud() {
    let Some(folder) = models() else { return };
    let tree = folder.join("qsplat/horse.qs");
    let run = surfel([Path::new("info"), &tree]);
    // As many points as its header says.
    let text = run.text();
    assert!(
        run.code == 0 && text.contains("QSplat") && text.contains("48,485"),
        "{text} {}",
        run.err
    );
}

/// Tiles of one place: a value has one color in all of them.
#[test]
fn several_clouds_are_colored_over_the_range_of_all() {
    let made = tempfile::tempdir().unwrap();
    let tile = |name: &str, first: i32| {
        let path = made.path().join(name);
        let row = |i: i32| format!("{},{},0,{}\n", i % 10 + first, i / 10, i + first);
        let rows: String = (0..100).map(row).collect();
        std::fs::write(&path, format!("x,y,z,intensity\n{rows}")).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (low, high) = (tile("low.csv", 0), tile("high.csv", 50));
    let picture = made.path().join("a.png");
    let picture = picture.to_str().unwrap();
    for more in [&["--backend", "cpu"][..], &["--color-range", "7,9"]] {
        let said = match more[0] {
            "--backend" => "all models are colored from 2 to 147",
            _ => "all models are colored from 7 to 9",
        };
        let args = [
            "render",
            &low,
            &high,
            "-o",
            picture,
            "--color-by",
            "intensity",
        ];
        let run = surfel(args.iter().chain(more));
        assert_eq!(run.code, 0, "{}", run.err);
        assert_eq!(run.err.matches(said).count(), 1, "{}", run.err);
    }
}

#[test]
fn clouds_are_listed_and_colored_by_what_they_carry() {
    let made = tempfile::tempdir().unwrap();
    let cloud = made.path().join("a.csv");
    let rows: String = (0..100)
        .map(|i| format!("{},{},0,{i},{}\n", i % 10, i / 10, 2 + i % 5))
        .collect();
    std::fs::write(&cloud, format!("x,y,z,intensity,class\n{rows}")).unwrap();
    let run = surfel([Path::new("info"), &cloud]);
    assert_eq!(run.code, 0, "{}", run.err);
    assert!(
        run.text().contains("attribute intensity")
            && run.text().contains("0 to 99, 1 byte a point")
    );
    assert!(
        run.err
            .contains("warning: columns: x y z intensity class; between commas")
    );
    let (file, picture) = (cloud.to_str().unwrap(), made.path().join("a.png"));
    let render = |more: &[&str]| {
        let mut args = vec![
            "render",
            file,
            "-o",
            picture.to_str().unwrap(),
            "--backend",
            "cpu",
        ];
        args.extend(more);
        surfel(args)
    };
    let pixels = |more: &[&str]| {
        let run = render(more);
        assert_eq!(run.code, 0, "{}", run.err);
        (std::fs::read(&picture).unwrap(), run.err)
    };
    let (plain, _) = pixels(&[]);
    let (classes, said) = pixels(&["--color-by", "class"]);
    assert!(
        said.contains("colors show class: 2 ground #aa7846"),
        "{said}"
    );
    let (intensity, said) = pixels(&["--color-by", "intensity", "--color-range", "0,50"]);
    assert!(
        said.contains("colors show intensity: dark blue 0 to yellow 50"),
        "{said}"
    );
    assert!(plain != classes && classes != intensity);
    let run = render(&["--color-by", "warmth"]);
    assert!(
        run.code == 2 && run.err.contains("there is height, intensity, class"),
        "{}",
        run.err
    );
    let run = render(&["--color-by", "class", "--color-range", "5,1"]);
    assert!(
        run.code == 2 && run.err.contains("the smaller first"),
        "{}",
        run.err
    );
}
