//! What is kept of a scan in the window: a part of the tree that is there, and all of it again.

use crate::display::{Display, changed, load, must_succeed, run};
use crate::render;
use serde_json::{Value, json};
use std::path::Path;

/// First row and number of rows of the part of the picture between legend and messages.
const UNCOVERED_ROWS: [u32; 2] = [160, 190];

/// Steps of a recording.
#[derive(Default)]
struct Steps(Vec<String>);

impl Steps {
    fn add(&mut self, step: u32, event: Value) {
        let time = f64::from(step) / 10.0;
        let entry = json!({"step": step, "time": time, "event": event});
        self.0.push(entry.to_string());
    }

    fn click(&mut self, step: u32, at: [f64; 2]) {
        self.add(step, json!({ "cursor": at }));
        for (is_down, later) in [(true, 1), (false, 2)] {
            let button = json!({"button": "left", "pressed": is_down, "modifiers": {}});
            self.add(step + later, json!({ "button": button }));
        }
    }

    fn key(&mut self, step: u32, key: Value, control: bool) {
        let modifiers = json!({ "control": control });
        let key = json!({"key": key, "pressed": true, "modifiers": modifiers});
        self.add(step, json!({ "key": key }));
    }
}

#[test]
fn parts_are_kept_by_boxes_words_and_a_key() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let text = |name: &str| file(name).to_str().unwrap().to_owned();
    let rows: String = (0..400)
        .map(|i| {
            let (x, y) = (f64::from(i % 20), f64::from(i / 20));
            format!("{x},{y},{},{}\n", 0.25 * x, 2 + 4 * (i % 2))
        })
        .collect();
    std::fs::write(file("a.csv"), format!("x,y,z,class\n{rows}")).unwrap();
    let (model, camera) = (text("a.csv"), text("c.json"));
    // The panel takes 276 columns.
    let first = [
        &model,
        "--save-camera",
        &camera,
        "--size",
        "324x500",
        "--orbit",
        "20,50,1",
    ];
    render(&first, &file("first.png"));
    let look = [&model, "--camera", &camera, "--size", "324x500"];
    let look = &look[..];
    let window = [&model, "--camera", &camera, "--smooth", "off"];
    let mut steps = Steps::default();
    steps.add(
        0,
        json!({"size": {"width": 600, "height": 500, "scale": 1.0}}),
    );
    steps.add(1, json!({ "loaded": model }));
    // The box before "2 ground" of the panel.
    steps.click(5, [17.0, 198.0]);
    steps.add(10, json!({ "loaded": model }));
    steps.add(12, json!({"cursor": [590.0, 490.0]}));
    steps.key(20, json!({"char": "k"}), true);
    steps.add(22, json!({ "loaded": model }));
    // The field above.
    steps.click(30, [150.0, 175.0]);
    for (at, letter) in (35..).zip("class=2 height=..2".chars()) {
        steps.add(at, json!({ "text": letter }));
    }
    steps.key(60, json!("enter"), false);
    steps.add(62, json!({ "loaded": model }));
    steps.add(64, json!({"cursor": [590.0, 490.0]}));
    // The next colors are those by height, then by class, then again those of the file.
    for step in [70, 80, 90] {
        steps.key(step, json!({"char": "a"}), true);
        steps.add(step + 2, json!({ "loaded": model }));
    }
    let recording = format!("{{\"surfel_input\":1}}\n{}\n", steps.0.join("\n"));
    std::fs::write(file("input.jsonl"), recording).unwrap();
    let mut command = display.surfel(&window);
    command.args(["--validate", "--panel", "on", "--headless", "--replay"]);
    command.arg(file("input.jsonl"));
    command.args(["--pictures", &text("pictures")]);
    must_succeed(&run(command.current_dir(folder.path())));
    let shown = |step: u32| {
        let picture = load(&file("pictures").join(format!("step-{step:06}.png")));
        image::imageops::crop_imm(&picture, 276, 0, 324, 500).to_image()
    };
    let drawn = |more: &[&str]| render(&[look, more].concat(), &file("drawn.png"));
    let whole = drawn(&[]);
    let part = drawn(&["--keep", "class=6"]);
    assert!(changed(&whole, &part) > 1000);
    for (step, wanted, what) in [
        (2, &whole, "all"),
        (12, &part, "a class"),
        (23, &whole, "all again"),
        (
            64,
            &drawn(&["--keep", "class=2", "--keep", "height=..2"]),
            "words",
        ),
    ] {
        let differ = changed(&shown(step), wanted);
        assert!(differ < 100, "{what}: {differ} pixels differ");
    }
    let part = |picture: &image::RgbImage| {
        let [top, height] = UNCOVERED_ROWS;
        image::imageops::crop_imm(picture, 0, top, 324, height).to_image()
    };
    let kept = ["--keep", "class=2", "--keep", "height=..2"];
    let colored = |name: &str| part(&drawn(&[&kept[..], &["--color-by", name]].concat()));
    let plain = part(&drawn(&kept));
    for (step, wanted, what) in [
        (72, colored("height"), "height"),
        (82, colored("class"), "class"),
        (92, plain.clone(), "own colors"),
    ] {
        let differ = changed(&part(&shown(step)), &wanted);
        assert!(differ < 100, "{what}: {differ} pixels differ");
        let is_colored = changed(&plain, &wanted) > 500;
        assert_eq!(is_colored, step < 92, "{what}");
    }
}

#[test]
fn points_of_a_paged_file_are_colored_once_all_of_it_is_read() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let rows: String = (0..400)
        .map(|i| format!("{},{},{}\n", i % 20, i / 20, 0.25 * f64::from(i % 20)))
        .collect();
    std::fs::write(at.join("a.csv"), format!("x,y,z\n{rows}")).unwrap();
    let build = ["build", "a.csv", "-o", "a.surfel"];
    must_succeed(&run(display.surfel(&build).current_dir(at)));
    // The next colors are those by height. They make a part of what came whole.
    let key = json!({"char": "a"});
    let (plain, colored) = before_and_after(&display, at, "a.csv", (key.clone(), true), 1);
    let pages = before_and_after(&display, at, "a.surfel", (key, true), 2);
    assert!(differ(&plain, &colored) > 10_000);
    assert!(differ(&plain, &pages.0) < 1_000);
    // Heights in the legend are longer words by the rounding of pages.
    let off = differ(&colored, &pages.1);
    assert!(off < 3_000, "{off} pixels differ");
}

#[test]
fn all_of_a_paged_file_is_read_for_what_draws_all_of_it() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, kind) in [("exact.surfel", "--exact"), ("paged.surfel", "-q")] {
        let build = ["build", "generate:statue:3000", kind, "-o", name];
        must_succeed(&run(display.surfel(&build).current_dir(at)));
    }
    let triangles = (json!({"char": "a"}), false);
    let (_, exact) = before_and_after(&display, at, "exact.surfel", triangles.clone(), 0);
    let (_, paged) = before_and_after(&display, at, "paged.surfel", triangles, 1);
    let off = differ(&exact, &paged);
    assert!(off < 100, "{off} pixels differ");
}

/// Number of pixels that differ by more than pages round places and colors.
fn differ(a: &image::RgbImage, b: &image::RgbImage) -> usize {
    let is_far = |a: &image::Rgb<u8>, b: &image::Rgb<u8>| {
        (0..3).any(|channel| a.0[channel].abs_diff(b.0[channel]) > 40)
    };
    let pixels = a.pixels().zip(b.pixels());
    pixels.filter(|(a, b)| is_far(a, b)).count()
}

/// Pictures of a model as it comes, and after a key was pressed, with control or without, and it came so many times more.
fn before_and_after(
    display: &Display,
    folder: &Path,
    model: &str,
    (key, control): (Value, bool),
    times: u32,
) -> (image::RgbImage, image::RgbImage) {
    let mut steps = Steps::default();
    let size = json!({"width": 300, "height": 250, "scale": 1.0});
    steps.add(0, json!({ "size": size }));
    steps.add(1, json!({ "loaded": model }));
    steps.key(5, key, control);
    (0..times).for_each(|time| steps.add(7 + 2 * time, json!({ "loaded": model })));
    let recording = format!("{{\"surfel_input\":1}}\n{}\n", steps.0.join("\n"));
    std::fs::write(folder.join("input.jsonl"), recording).unwrap();
    let pictures = folder.join(format!("{model}-pictures"));
    let mut command = display.surfel(&[model, "--smooth", "off", "--panel", "off"]);
    command.args(["--headless", "--replay", "input.jsonl", "--pictures"]);
    must_succeed(&run(command.arg(&pictures).current_dir(folder)));
    let mut files: Vec<_> = (std::fs::read_dir(&pictures).unwrap())
        .map(|file| file.unwrap().path())
        .collect();
    files.sort();
    (load(&files[0]), load(&files[files.len() - 1]))
}
