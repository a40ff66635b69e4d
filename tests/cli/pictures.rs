//! Pictures that the program writes: formats, cameras, samples, numbering, the demo.

use super::harness::{expect, has_device, names};
use std::path::Path;
use surfel::image::{FloatImage, PixelSource, compare};
use surfel::progress::SilentProgress;
use surfel::render::Settings;
use surfel::render::engine::{Backend, Engine};

fn load(path: &Path) -> FloatImage {
    FloatImage::load(path).unwrap_or_else(|e| panic!("{e}"))
}

fn bytes(at: &Path, name: &str) -> Vec<u8> {
    std::fs::read(at.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Whether two files are the same bit for bit (without printing them).
fn is_same(at: &Path, a: &str, b: &str) -> bool {
    bytes(at, a) == bytes(at, b)
}

#[test]
fn every_output_format_tells_the_same() {
    let mut devices = vec!["--device mirror"];
    if has_device() {
        devices.push("--validate");
    }
    for device in devices {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let outputs = "-o c.png --depth d.npy --normals n.exr --coverage a.png";
        let scene = format!("render generate:statue:20000 --size 96x80 --threshold 3 {device}");
        let run = expect(at, 0, &format!("{scene} {outputs}"));
        assert_eq!((run.out.len(), run.err.as_str()), (0, ""));
        expect(at, 0, &format!("{scene} -o c.exr --depth d.exr"));
        assert_eq!(
            names(at),
            ["a.png", "c.exr", "c.png", "d.exr", "d.npy", "n.exr"]
        );

        let [color, float, coverage, normal, depth] =
            ["c.png", "c.exr", "a.png", "n.exr", "d.exr"].map(|n| load(&at.join(n)));
        for image in [&color, &float, &coverage, &normal, &depth] {
            assert_eq!(image.size(), [96, 80]);
        }
        let stored = bytes(at, "d.npy");
        let array = npyz::NpyFile::new(&stored[..]).unwrap();
        assert_eq!(array.shape(), [80, 96]);
        let array: Vec<f32> = array.into_vec().unwrap();
        let mut covered = 0;
        assert_eq!(array.len(), 96 * 80);
        for (i, &distance) in array.iter().enumerate() {
            // 8 bits and floats of one picture.
            assert_eq!(color.color[i][..3], float.color[i][..3], "pixel {i}");
            assert_eq!(coverage.color[i][0], float.color[i][3], "pixel {i}");
            assert_eq!(distance.to_bits(), depth.depth[i].to_bits(), "pixel {i}");
            let n = glam::Vec3::from(normal.normal[i]);
            if float.color[i][3] == 1.0 {
                covered += 1;
                assert!(
                    distance > 0.0 && distance < 10.0,
                    "pixel {i}: depth {}",
                    distance
                );
                assert!((n.length() - 1.0).abs() < 1e-3, "pixel {i}: normal {n}");
            } else {
                assert_eq!(float.color[i], [0.0; 4], "pixel {i}");
                assert_eq!(distance, f32::INFINITY, "pixel {i}");
                assert_eq!(n, glam::Vec3::ZERO, "pixel {i}");
            }
        }
        // The statue in its bounding sphere.
        assert!((1000..4000).contains(&covered), "{covered} covered pixels");
    }
}

#[test]
fn the_device_draws_what_the_mirror_draws() {
    if !has_device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for method in ["triangles", "points", "pop"] {
        let scene =
            format!("render generate:torus:40000 --size 120x100 --method {method} --threshold 2");
        expect(at, 0, &format!("{scene} -o device.png --validate"));
        expect(at, 0, &format!("{scene} -o mirror.png --device mirror"));
        let d = compare(
            &load(&at.join("mirror.png")),
            &load(&at.join("device.png")),
            1.0,
        )
        .unwrap();
        // Needles are all edge; see the tolerances of the oracle.
        assert!(d.object.pixels > 2000, "{method}: {d:?}");
        assert!(
            d.whole.past_level <= 40 && d.missing + d.extra <= 20,
            "{method}: {d:?}"
        );
    }
}

#[test]
fn a_tree_file_is_its_model() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    expect(at, 0, "generate statue --triangles 9000 -o a.ply");
    expect(at, 0, "build a.ply --exact -o b.surfel");
    expect(at, 0, "build a.ply --exact -o c.surfel");
    assert!(
        is_same(at, "b.surfel", "c.surfel"),
        "trees of one model differ"
    );
    for method in ["triangles", "points", "pop"] {
        for model in ["a.ply", "b.surfel"] {
            expect(
                at,
                0,
                &format!(
                    "render {model} -o {model}.png --depth {model}.npy --method {method} --threshold 2 --size 90x90 --device mirror"
                ),
            );
        }
        assert!(is_same(at, "a.ply.png", "b.surfel.png"), "{method}");
        assert!(is_same(at, "a.ply.npy", "b.surfel.npy"), "{method}");
    }
    // Known by its content, whatever its name.
    std::fs::copy(at.join("b.surfel"), at.join("tree.bin")).unwrap();
    assert_eq!(
        expect(at, 0, "info --json tree.bin").json()["format"],
        "surfel tree"
    );
}

#[test]
fn a_saved_camera_gives_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = "render generate:statue:9000 --threshold 2 --device mirror";
    expect(
        at,
        0,
        &format!("{scene} --size 90x60 --orbit -77.7,-12.3,1.37 -o a.exr --save-camera c.json"),
    );
    expect(
        at,
        0,
        &format!("{scene} --camera c.json -o b.exr --save-camera d.json"),
    );
    assert!(is_same(at, "a.exr", "b.exr") && is_same(at, "c.json", "d.json"));
    // Another size of the same shape: the same view.
    expect(
        at,
        0,
        &format!("{scene} --camera c.json --size 270x180 -o large.png"),
    );
    assert_eq!(load(&at.join("large.png")).size(), [270, 180]);
    // And another direction is another picture.
    expect(
        at,
        0,
        &format!("{scene} --size 90x60 --orbit 77.7,-12.3,1.37 -o b.exr"),
    );
    assert!(!is_same(at, "a.exr", "b.exr"));
}

#[test]
fn frames_are_the_views_of_the_standard_orbit() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = "render generate:statue:9000 --size 50x40 --device mirror";
    expect(
        at,
        0,
        &format!("{scene} --frames 3 -o turn.png --depth turn.npy"),
    );
    let numbers = ["000", "001", "002"];
    let wanted: Vec<String> = numbers
        .iter()
        .flat_map(|n| [format!("turn-{n}.npy"), format!("turn-{n}.png")])
        .collect();
    assert_eq!(names(at), wanted);
    // Azimuth (k + 1/2) 360/n, elevation 20.
    for (number, azimuth) in numbers.iter().zip([60, 180, 300]) {
        expect(
            at,
            0,
            &format!("{scene} --orbit {azimuth},20 --samples 1 -o one.png"),
        );
        assert!(
            is_same(at, &format!("turn-{number}.png"), "one.png"),
            "{number}"
        );
    }
    assert!(!is_same(at, "turn-000.png", "turn-001.png"));
}

/// Two squares beside each other, each in a file with an origin of its own.
#[test]
fn several_models_are_one_picture() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, x) in [("a.obj", 5_000_000), ("b.obj", 5_000_003)] {
        let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| format!("v {} {j} 0\n", x + i));
        std::fs::write(at.join(name), corners.concat() + "f 1 2 3 4\n").unwrap();
    }
    // Coordinates of maps have z up; these stand in the plane of x and y.
    let look = "--size 80x40 --device mirror --samples 1 --orbit 0,0,1 --up y";
    expect(
        at,
        0,
        &format!("render a.obj b.obj -o both.png --stats s.json {look}"),
    );
    let picture = load(&at.join("both.png"));
    // Two runs in the middle row, as wide as the gap between them is twice.
    let row: Vec<bool> = (0..80)
        .map(|x| picture.color[20 * 80 + x][0] > 0.0)
        .collect();
    let runs: Vec<(bool, usize)> = row
        .chunk_by(|a, b| a == b)
        .map(|run| (run[0], run.len()))
        .collect();
    let [_, (true, first), (false, gap), (true, second), _] = runs[..] else {
        panic!("{runs:?}")
    };
    assert!(
        first.abs_diff(second) <= 1 && gap.abs_diff(2 * first) <= 2,
        "{runs:?}"
    );
    let stats: serde_json::Value =
        serde_json::from_slice(&std::fs::read(at.join("s.json")).unwrap()).unwrap();
    assert_eq!(stats["more_models"].as_array().unwrap().len(), 1);
    let run = expect(at, 2, "render a.obj none.obj -o c.png");
    assert!(run.err.contains("none.obj"), "{}", run.err);
}

/// Without a number of samples a picture is smooth: as near to 64 samples as 16 are.
#[test]
fn pictures_are_smooth_unless_samples_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = "render generate:statue:9000 --size 90x80 --device mirror";
    for (name, options) in [
        ("smooth", ""),
        ("one", "--samples 1"),
        ("right", "--samples 64 --method triangles"),
        ("depth", "--depth d.npy"),
    ] {
        let words = format!("{scene} -o {name}.png {options}");
        expect(at, 0, words.trim_end());
    }
    let [smooth, one, right] =
        ["smooth", "one", "right"].map(|n| load(&at.join(format!("{n}.png"))));
    let error = |image: &FloatImage| -> f64 {
        let pairs = image.color.iter().zip(&right.color);
        pairs.map(|(a, b)| f64::from((a[0] - b[0]).abs())).sum()
    };
    assert!(
        4.0 * error(&smooth) < error(&one),
        "{} {}",
        error(&smooth),
        error(&one)
    );
    // Depth is that of one sample, and so is the picture beside it.
    assert!(is_same(at, "depth.png", "one.png"));
}

/// What the library's settings for people give, of a surface and of points, is what `surfel render` writes.
#[test]
fn the_library_draws_the_default_picture() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    expect(at, 0, "generate statue --triangles 6000 -o statue.ply");
    let points = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/scan.ply.gz");
    std::fs::copy(points, at.join("points.ply.gz")).unwrap();
    let device = surfel::gpu::DeviceOptions {
        device: Some("cpu".to_owned()),
        ..Default::default()
    };
    let backend = Backend::open(&device).unwrap();
    for name in ["statue.ply", "points.ply.gz"] {
        let words = "--size 90x80 --orbit 30,20,1 --device cpu --up y -o drawn.png";
        expect(at, 0, &format!("render {name} {words}"));
        let opened = surfel::open(at.join(name), &Default::default(), &SilentProgress).unwrap();
        let model = opened.model;
        let angle = f64::to_radians;
        let camera = model.orbit_camera((90, 80), angle(30.0), angle(20.0), 1.0);
        let mut engine = Engine::new(&backend, &model, (90, 80), Default::default()).unwrap();
        let settings = Settings::for_people(&model);
        let view = camera.view(model.origin).unwrap();
        let picture = engine.smooth(&view, &settings).unwrap().to_image();
        picture.save_png(&at.join("own.png")).unwrap();
        assert!(is_same(at, "drawn.png", "own.png"), "{name}");
    }
}

#[test]
fn samples_are_averaged() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = "render generate:sphere:9000 --method triangles --device mirror";
    expect(
        at,
        0,
        &format!("{scene} --size 60x60 --samples 16 -o mean.exr --coverage mean.png"),
    );
    expect(
        at,
        0,
        &format!("{scene} --size 240x240 --samples 1 -o large.exr"),
    );
    let (mean, large, coverage) = (
        load(&at.join("mean.exr")),
        load(&at.join("large.exr")),
        load(&at.join("mean.png")),
    );
    // 4 x 4 regular samples are the pixels of a picture of 4 times the size, with the same smallest distance
    // of a sample to the next: exact but for the rounding of single precision, which moves an edge sample at times.
    let (mut past, mut partly) = (0, 0);
    for y in 0..60 {
        for x in 0..60 {
            let mut sum = [0.0; 4];
            for i in 0..16 {
                let p = large.color[(4 * y + i / 4) * 240 + 4 * x + i % 4];
                (0..4).for_each(|c| sum[c] += f64::from(p[c]) / 16.0);
            }
            let found = mean.color[y * 60 + x];
            past += usize::from((0..4).any(|c| (f64::from(found[c]) - sum[c]).abs() > 0.6 / 255.0));
            partly += usize::from(found[3] > 0.0 && found[3] < 1.0);
            assert_eq!((found[3] * 16.0).fract(), 0.0, "a share of 16 samples");
            assert!((coverage.color[y * 60 + x][0] - found[3]).abs() < 0.51 / 255.0);
        }
    }
    assert!(
        past <= 8,
        "{past} pixels differ from the mean of 16 samples"
    );
    assert!(partly > 100, "{partly} pixels are partly covered");
}

#[test]
fn looks_are_what_their_options_say() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = "render generate:sphere:9000 --size 60x60 --orbit 0,0,0.7 --device mirror --light headlight --ambient-occlusion off -o a.png";
    let draw = |options: &str| {
        expect(at, 0, &format!("{scene} {options}"));
        let image = load(&at.join("a.png"));
        let level = |x: usize, y: usize| {
            [0, 1, 2].map(|c| (image.color[y * 60 + x][c] * 255.0).round() as u8)
        };
        (level(0, 0), level(30, 30))
    };
    for (color, wanted) in [
        ("black", [0, 0, 0]),
        ("white", [255, 255, 255]),
        ("gray", [128, 128, 128]),
        ("#ff8001", [255, 128, 1]),
        ("10,20,30", [10, 20, 30]),
    ] {
        let (corner, middle) = draw(&format!("--background {color}"));
        assert_eq!(corner, wanted, "{color}");
        // Facing gray: 0.8 of 255.
        assert!(middle.iter().all(|c| c.abs_diff(204) <= 1), "{middle:?}");
    }
    let (_, splat) = draw("--color-by primitive --threshold 50");
    let (_, triangle) = draw("--color-by primitive --threshold 0");
    assert!(splat[0] > 100 && splat[2] < 50, "splats are red: {splat:?}");
    assert!(
        triangle[2] > 100 && triangle[0] < 50,
        "triangles are blue: {triangle:?}"
    );
}

#[test]
fn the_demo_writes_every_picture_and_the_sheet() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let run = expect(
        at,
        0,
        "demo --model generate:statue:20000 --repeats 1 --size 96x96 --device mirror -o deep/out",
    );
    let found = names(&at.join("deep/out"));
    assert_eq!(found.len(), 11, "{found:?}");
    for name in &found {
        let image = load(&at.join("deep/out").join(name));
        if name == "contact-sheet.png" {
            assert!(
                image.width > 5 * 96 && image.height > 2 * 96,
                "{:?}",
                image.size()
            );
        } else {
            assert_eq!(image.size(), [96, 96], "{name}");
        }
        let lit = image
            .color
            .iter()
            .filter(|c| c[0] > 0.1 || c[2] > 0.1)
            .count();
        assert!(lit > 50, "{name} shows {lit} pixels");
        assert!(
            run.text().contains(name.as_str()),
            "{name} is not told: {}",
            run.text()
        );
    }
    // Of so small a model POP at one pixel is all triangles; the others differ.
    let mut contents: Vec<_> = found
        .iter()
        .filter(|n| *n != "pop-1.png")
        .map(|n| bytes(&at.join("deep/out"), n))
        .collect();
    contents.sort();
    contents.dedup();
    assert_eq!(contents.len(), 10, "two pictures are the same");
}

/// `--splat filtered` from outside: a rim of part coverage, the same from a tree file, refusals by name.
#[test]
fn filtered_splats_cover_rims_in_part() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    expect(
        at,
        0,
        "render generate:statue:50000 --device mirror --size 96x96 --splat filtered -o f.png --coverage c.png",
    );
    let coverage = load(&at.join("c.png"));
    let part = coverage.color.iter().filter(|c| c[0] > 0.02 && c[0] < 0.98);
    assert!(part.count() > 20, "the rim is covered in part");
    expect(at, 0, "build generate:statue:50000 --exact -o s.surfel");
    expect(
        at,
        0,
        "render s.surfel --device mirror --size 96x96 --splat filtered -o g.png",
    );
    assert_eq!(load(&at.join("f.png")).color, load(&at.join("g.png")).color);
    for refused in [
        "--normals n.exr",
        "--one-sided",
        "--depth-offset -1",
        "--method points",
    ] {
        expect(
            at,
            2,
            &format!(
                "render generate:statue:5000 --device mirror --splat filtered -o r.png {refused}"
            ),
        );
    }
}

#[test]
fn overdraw_says_what_its_colors_mean() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = "render generate:sphere:9000 --size 60x60 --orbit 0,0,0.7 --device mirror --light headlight --ambient-occlusion off -o a.png";
    let counted = format!("{scene} --color-by overdraw");
    let all = format!("{counted} --method triangles --culling");
    // A line of sight goes into a ball and out of it.
    let run = expect(at, 0, &format!("{all} off"));
    let words = [
        "1 dark violet, 2 indigo",
        "64 and more yellow",
        "mean 2.00 in",
        "most 2\n",
    ];
    for words in words {
        assert!(run.err.contains(words), "{words}: {}", run.err);
    }
    let middle = load(&at.join("a.png")).color[30 * 60 + 30];
    let two = surfel::pack::falsecolor::of_overdraw(2);
    assert!(
        (0..3).all(|c| (middle[c] - two[c]).abs() < 0.003),
        "{middle:?}"
    );
    let run = expect(at, 0, &format!("{all} on"));
    assert!(
        run.err.contains("mean 1.00 in") && run.err.contains("most 1\n"),
        "{}",
        run.err
    );
    // Nothing is said where nobody wants to hear it, or of other colors.
    assert_eq!(expect(at, 0, &format!("--quiet {all} on")).err, "");
    assert!(!expect(at, 0, scene).err.contains("overdraw"));
    for (options, words) in [
        ("--samples 4", "leave --samples out"),
        ("--path compute", "leave --path compute out"),
    ] {
        let run = expect(at, 2, &format!("{counted} {options}"));
        assert!(run.err.contains(words), "{}", run.err);
    }
}
