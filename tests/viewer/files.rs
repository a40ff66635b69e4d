//! What the window leaves behind: its settings, and recordings of input.

use super::display::{Display, Window, changed, load, must_succeed, run, wait_for};
use super::render;

#[test]
fn the_window_comes_back_as_it_was_left() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("viewer.toml");
    let open = |more: &[&str]| {
        let mut command = display.surfel(&["generate:statue:2000", "--validate"]);
        command.args(more).env("SURFEL_CONFIG", folder.path());
        Window::start(&display, command)
    };
    let window = open(&["--size", "320x240"]);
    window.wait_for_title("pop, threshold 1 px");
    window.key("Tab");
    window.key("5");
    window.key("s");
    window.wait_for_title("points, threshold 5 px");
    window.key("q");
    must_succeed(&window.end());
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(
        text.contains("panel = false") && text.contains("method = \"points\""),
        "{text}"
    );
    let window = open(&[]);
    window.wait_for_title("points, threshold 5 px");
    assert_eq!(window.size(), (320, 240));
    window.key("q");
    must_succeed(&window.end());
    // What the command line says goes before what the file says.
    let window = open(&["--threshold", "2"]);
    window.wait_for_title("pop, threshold 2 px");
    window.key("q");
    must_succeed(&window.end());
    // A file that is no settings is named and ignored.
    std::fs::write(&file, "[window]\nwidth = \"wide\"\n").unwrap();
    let window = open(&["--size", "320x240"]);
    let title = window.wait_for_title("viewer.toml");
    assert!(
        title.contains("line 2") && title.contains("ignored"),
        "{title}"
    );
    window.key("BackSpace");
    window.wait_for_title("pop, threshold 1 px");
    window.key("q");
    must_succeed(&window.end());
}

#[test]
fn a_recording_gives_the_same_pictures_with_and_without_a_window() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let input = file("input.jsonl");
    let look = [
        "generate:statue:20000",
        "--validate",
        "--color-by",
        "primitive",
    ];
    let mut command = display.surfel(&look);
    command.args(["--size", "320x240", "--panel", "off", "--record"]);
    command.arg(&input).current_dir(folder.path());
    let window = Window::start(&display, command);
    window.wait_for_title("threshold 1 px");
    window.drag(&[(160, 120), (190, 110), (200, 90)]);
    window.move_to(170, 110);
    for _ in 0..3 {
        window.button(4, true);
        window.button(4, false);
    }
    window.wait_for_title("ms");
    window.key("4");
    window.wait_for_title("threshold 4 px");
    window.resize(280, 210);
    wait_for("the new size", || {
        (window.picture().dimensions() == (280, 210)).then_some(())
    });
    window.click(140, 100);
    window.click(140, 100);
    window.drag(&[(100, 100), (130, 120)]);
    // Whether it is drawn yet or not, P writes the picture of the view that there is now.
    window.key("p");
    wait_for("the picture", || {
        file("surfel-000.png").is_file().then_some(())
    });
    window.key("q");
    must_succeed(&window.end());
    let expected = load(&file("surfel-000.png"));
    let first = render(
        &[&look[..], &["--size", "320x240"]].concat(),
        &file("drawn.png"),
    );
    let mut sequences = Vec::new();
    for (name, headless) in [("with", None), ("without", Some("--headless"))] {
        let pictures = file(name);
        let mut command = display.surfel(&look);
        command.args(["--panel", "off", "--replay"]).arg(&input);
        command.arg("--pictures").arg(&pictures).args(headless);
        command.current_dir(folder.path());
        if headless.is_some() {
            command.env_remove("DISPLAY");
        }
        must_succeed(&run(&mut command));
        let mut names: Vec<_> = std::fs::read_dir(&pictures)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect();
        names.sort();
        // How many steps there are depends on how fast events came.
        assert!(names.len() >= 3, "{name}: {names:?}");
        assert!(
            load(&names[0]) == first,
            "{name}: the first picture differs"
        );
        let last = load(names.last().unwrap());
        assert!(last == expected, "{name}: the last picture differs");
        let bytes: Vec<_> = names.iter().map(|p| load(p).into_raw()).collect();
        sequences.push(bytes);
    }
    // A real window follows its size at its own time; without one it is as recorded.
    assert_eq!(sequences[0].last(), sequences[1].last());
    let again = file("again");
    let mut command = display.surfel(&look);
    command.args(["--replay"]).arg(&input).arg("--headless");
    command
        .arg("--pictures")
        .arg(&again)
        .current_dir(folder.path());
    must_succeed(&run(&mut command));
    let mut names: Vec<_> = std::fs::read_dir(&again)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    names.sort();
    let bytes: Vec<_> = names.iter().map(|p| load(p).into_raw()).collect();
    assert!(bytes == sequences[1], "the second replay differs");
}

#[test]
fn a_picture_that_is_asked_for_together_with_a_move_shows_the_move() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let model = "generate:statue:20000";
    let key = |step: u32, key: &str| {
        format!(
            r#"{{"step":{step},"time":{step},"event":{{"key":{{"key":{key},"pressed":true}}}}}}"#
        )
    };
    // P before the move of its step, after it, and alone; then a cut that is held while the view turns.
    let input = [
        r#"{"surfel_input":1}"#.to_owned(),
        r#"{"step":0,"time":0,"event":{"size":{"width":240,"height":180,"scale":1.0}}}"#.into(),
        format!(r#"{{"step":1,"time":1,"event":{{"loaded":"{model}"}}}}"#),
        key(2, r#"{"char":"p"}"#),
        key(2, r#"{"pad":3}"#),
        key(3, r#"{"pad":1}"#),
        key(3, r#"{"char":"p"}"#),
        key(4, r#"{"char":"p"}"#),
        key(5, r#"{"char":"y"}"#),
        key(5, r#"{"pad":3}"#),
        key(5, r#"{"char":"p"}"#),
        key(6, r#"{"char":"y"}"#),
        key(6, r#"{"char":"p"}"#),
    ];
    std::fs::write(file("input.jsonl"), input.join("\n")).unwrap();
    let look = [model, "--threshold", "4", "--validate"];
    let mut command = display.surfel(&look);
    command
        .args(["--headless", "--replay"])
        .arg(file("input.jsonl"));
    command.current_dir(folder.path()).env_remove("DISPLAY");
    must_succeed(&run(&mut command));
    let camera = file("front.json");
    let save = ["--save-camera", camera.to_str().unwrap()];
    let held = ["--cut-camera", camera.to_str().unwrap()];
    let mut pictures = Vec::new();
    for (index, orbit, more) in [
        (0, "30,20,1", &[][..]),
        (1, "0,0,1", &save),
        (2, "0,0,1", &[]),
        (3, "90,0,1", &held),
        (4, "90,0,1", &[]),
    ] {
        let words = ["--size", "240x180", "--orbit", orbit];
        let drawn = render(&[&look[..], &words, more].concat(), &file("drawn.png"));
        let written = load(&file(&format!("surfel-{index:03}.png")));
        // The angles are sums in one case, and single pixels at edges follow their last bit.
        let differ = changed(&written, &drawn);
        assert!(
            differ <= 240 * 180 / 200,
            "picture {index}: {differ} pixels differ"
        );
        pictures.push(written);
    }
    assert!(!file("surfel-005.png").exists());
    assert!(pictures[1] == pictures[2]);
    for (a, b) in [(0, 1), (1, 3), (3, 4)] {
        assert!(changed(&pictures[a], &pictures[b]) > 2000, "{a} and {b}");
    }
}

#[test]
fn a_photo_is_twice_as_large_and_the_mean_of_its_samples() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let model = "generate:statue:20000";
    let key = r#"{"key":{"key":{"char":"p"},"pressed":true,"modifiers":{"shift":true}}}"#;
    let input = [
        r#"{"surfel_input":1}"#.to_owned(),
        r#"{"step":0,"time":0,"event":{"size":{"width":150,"height":110,"scale":1.0}}}"#.into(),
        format!(r#"{{"step":0,"time":0,"event":{key}}}"#),
        format!(r#"{{"step":1,"time":1,"event":{{"loaded":"{model}"}}}}"#),
        r#"{"step":2,"time":2,"event":{"key":{"key":{"pad":1},"pressed":true}}}"#.into(),
        format!(r#"{{"step":2,"time":2,"event":{key}}}"#),
        format!(r#"{{"step":3,"time":3,"event":{key}}}"#),
    ];
    std::fs::write(file("input.jsonl"), input.join("\n")).unwrap();
    // However coarse a moving picture must be, a photo is not.
    let look = [model, "--splat", "gauss", "--threshold", "2", "--validate"];
    let mut command = display.surfel(&[&look[..], &["--frame-ms", "1"]].concat());
    command
        .args(["--headless", "--replay"])
        .arg(file("input.jsonl"));
    must_succeed(&run(command.current_dir(folder.path())));
    let words = ["--size", "300x220", "--orbit", "0,0,1", "--samples", "16"];
    let drawn = render(&[&look[..], &words].concat(), &file("drawn.png"));
    let photo = load(&file("surfel-photo-000.png"));
    assert_eq!(photo.dimensions(), (300, 220));
    assert!(photo == drawn, "{} pixels differ", changed(&photo, &drawn));
    assert!(load(&file("surfel-photo-001.png")) == drawn);
    assert!(
        !file("surfel-photo-002.png").exists(),
        "without a model none"
    );
}

#[test]
fn a_damaged_recording_is_named_with_its_line() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("input.jsonl");
    std::fs::write(&input, "{\"surfel_input\":1}\nnonsense\n").unwrap();
    let mut command = display.surfel(&["generate:statue:2000", "--headless", "--replay"]);
    let output = run(command.arg(&input));
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("input.jsonl, line 2"), "{text}");
}

#[test]
fn a_replay_that_nobody_sees_ends_where_its_model_is_missing() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("input.jsonl");
    let lines = [
        r#"{"surfel_input":1}"#,
        r#"{"step":0,"time":0,"event":{"size":{"width":150,"height":110,"scale":1.0}}}"#,
        r#"{"step":1,"time":1,"event":{"loaded":"generate:statue:2000"}}"#,
        r#"{"step":2,"time":2,"event":{"key":{"key":{"pad":1},"pressed":true}}}"#,
    ];
    std::fs::write(&input, lines.join("\n")).unwrap();
    let missing = folder.path().join("missing.ply");
    let mut command = display.surfel(&[missing.to_str().unwrap(), "--headless", "--replay"]);
    command.arg(&input).current_dir(folder.path());
    let output = run(&mut command);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("missing.ply: cannot be read"), "{said}");
    assert!(output.stdout.is_empty(), "{output:?}");
}

#[test]
fn normals_change_by_a_key_and_files_that_were_shown_are_remembered() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bent.obj");
    // Two faces at 60 degrees, with normals that belong to neither.
    let corners = ["0 0 0", "0 1 0", "1 0 0", "1 1 0", "-1 0 -1.7", "-1 1 -1.7"];
    let corners = corners.map(|at| format!("v {at}\nvn 0.9 0 0.44\n"));
    let faces = "f 1//1 3//3 4//4 2//2\nf 5//5 1//1 2//2 6//6\n";
    std::fs::write(&path, corners.concat() + faces).unwrap();
    let look = [path.to_str().unwrap(), "--size", "300x200"];
    let mut command = display.surfel(&look);
    command.args(["--validate", "--panel", "off"]);
    command.env("SURFEL_CONFIG", folder.path());
    let window = Window::start(&display, command);
    window.wait_for_title("bent.obj - pop");
    let file = folder.path().join("drawn.png");
    let drawn = |shading: &str| render(&[&look[..], &["--shading", shading]].concat(), &file);
    let [of_file, smooth, flat] = ["file", "smooth", "flat"].map(drawn);
    assert!(changed(&of_file, &smooth) > 1000 && changed(&of_file, &flat) > 1000);
    let shows = |what: &str, wanted: &image::RgbImage| {
        wait_for(what, || {
            // The message that tells of it lies over the picture.
            window.key("BackSpace");
            std::thread::sleep(std::time::Duration::from_millis(50));
            (changed(&window.picture(), wanted) == 0).then_some(())
        });
    };
    shows("normals of the file", &of_file);
    window.key("Shift+s");
    shows("smooth normals", &smooth);
    window.key("Shift+s");
    shows("flat normals", &flat);
    window.key("Shift+s");
    shows("normals of the file again", &of_file);
    window.key("q");
    must_succeed(&window.end());
    let kept = std::fs::read_to_string(folder.path().join("viewer.toml")).unwrap();
    let whole = path.canonicalize().unwrap();
    assert!(
        kept.contains(&format!("recent = [\"{}\"]", whole.display())),
        "{kept}"
    );
}
