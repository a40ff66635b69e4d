//! Trees of several files joined into one.

use super::harness::expect;
use std::fmt::Write;
use std::path::Path;

/// A tile of a landscape of 40 x 40 faces at this place, as a paged tree.
fn tile(at: &Path, name: &str, x: f64, y: f64) {
    let mut text = String::new();
    let height = |x: f64, y: f64| (x * 0.21).sin() * 3.0 + (y * 0.13).cos() * 5.0;
    for row in 0..=40 {
        for column in 0..=40 {
            let (x, y) = (x + f64::from(column), y + f64::from(row));
            writeln!(text, "v {x} {y} {}", height(x, y)).unwrap();
        }
    }
    for row in 0..40 {
        for column in 0..40 {
            let first = row * 41 + column + 1;
            let [a, b, c, d] = [first, first + 1, first + 42, first + 41];
            writeln!(text, "f {a} {b} {c} {d}").unwrap();
        }
    }
    std::fs::write(at.join("tile.obj"), text).unwrap();
    let line = format!("build tile.obj -o {name} --page-leaves 128 -q");
    expect(at, 0, &line);
}

fn landscape(at: &Path) -> String {
    std::fs::create_dir(at.join("tiles")).unwrap();
    let mut names = Vec::new();
    for (index, (x, y)) in [
        (0.0, 0.0),
        (40.0, 0.0),
        (0.0, 40.0),
        (40.0, 40.0),
        (80.0, 0.0),
    ]
    .into_iter()
    .enumerate()
    {
        let name = format!("tiles/{index}.surfel");
        tile(at, &name, x, y);
        names.push(name);
    }
    names.join(" ")
}

#[test]
fn joined_trees_are_drawn_as_their_files_are() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let tiles = landscape(at);
    let run = expect(at, 0, &format!("join {tiles} -o all.surfel"));
    assert!(
        run.err.contains("5 files with 16,000 leaves"),
        "{}",
        run.err
    );
    let facts = expect(at, 0, "info all.surfel --json").json();
    assert_eq!(facts["triangles"], 16_000);
    assert_eq!(facts["tree"]["files"].as_array().unwrap().len(), 5);
    assert_eq!(
        facts["tree"]["files"][0].as_str().unwrap().len(),
        "tiles/0.surfel".len()
    );
    let text = expect(at, 0, "info all.surfel").text();
    assert!(
        text.contains("joined of 5 files") && text.contains("tiles/3.surfel"),
        "{text}"
    );
    let checked = expect(at, 0, "check all.surfel").text();
    assert!(
        checked.contains("clean") && checked.contains("16,000 leaves"),
        "{checked}"
    );
    // From a folder beside it the paths still lead there.
    std::fs::create_dir(at.join("elsewhere")).unwrap();
    expect(at, 0, &format!("join {tiles} -o elsewhere/all.surfel"));
    let draw = "--backend cpu --samples 1 --size 160x120 --light headlight -q";
    expect(
        at,
        0,
        &format!("render {tiles} {draw} --save-camera c.json -o files.png"),
    );
    for name in ["all", "elsewhere/all"] {
        expect(
            at,
            0,
            &format!("render {name}.surfel {draw} --camera c.json -o joined.png"),
        );
        let [one, two] =
            ["files.png", "joined.png"].map(|name| image::open(at.join(name)).unwrap().into_rgb8());
        let different = one
            .pixels()
            .zip(two.pixels())
            .filter(|(a, b)| a != b)
            .count();
        let covered = one
            .pixels()
            .filter(|pixel| *pixel != one.get_pixel(0, 0))
            .count();
        // The zero of the joined model is the middle of all: places move by roundings of single precision.
        assert!(
            covered > 3000 && different * 50 < covered,
            "{different} of {covered}"
        );
    }
}

#[test]
fn a_missing_file_is_named_and_drawn_coarse_and_wrong_ones_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let tiles = landscape(at);
    expect(at, 0, &format!("join {tiles} -o all.surfel -q"));
    std::fs::rename(at.join("tiles/1.surfel"), at.join("gone")).unwrap();
    let draw = "render all.surfel --backend cpu --samples 1 --size 160x120 -q -o p.png";
    let run = expect(at, 0, draw);
    assert!(
        run.err.contains("tiles/1.surfel") && at.join("p.png").exists(),
        "{}",
        run.err
    );
    let run = expect(at, 1, "check all.surfel");
    assert!(run.text().contains("tiles/1.surfel"), "{}", run.text());
    for (line, cause) in [
        ("join tiles/1.surfel -o b.surfel", "tiles/1.surfel"),
        ("join tile.obj -o b.surfel", "surfel build"),
        (
            "join tiles/0.surfel all.surfel -o b.surfel",
            "joins files itself",
        ),
        (
            "join tiles/0.surfel ./tiles/0.surfel -o b.surfel",
            "named twice",
        ),
        ("join tiles/0.surfel -o tiles/0.surfel", "over itself"),
        ("build all.surfel -o b.surfel", "5 files"),
        ("join -o b.surfel", "TREE"),
    ] {
        let run = expect(at, 2, line);
        assert!(run.err.contains(cause), "{line}: {}", run.err);
        assert!(!at.join("b.surfel").exists());
    }
}
