//! What the window leaves behind: its settings, and recordings of input.

use super::display::{Display, Window, load, must_succeed, run, wait_for};
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
    let resized = window.picture();
    window.click(140, 100);
    window.click(140, 100);
    window.drag(&[(100, 100), (130, 120)]);
    // P writes the picture that is shown, so everything has to be drawn before: it has changed and changes no more.
    let mut shown = resized.clone();
    wait_for("the last view", || {
        std::thread::sleep(std::time::Duration::from_millis(250));
        let before = std::mem::replace(&mut shown, window.picture());
        (shown == before && shown != resized).then_some(())
    });
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
