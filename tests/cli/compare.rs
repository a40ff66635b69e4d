//! `surfel compare` and the built-in scenes from outside.

use super::harness::{expect, names, surfel_in};
use std::path::Path;
use surfel::image::{FloatImage, Image, PixelSource};

/// A picture of 40 x 30 pixels of one gray.
fn gray(at: &Path, name: &str, level: u8) {
    Image::filled(40, 30, [level, level, level, 255])
        .save_png(&at.join(name))
        .unwrap();
}

#[test]
fn equal_pictures_are_equal_in_every_figure() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    gray(at, "a.png", 100);
    let run = expect(at, 0, "compare a.png a.png");
    for part in ["40 x 30", "flip", "inf dB", "1.00000", "0 pixels differ"] {
        assert!(run.text().contains(part), "{part}: {}", run.text());
    }
    let json = expect(
        at,
        0,
        "compare a.png a.png --json --max-flip 0 --min-psnr 100 --min-ssim 1 --max-level 0",
    )
    .json();
    assert_eq!(
        (json["width"].as_u64(), json["height"].as_u64()),
        (Some(40), Some(30))
    );
    assert_eq!(json["flip"], 0.0);
    // JSON has no infinity.
    assert!(json["psnr_db"].is_null() && json["coverage"].is_null());
    assert!((json["ssim"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    assert_eq!(json["worst_tile"]["rmse"], 0.0);
}

#[test]
fn figures_of_constant_pictures_have_closed_forms_and_bounds_decide_the_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    gray(at, "a.png", 51);
    gray(at, "b.png", 102);
    let json = expect(at, 0, "compare a.png b.png --json").json();
    let value = |name: &str| json[name].as_f64().unwrap();
    // A fifth of the range everywhere.
    let psnr = -20.0 * 0.2f64.log10();
    assert!((value("psnr_db") - psnr).abs() < 1e-4, "{json}");
    assert!((value("max_level") - 51.0).abs() < 1e-3 && (value("mean_level") - 51.0).abs() < 1e-3);
    assert_eq!(json["pixels_past_a_level"], 1200);
    let c1 = 1e-4;
    let ssim = (2.0 * 0.2 * 0.4 + c1) / (0.04 + 0.16 + c1);
    assert!((value("ssim") - ssim).abs() < 1e-6, "{json}");
    assert!((0.01..0.9).contains(&value("flip")), "{json}");
    assert!((json["worst_tile"]["rmse"].as_f64().unwrap() - 0.2).abs() < 1e-6);

    for (bound, code) in [
        ("--max-flip 0.9", 0),
        ("--max-flip 0.01", 1),
        ("--min-psnr 13.9", 0),
        ("--min-psnr 14", 1),
        ("--min-ssim 0.7", 0),
        ("--min-ssim 0.9", 1),
        ("--max-level 52", 0),
        ("--max-level 50", 1),
        ("--max-level 52 --min-psnr 20", 1),
    ] {
        let run = expect(at, code, &format!("compare a.png b.png {bound}"));
        // The figures are told either way.
        assert!(run.text().contains("psnr"), "{bound}: {}", run.text());
        if code == 1 {
            let option = bound.split(' ').rev().nth(1).unwrap();
            assert!(
                run.err.contains("b.png") && run.err.contains(option),
                "{bound}: {}",
                run.err
            );
        } else {
            assert_eq!(run.err, "", "{bound}");
        }
    }
}

#[test]
fn what_cannot_be_compared_is_bad_input() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    gray(at, "a.png", 51);
    Image::filled(30, 40, [0; 4])
        .save_png(&at.join("tall.png"))
        .unwrap();
    std::fs::write(at.join("noise.png"), "no picture").unwrap();
    let whole = std::fs::read(at.join("a.png")).unwrap();
    std::fs::write(at.join("half.png"), &whole[..whole.len() / 2]).unwrap();
    std::fs::create_dir(at.join("folder.png")).unwrap();
    let before = names(at);
    for (words, reason) in [
        ("a.png", "PICTURE"),
        ("a.png tall.png", "40 x 30 pixels, tall.png has 30 x 40"),
        ("a.png missing.png", "missing.png"),
        ("missing.exr a.png", "missing.exr"),
        ("a.png noise.png", "noise.png: it is neither"),
        ("a.png half.png", "half.png"),
        ("a.png folder.png", "folder.png"),
        ("a.png a.png --difference d.exr", "png"),
        ("a.png a.png --difference a.png", "written over"),
        ("a.png a.png --worst w.png --flip-map w.png", "written over"),
        ("a.png a.png --gain 2", "--difference"),
        ("a.png a.png --difference d.png --gain 0", "--gain"),
        ("a.png a.png --tile 0", "--tile"),
        ("a.png a.png --pixels-per-degree 0", "--pixels-per-degree"),
        ("a.png a.png --background pink", "#rrggbb"),
        ("a.png a.png --max-flip nan", "--max-flip"),
        ("a.png a.png --max-missing -1", "-1"),
        ("a.png a.png --max-missing 3", "--background"),
        ("a.png a.png --max-silhouette 1", "--background"),
    ] {
        let run = expect(at, 2, &format!("compare {words}"));
        assert!(run.err.contains(reason), "{words}: {:?}", run.err);
        assert_eq!(run.out, b"", "{words}");
        assert_eq!(names(at), before, "{words} left something");
    }
    let run = expect(at, 1, "compare a.png a.png --difference none/d.png");
    assert!(run.err.contains("none"), "{}", run.err);
}

#[test]
fn coverage_and_silhouette_come_from_alpha_or_a_background() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // A square of 20 x 20, and the same two columns further with a hole of 2 x 3.
    let square = |shift: usize, has_hole: bool, file: &str| {
        let mut image = Image::filled(60, 50, [0, 0, 0, 0]);
        for y in 10..30 {
            for x in 10 + shift..30 + shift {
                let is_hole = has_hole && (20..22).contains(&x) && (18..21).contains(&y);
                if !is_hole {
                    image.color[y * 60 + x] = [90, 90, 90, 255];
                }
            }
        }
        image.save_exr(&at.join(format!("{file}.exr"))).unwrap();
        image.save_png(&at.join(format!("{file}.png"))).unwrap();
    };
    square(0, false, "a");
    square(2, true, "b");
    for words in [
        "compare a.exr b.exr --json",
        "compare a.png b.png --background black --json",
    ] {
        let json = expect(at, 0, words).json();
        let c = &json["coverage"];
        for (name, value) in [
            ("covered", 400),
            ("missing", 46),
            ("extra", 40),
            ("holes", 1),
            ("hole_pixels", 6),
            ("largest_hole", 6),
        ] {
            assert_eq!(c[name], value, "{words}: {name}: {c}");
        }
        assert!(json["silhouette_px"]["mean"].as_f64().unwrap() > 0.5);
        assert_eq!(json["object_pixels"], 440);
    }
    // Without either nothing is known.
    let json = expect(at, 0, "compare a.png b.png --json").json();
    assert!(json["coverage"].is_null() && json["silhouette_px"].is_null());
    for (bound, code) in [
        ("--max-missing 46 --max-extra 40 --max-holes 1", 0),
        ("--max-missing 45", 1),
        ("--max-extra 39", 1),
        ("--max-holes 0", 1),
        ("--max-silhouette 0.1", 1),
        ("--min-object-psnr 3", 0),
        ("--min-object-psnr 60", 1),
    ] {
        expect(at, code, &format!("compare a.exr b.exr {bound}"));
    }

    // The pictures of the difference: twice the gray where one is covered, and three crops side by side.
    expect(
        at,
        0,
        "compare a.png b.png --difference d.png --gain 2 --worst w.png --flip-map f.png --tile 16",
    );
    let load = |name: &str| FloatImage::load(&at.join(name)).unwrap();
    let difference = load("d.png").to_image();
    assert_eq!(difference.color[15 * 60 + 10], [180, 180, 180, 255]);
    assert_eq!(difference.color[15 * 60 + 15], [0, 0, 0, 255]);
    let [width, height] = load("w.png").size();
    assert!(width > 3 * 256 && height > 256, "{width} x {height}");
    let flip = load("f.png");
    assert_eq!(flip.size(), [60, 50]);
    assert!(flip.color[15 * 60 + 10][0] > flip.color[45 * 60 + 55][0] + 0.05);
}

#[test]
fn a_scene_is_drawn_with_its_own_camera_size_and_threshold() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = "render --scene edge-on --device mirror";
    expect(at, 0, &format!("{scene} -o a.exr --save-camera c.json"));
    let image = FloatImage::load(&at.join("a.exr")).unwrap();
    assert_eq!(image.size(), [240, 240]);
    // Six rows: the scene's threshold.
    let rows = |image: &FloatImage, width: usize| {
        (0..image.color.len() / width)
            .filter(|y| image.color[y * width + width / 2][3] > 0.0)
            .count()
    };
    assert_eq!(rows(&image, 240), 6);
    // The same by its parts.
    expect(
        at,
        0,
        "render scene:edge-on --camera c.json --threshold 6 --samples 1 --light headlight --ambient-occlusion off -o b.exr --device mirror",
    );
    let bytes = |name: &str| std::fs::read(at.join(name)).unwrap();
    assert!(bytes("a.exr") == bytes("b.exr"));
    // What is given goes before the scene's.
    expect(
        at,
        0,
        &format!("{scene} --threshold 10 --size 480x480 -o c.exr"),
    );
    let image = FloatImage::load(&at.join("c.exr")).unwrap();
    assert_eq!((image.size(), rows(&image, 480)), ([480, 480], 10));
    expect(at, 0, &format!("{scene} --orbit 0,90 -o d.exr"));
    assert_eq!(
        FloatImage::load(&at.join("d.exr")).unwrap().size(),
        [500, 500]
    );
    // Other commands take scenes as models.
    let info = expect(at, 0, "info scene:edge-on --json").json();
    assert_eq!(info["triangles"], 7200);
    expect(at, 0, "build scene:needles -o n.surfel");
    expect(at, 0, "check n.surfel");
    for (words, reason) in [
        ("render --scene no-such -o a.png", "surfel scenes"),
        ("info scene:no-such", "no-such"),
        ("render --scene fence model.ply -o a.png", "MODEL"),
        ("render -o a.png", "MODEL"),
        ("render --scene fence", "nothing to write"),
        (
            "render --scene fence --size 100x50 -o a.png",
            "another shape",
        ),
        ("build scene:fence", "-o FILE"),
    ] {
        let run = surfel_in(at, words.split(' '));
        assert_eq!(run.code, 2, "{words}: {}", run.err);
        assert!(run.err.contains(reason), "{words}: {}", run.err);
    }
}

#[test]
fn every_scene_is_listed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let list = expect(at, 0, "scenes").text();
    assert_eq!(list, expect(at, 0, "render --scene list").text());
    let json = expect(at, 0, "scenes --json").json();
    let scenes = json.as_array().unwrap();
    assert_eq!(scenes.len(), surfel::scenes::ALL.len());
    for (scene, entry) in scenes.iter().zip(surfel::scenes::ALL) {
        assert_eq!(scene["name"], entry.name);
        for text in [entry.name, entry.shows, entry.fails] {
            assert!(list.contains(text), "{text}");
        }
    }
    let sheets = scenes.iter().find(|s| s["name"] == "sheets-1").unwrap();
    assert_eq!(sheets["expected"]["gap"], 1.0);
}

#[test]
fn alpha_depth_and_every_other_channel_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut image = Image::filled(40, 30, [90, 90, 90, 255]);
    image.depth = vec![2.0; 1200];
    image.normal = vec![[0.0, 0.0, 1.0]; 1200];
    let mut other = image.clone();
    other.depth.fill(2.5);
    for pixel in &mut other.color[..600] {
        pixel[3] = 127;
    }
    for (image, name) in [(&image, "a"), (&other, "b")] {
        let path = |what: &str| at.join(format!("{name}{what}"));
        image.save_png(&path(".png")).unwrap();
        image.save_png_with_coverage(&path("-alpha.png")).unwrap();
        image.save_depth_exr(&path("-depth.exr")).unwrap();
        image.save_normal_exr(&path("-normal.exr")).unwrap();
    }
    for (words, equal, wanted) in [
        ("a.png b.png", true, "equal in every channel"),
        ("a-depth.exr a-depth.exr", true, "equal in every channel"),
        (
            "a.png b-alpha.png",
            false,
            "channel A    600 of 1200 values differ",
        ),
        ("b-alpha.png a.png", false, "different in A"),
        (
            "a-depth.exr b-depth.exr",
            false,
            "1200 of 1200 values differ; 0.500000 mean, 0.500000 at most",
        ),
        (
            "a-depth.exr b-depth.exr",
            false,
            "not in both files: no flip",
        ),
        (
            "a-depth.exr a-normal.exr",
            false,
            "Z is only in a-depth.exr",
        ),
        ("a.png a-depth.exr", false, "R is only in a.png"),
    ] {
        let text = expect(at, 0, &format!("compare {words}")).text();
        assert!(text.contains(wanted), "{words}: {text}");
        assert_eq!(
            text.contains("equal in every channel"),
            equal,
            "{words}: {text}"
        );
        let json = expect(at, 0, &format!("compare {words} --json")).json();
        assert_eq!(json["equal"], equal, "{words}: {json}");
        let code = i32::from(!equal);
        expect(at, code, &format!("compare {words} --equal"));
        expect(at, code, &format!("compare {words} --max-difference 0"));
    }
    for (bound, code) in [
        ("a-depth.exr b-depth.exr --max-difference 0.5", 0),
        ("a-depth.exr b-depth.exr --max-difference 0.4", 1),
        ("a.png b-alpha.png --max-level 128", 0),
        ("a.png b-alpha.png --max-level 127", 1),
        ("a-depth.exr b-depth.exr --max-level 1", 2),
        // Half transparent is not covered; 127 of 255 is less than that.
        ("a.png b-alpha.png --max-missing 600", 0),
        ("a.png b-alpha.png --max-missing 599", 1),
    ] {
        expect(at, code, &format!("compare {bound}"));
    }
    let json = expect(at, 0, "compare a-depth.exr b-depth.exr --json").json();
    assert!(
        json["flip"].is_null() && json["max_level"].is_null(),
        "{json}"
    );
    assert_eq!(json["channels"][0]["name"], "Z");
}
