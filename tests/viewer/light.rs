//! The lamp, and the time that frames are held to.

use super::display::{Display, Window, changed, lit_pixels, load, must_succeed, run, wait_for};
use super::render;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// What Enter prints, up to the camera.
fn printed(window: &mut Window<'_>) -> String {
    window.key("Return");
    let mut text = String::new();
    let mut out = BufReader::new(window.process.stdout.take().unwrap());
    while !text.contains("camera {") {
        assert!(out.read_line(&mut text).unwrap() > 0, "ended: {text}");
    }
    window.process.stdout = Some(out.into_inner());
    text
}

#[test]
fn the_lamp_of_the_command_line_lights_the_window() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let (shown, drawn) = (file("shown.png"), file("drawn.png"));
    let mut pictures = Vec::new();
    for lamp in [
        "--light-at 60,20 --specular 0.7 --shininess 9 --ambient 0.3",
        "--light-position 3,1,-2 --specular 0.7",
    ] {
        let look = ["generate:statue:20000", "--size", "240x180", "--validate"];
        let lamp: Vec<&str> = lamp.split(' ').collect();
        let arguments = [&look[..], &["--light", "phong"], &lamp].concat();
        let mut command = display.surfel(&arguments);
        must_succeed(&run(command.args(["--screenshot", shown.to_str().unwrap()])));
        let picture = render(&arguments, &drawn);
        assert!(load(&shown) == picture, "{lamp:?}");
        pictures.push(picture);
    }
    assert!(changed(&pictures[0], &pictures[1]) > 5000);
}

#[test]
fn keys_and_mouse_move_the_lamp_and_it_is_kept_and_recorded() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let look = ["generate:statue:20000", "--size", "300x200", "--validate"];
    let draw = |words: &str| {
        let words: Vec<&str> = words.split_whitespace().collect();
        render(&[&look[..], &words].concat(), &file("drawn.png"))
    };
    let input = file("input.jsonl");
    let mut command = display.surfel(&[&look[..], &["--panel", "off"]].concat());
    command.arg("--record").arg(&input);
    command.env("SURFEL_CONFIG", folder.path());
    let mut window = Window::start(&display, command);
    window.wait_for_picture("the first light, studio", &draw(""));
    let steps: [(&[&str], &str); 5] = [
        (&["l", "l", "l", "l", "l", "l"], "--light-at -30,30"),
        (&["Right", "Right", "Up"], "--light-at -20,35"),
        (&["Home", "Home"], "--light-at -20,35 --specular 0.3"),
        (
            &["Shift+Home", "Control+Home"],
            "--light-at -20,35 --specular 0.3 --shininess 40 --ambient 0.15",
        ),
        (
            &["End", "Control+End", "Shift+End", "Down", "Left"],
            "--light-at -25,30 --specular 0.25",
        ),
    ];
    let mut last = draw("");
    for (keys, words) in steps {
        for key in keys {
            window.key(key);
            // A key that comes again within 20 ms is held, for the window system.
            std::thread::sleep(std::time::Duration::from_millis(40));
        }
        let expected = draw(&format!("--light phong {words}"));
        window.wait_for_picture(words, &expected);
        assert!(changed(&expected, &last) > 500, "{words} shows nothing");
        last = expected;
    }
    // Half a degree a pixel: 20 to the right, 10 up.
    window.hold("Control");
    window.drag(&[(100, 100), (120, 95), (140, 80)]);
    window.release("Control");
    let dragged = draw("--light phong --light-at -5,40 --specular 0.25");
    window.wait_for_picture("the lamp where it was dragged", &dragged);
    // In the world it stays where it is while the view turns.
    window.key("Shift+l");
    window.key("Page_Down");
    window.drag(&[(150, 100), (190, 90), (230, 95)]);
    let text = printed(&mut window);
    let place = text.split_once("light lamp in the world at ").unwrap().1;
    let place = place.split_once(", ambient").unwrap().0;
    std::fs::write(
        file("camera.json"),
        text.split_once("camera ").unwrap().1.as_bytes(),
    )
    .unwrap();
    let camera = file("camera.json");
    let camera = camera.to_str().unwrap();
    let words = format!("--light phong --specular 0.25 --light-position {place}");
    let draw_there = |words: &str| {
        let words: Vec<&str> = words.split_whitespace().collect();
        let words = [&[look[0], "--camera", camera], &words[..]].concat();
        render(&words, &file("drawn.png"))
    };
    let expected = draw_there(&words);
    window.wait_for_picture("the lamp that stays in the world", &expected);
    let along = draw_there("--light phong --light-at -5,40 --specular 0.25");
    assert!(changed(&expected, &along) > 3000, "it goes along");
    window.key("q");
    must_succeed(&window.end());
    // As it was left.
    let kept = std::fs::read_to_string(file("viewer.toml")).unwrap();
    assert!(
        kept.contains("light = \"phong\"") && kept.contains("light_position = ["),
        "{kept}"
    );
    let mut command = display.surfel(&[&look[..], &["--panel", "off"]].concat());
    command.args(["--camera", camera]);
    command.env("SURFEL_CONFIG", folder.path());
    let window = Window::start(&display, command);
    window.wait_for_picture("the lamp as it was left", &expected);
    window.key("q");
    must_succeed(&window.end());
    // And as it was recorded.
    let pictures = file("pictures");
    let mut command = display.surfel(&look[..1]);
    command.args(["--validate", "--panel", "off", "--headless", "--replay"]);
    command.arg(&input).arg("--pictures").arg(&pictures);
    must_succeed(&run(&mut command));
    let mut names: Vec<_> = std::fs::read_dir(&pictures)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    names.sort();
    assert!(load(names.last().unwrap()) == expected, "the replay");
}

/// How many splats were left out because nearer ones hide them, frame for frame of a replay.
fn hidden_of(display: &Display, input: &Path, arguments: &[&str]) -> Vec<u64> {
    let mut command = display.surfel(arguments);
    command.args(["--validate", "--headless", "--log", "surfel::viewer=debug"]);
    let output = run(command.arg("--replay").arg(input));
    must_succeed(&output);
    let log = String::from_utf8_lossy(&output.stderr);
    let counts = log.lines().filter(|line| line.contains("finished"));
    counts
        .map(|line| {
            let number = line.split("hidden=").nth(1).unwrap();
            number.split(' ').next().unwrap().parse().unwrap()
        })
        .collect()
}

#[test]
fn hidden_squares_are_not_looked_for_while_a_time_is_held() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let model = "generate:statue:60000";
    // Turns with no time wanted, with 16 ms (W), and with none again (Shift W): a frame for each step.
    let step = |step: u32, event: &str| {
        let time = f64::from(step) / 30.0;
        format!(r#"{{"step":{step},"time":{time},"event":{event}}}"#)
    };
    let key = |modifiers: &str| {
        format!(r#"{{"key":{{"key":{{"char":"w"}},"pressed":true,"modifiers":{{{modifiers}}}}}}}"#)
    };
    let mut lines = vec![
        r#"{"surfel_input":1}"#.to_owned(),
        step(0, r#"{"size":{"width":240,"height":180,"scale":1.0}}"#),
        step(1, &format!(r#"{{"loaded":"{model}"}}"#)),
        step(1, r#"{"cursor":[100,90]}"#),
        step(1, r#"{"button":{"button":"left","pressed":true}}"#),
    ];
    for i in 2..20 {
        match i {
            8 => lines.push(step(i, &key(""))),
            14 => lines.push(step(i, &key(r#""shift":true"#))),
            _ => {}
        }
        lines.push(step(i, &format!(r#"{{"cursor":[{},90]}}"#, 100 + i)));
    }
    let input = folder.path().join("input.jsonl");
    std::fs::write(&input, lines.join("\n")).unwrap();
    let look = [model, "--method", "splats", "--threshold", "1"];
    let hidden = hidden_of(&display, &input, &look);
    // The step of the model and 18 more.
    assert_eq!(hidden.len(), 19, "{hidden:?}");
    for (index, hidden) in hidden.iter().enumerate() {
        let step = index + 1;
        let is_held = (8..14).contains(&step);
        assert_eq!(*hidden == 0, is_held, "step {step}: {hidden}");
    }
    // Whoever asks for it has it nevertheless.
    let asked = hidden_of(
        &display,
        &input,
        &[&look[..], &["--occlusion", "on"]].concat(),
    );
    assert!(asked.iter().all(|hidden| *hidden > 0), "{asked:?}");
}

#[test]
fn the_time_that_frames_are_held_to_is_switched_in_the_window() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let look = ["generate:statue:60000", "--size", "300x200", "--validate"];
    let expected = render(&look, &folder.path().join("drawn.png"));
    let open = || {
        let mut command = display.surfel(&[&look[..], &["--panel", "off"]].concat());
        command.env("SURFEL_CONFIG", folder.path());
        Window::start(&display, command)
    };
    let window = open();
    window.wait_for_picture("the first picture", &expected);
    window.key("w");
    wait_for("the word of the time", || {
        (changed(&window.picture(), &expected) > 500).then_some(())
    });
    window.key("BackSpace");
    window.wait_for_picture("the same picture", &expected);
    window.key("q");
    must_succeed(&window.end());
    let kept = || std::fs::read_to_string(folder.path().join("viewer.toml")).unwrap();
    // From the usual time of a software device to the next.
    assert!(kept().contains("frame_ms = 50.0"), "{}", kept());
    let window = open();
    window.wait_for_picture("the picture of before", &expected);
    assert!(lit_pixels(&expected) > 2000);
    window.key("Shift+w");
    window.key("BackSpace");
    window.key("q");
    must_succeed(&window.end());
    assert!(!kept().contains("frame_ms"), "{}", kept());
}
