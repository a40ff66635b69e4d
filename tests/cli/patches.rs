//! Records of error patches in tree files.

use super::harness::expect;

#[test]
fn records_of_patches_stay_in_the_tree_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    expect(
        at,
        0,
        "build generate:statue:3000 -o with.surfel --patches --exact -q",
    );
    expect(
        at,
        0,
        "build generate:statue:3000 -o without.surfel --exact -q",
    );
    let bytes = |name: &str| {
        let facts = expect(at, 0, &format!("info {name} --json")).json();
        facts["patch_bytes"].as_u64()
    };
    assert_eq!(bytes("without.surfel"), None);
    let nodes = expect(at, 0, "info with.surfel --json").json()["tree"]["interior_nodes"].as_u64();
    assert_eq!(bytes("with.surfel"), nodes.map(|nodes| 36 * nodes));
    let checked = expect(at, 0, "check with.surfel").text();
    assert!(checked.contains("clean"), "{checked}");
    // Records that are read draw what those draw that are made now.
    let draw = |name: &str| {
        let words = "--error 0.15,0.25,24 --backend cpu --samples 1 --size 90x90 -o p.png -q";
        expect(at, 0, &format!("render {name} {words}"));
        std::fs::read(at.join("p.png")).unwrap()
    };
    assert!(draw("with.surfel") == draw("without.surfel"));
    std::fs::write(at.join("points.xyz"), "0 0 0\n1 0 0\n0 1 0\n").unwrap();
    let run = expect(at, 2, "build points.xyz -o p.surfel --patches -q");
    assert!(run.err.contains("only surfaces"), "{}", run.err);
    expect(at, 2, "build points.xyz -o p.surfel --patches --exact");
    expect(
        at,
        2,
        "build generate:statue:3000 -o p.surfel --patches --memory 1GiB",
    );
}

#[test]
fn pages_keep_them_too() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let statue = "generate:statue:3000";
    for (name, words) in [("with", "--patches"), ("without", "")] {
        let line = format!("build {statue} -o {name}.surfel --page-leaves 256 {words} -q");
        expect(at, 0, &line);
    }
    let has_patches = |name: &str| {
        let facts = expect(at, 0, &format!("info {name}.surfel --json")).json();
        assert!(facts["patch_bytes"].is_null());
        facts["tree"]["has_patches"].as_bool()
    };
    assert_eq!(has_patches("with"), Some(true));
    assert_eq!(has_patches("without"), Some(false));
    let checked = expect(at, 0, "check with.surfel").text();
    assert!(checked.contains("clean"), "{checked}");
    let words = "--error 0.15,0.25,24 --backend cpu --samples 1 --size 90x90 -o p.png -q";
    expect(at, 0, &format!("render with.surfel {words}"));
    // Pages without records are read whole, and records are made.
    let bytes = |name: &str| {
        expect(at, 0, &format!("render {name}.surfel {words}"));
        std::fs::read(at.join("p.png")).unwrap()
    };
    expect(at, 0, "build without.surfel -o joined.surfel --exact -q");
    assert!(bytes("without") == bytes("joined"));
    // What was kept is kept again.
    expect(at, 0, "build with.surfel -o whole.surfel --exact -q");
    expect(at, 0, "build whole.surfel -o again.surfel -q");
    assert_eq!(has_patches("again"), Some(true));
}
