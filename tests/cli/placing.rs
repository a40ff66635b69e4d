//! Normals that are chosen, and models that are placed and colored beside others.

use super::harness::{expect, names};
use std::path::Path;

fn bytes(at: &Path, name: &str) -> Vec<u8> {
    std::fs::read(at.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// A pyramid moved along x, with normals that no computation gives.
fn pyramid(at: &Path, name: &str, [x, y]: [f64; 2]) {
    let corners = [[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 2, 0]];
    let mut text = String::new();
    for [a, b, c] in corners {
        text += &format!("v {} {} {c}\n", f64::from(a) + x, f64::from(b) + y);
        text += "vn 0 1 0\n";
    }
    for face in ["1 2 3 4", "1 5 2", "2 5 3", "3 5 4", "4 5 1"] {
        let face = face.split(' ').map(|i| format!("{i}//{i}"));
        text += &format!("f {}\n", face.collect::<Vec<_>>().join(" "));
    }
    std::fs::write(at.join(name), text).unwrap();
}

const LOOK: &str = "--size 90x70 --backend cpu -o";

#[test]
fn normals_are_flat_smooth_or_those_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    pyramid(at, "a.obj", [0.0; 2]);
    let draw = |words: &str| {
        let run = expect(at, 0, &format!("render a.obj {LOOK} p.png {words}"));
        assert!(run.err.is_empty(), "{words}: {}", run.err);
        bytes(at, "p.png")
    };
    let [file, flat, smooth] = ["file", "flat", "smooth"].map(|n| draw(&format!("--shading {n}")));
    assert!(file != flat && file != smooth);
    assert!(file == draw("") && flat == draw("--crease 0") && smooth == draw("--crease 40"));
    // Its edges are all above 40 degrees, not all above 120.
    assert!(smooth == flat && draw("--shading smooth --crease 150") != flat);
    for name in ["flat", "file"] {
        let run = expect(
            at,
            2,
            &format!("render a.obj {LOOK} p.png --shading {name} --crease 9"),
        );
        assert!(run.err.contains("--shading smooth"), "{}", run.err);
    }
    expect(at, 2, &format!("render a.obj {LOOK} p.png --shading round"));
}

#[test]
fn old_values_of_shading_still_work_and_point_to_the_new_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let look = "render generate:statue:2000 --size 60x60 --backend reference --splat gauss -t 4 -o";
    expect(at, 0, &format!("{look} new.png --splat-shading deferred"));
    expect(at, 0, &format!("{look} usual.png"));
    for old in ["--shading deferred", "--shading=deferred"] {
        let run = expect(at, 0, &format!("{look} old.png {old}"));
        let told = "--shading deferred is now --splat-shading deferred";
        assert!(run.err.contains(told), "{}", run.err);
        assert!(bytes(at, "old.png") == bytes(at, "new.png"));
        assert!(bytes(at, "old.png") != bytes(at, "usual.png"));
    }
}

#[test]
fn models_stand_where_their_transforms_say_in_the_colors_that_were_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    pyramid(at, "a.obj", [0.0; 2]);
    pyramid(at, "b.obj", [3.0, 1.0]);
    std::fs::write(at.join("t.txt"), "1 0 0 3\n0 1 0 1\n0 0 1 0\n0 0 0 1\n").unwrap();
    expect(at, 0, &format!("render a.obj b.obj {LOOK} two.png"));
    let placed = "render a.obj a.obj --transform none --transform t.txt";
    expect(at, 0, &format!("{placed} {LOOK} placed.png"));
    assert!(bytes(at, "two.png") == bytes(at, "placed.png"));
    expect(at, 0, &format!("render a.obj a.obj {LOOK} same.png"));
    assert!(bytes(at, "two.png") != bytes(at, "same.png"));
    let colored = format!("{placed} --model-color none --model-color #ff0000 {LOOK} red.png");
    expect(at, 0, &colored);
    let picture = image::open(at.join("red.png")).unwrap().into_rgb8();
    let gray = picture.pixels().filter(|p| p[0] > 40 && p[1] > 40).count();
    let red = picture.pixels().filter(|p| p[0] > 40 && p[1] == 0).count();
    assert!(gray > 200 && red > 200, "{gray} {red}");

    let wrong = |words: &str, part: &str| {
        let run = expect(at, 2, &format!("render {words} {LOOK} no.png"));
        assert!(run.err.contains(part), "{words}: {}", run.err);
    };
    wrong(
        "a.obj --transform t.txt --transform t.txt",
        "--transform is given 2 times, for 1 model",
    );
    wrong("a.obj --model-color pink", "or none");
    wrong("a.obj --transform gone.txt", "gone.txt");
    std::fs::write(at.join("bad.txt"), "1 0 0\n").unwrap();
    wrong(
        "a.obj --transform bad.txt",
        "bad.txt: 16 numbers are wanted",
    );
    std::fs::write(at.join("flat.txt"), "1 0 0 0 0 1 0 0 0 0 0 0 0 0 0 1").unwrap();
    wrong("a.obj --transform flat.txt", "flattens it");
    expect(at, 0, "build a.obj -o a.surfel");
    wrong(
        "a.surfel --transform t.txt",
        "a tree stays where it was built",
    );
    assert!(!names(at).contains(&"no.png".to_owned()));
}
