//! The window, as a user has it: the program under a virtual X server, with validation.
//!
//! Without Xvfb or a Vulkan device a test says so and ends; with `SURFEL_REQUIRE_DEVICE=1` that fails it.
#![cfg(feature = "viewer")]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

#[path = "viewer/display.rs"]
mod display;
#[path = "viewer/docked.rs"]
mod docked;
#[path = "viewer/files.rs"]
mod files;
#[path = "viewer/kept.rs"]
mod kept;
#[path = "viewer/light.rs"]
mod light;
#[path = "viewer/measure.rs"]
mod measure;
#[path = "viewer/panel.rs"]
mod panel;
#[path = "viewer/photographs.rs"]
mod photographs;
#[path = "viewer/rest.rs"]
mod rest;
#[path = "viewer/section.rs"]
mod section;
#[path = "viewer/walk.rs"]
mod walk;

use display::{Display, Window, changed, lit_pixels, load, must_succeed, run, wait_for};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// The picture that `surfel render` draws.
fn render(arguments: &[&str], file: &Path) -> image::RgbImage {
    let mut command = Command::new(env!("CARGO_BIN_EXE_surfel"));
    // Both ways to draw differ by a level here and there.
    command.env("SURFEL_CALIBRATE", "off");
    command.arg("render").args(arguments);
    if !arguments.contains(&"--samples") {
        command.args(["--samples", "1"]);
    }
    command.args(["-o", file.to_str().unwrap()]);
    must_succeed(&run(&mut command));
    load(file)
}

#[test]
fn the_windows_picture_is_the_one_that_render_draws() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let (shown, drawn) = (
        folder.path().join("shown.png"),
        folder.path().join("drawn.png"),
    );
    let looks: [(&[&str], &[&str]); 3] = [
        (
            &[
                "--size",
                "320x240",
                "--color-by",
                "primitive",
                "--threshold",
                "2",
            ],
            &[],
        ),
        (
            &["--size", "200x300", "--method", "points", "--threshold"],
            &["3", "--orbit", "-70,-30,1.5"],
        ),
        (
            &["--size", "257x131", "--method", "triangles", "--background"],
            &["#204060"],
        ),
    ];
    for (look, more) in looks {
        let arguments = [&["generate:statue:60000", "--validate"], look, more].concat();
        let mut to_window = arguments.clone();
        to_window.extend(["--vsync", "off", "--screenshot", shown.to_str().unwrap()]);
        must_succeed(&run(&mut display.surfel(&to_window)));
        let (shown, drawn) = (load(&shown), render(&arguments, &drawn));
        assert!(lit_pixels(&drawn) > 3000, "{look:?} shows something");
        assert!(shown == drawn, "{look:?}: the window's picture differs");
    }
    // Points are discs in the plane of the surface where nothing is said.
    let cloud = folder.path().join("points.xyz");
    let rows = (0..900).map(|i| format!("{} {} {}\n", i % 30, i / 30, i % 7));
    std::fs::write(&cloud, rows.collect::<String>()).unwrap();
    let look = [cloud.to_str().unwrap(), "--size", "200x150"];
    let to_window = [&look[..], &["--screenshot", shown.to_str().unwrap()]].concat();
    must_succeed(&run(&mut display.surfel(&to_window)));
    let [usual, ellipses, discs] = [&[][..], &["--splat", "ellipse"], &["--splat", "disc"]]
        .map(|more| render(&[&look[..], more, &["--samples", "1"]].concat(), &drawn));
    assert!(load(&shown) == usual && usual == ellipses && usual != discs);
}

#[test]
fn what_is_on_the_screen_after_turning_and_resizing_is_what_render_draws() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let arguments = [
        "generate:statue:60000",
        "--size",
        "400x300",
        "--validate",
        "--panel",
        "off",
        "--color-by",
        "primitive",
    ];
    let mut window = Window::open_in(&display, folder.path(), &arguments);
    window.wait_for_title("threshold 1 px");
    for step in 0..50u32 {
        window.resize(120 + step * 97 % 500, 90 + step * 61 % 400);
    }
    window.resize(1, 1);
    window.resize(320, 240);
    wait_for("the last size on the screen", || {
        Some(window.picture()).filter(|p| p.dimensions() == (320, 240) && lit_pixels(p) > 1000)
    });
    window.drag(&[(160, 120), (200, 105), (220, 95)]);
    for key in ["a", "s", "d", "3", "plus", "b"] {
        window.key(key);
    }
    window.wait_for_title("threshold 3.25 px");
    window.key("Return");
    let mut printed = String::new();
    let mut out = BufReader::new(window.process.stdout.take().unwrap());
    while !printed.contains("camera {") {
        assert!(out.read_line(&mut printed).unwrap() > 0, "ended: {printed}");
    }
    window.process.stdout = Some(out.into_inner());
    assert!(
        printed.contains("threshold 3.25 px, culling off"),
        "{printed}"
    );
    let camera = printed.split_once("camera ").unwrap().1;
    std::fs::write(file("camera.json"), camera).unwrap();
    let draw = |view: &[&str]| {
        let mut arguments = vec!["generate:statue:60000", "--color-by", "primitive"];
        arguments.extend(["--threshold", "3.25", "--culling", "off"]);
        arguments.extend(view);
        render(&arguments, &file("drawn.png"))
    };
    let expected = draw(&["--camera", file("camera.json").to_str().unwrap()]);
    // The frame may be on its way still when its camera is printed.
    window.wait_for_picture("the picture of the printed camera on the screen", &expected);
    window.key("p");
    wait_for("the picture written by P", || {
        file("surfel-000.png").is_file().then_some(())
    });
    assert!(
        load(&file("surfel-000.png")) == expected,
        "P writes another picture"
    );
    // A double click on the model moves the center of rotation, and nothing that is seen.
    window.click(150, 110);
    window.click(150, 110);
    window.key("p");
    wait_for("the second picture", || {
        file("surfel-001.png").is_file().then_some(())
    });
    let same = load(&file("surfel-001.png"));
    let moved = changed(&same, &expected);
    assert!(
        moved < 320 * 240 / 50,
        "a double click changed {moved} pixels"
    );
    window.key("q");
    must_succeed(&window.end());
    assert!(
        expected != draw(&["--size", "320x240"]),
        "the drag turned nothing"
    );
    // Splats are red where the picture is right; a swapped byte order would make them blue.
    assert!(
        expected.pixels().any(|p| p.0[0] > 2 * p.0[2]),
        "nothing red on the screen"
    );
}

#[test]
fn a_lost_surface_and_a_swapchain_out_of_date_are_rebuilt() {
    let Some(display) = Display::open() else {
        return;
    };
    let arguments = [
        "generate:statue:20000",
        "--size",
        "160x120",
        "--validate",
        "--log",
        "surfel::gpu=debug",
    ];
    let rebuilds = |more: &[&str]| {
        let mut command = display.surfel(&arguments);
        let output = run(command.args(["--exit-after-frames", "20"]).args(more));
        must_succeed(&output);
        let log = String::from_utf8_lossy(&output.stderr).into_owned();
        (
            log.matches("swapchain 160 x 120").count(),
            log.matches("present mode").count(),
        )
    };
    assert_eq!(rebuilds(&[]), (1, 1), "one swapchain lasts");
    let (swapchains, surfaces) = rebuilds(&["--lose-surface-every", "3"]);
    assert!(swapchains >= 6, "{swapchains} swapchains");
    assert!(surfaces >= 3, "{surfaces} surfaces");
    // With the panel, which has textures of its own on the device.
    let (_, surfaces) = rebuilds(&["--lose-device-every", "6", "--panel", "on"]);
    assert!(surfaces >= 4, "{surfaces} surfaces on new devices");
}

#[test]
fn a_lost_device_is_opened_again_and_shows_the_same_picture() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["generate:statue:20000", "--size", "300x200", "--validate"];
    let mut with_faults = arguments.to_vec();
    with_faults.extend(["--panel", "off", "--lose-device-every", "4"]);
    let window = Window::open(&display, &with_faults);
    let expected = render(&arguments, &folder.path().join("drawn.png"));
    window.wait_for_picture("the first picture", &expected);
    // Twice through all colorings of squares, and back at the first.
    for key in ["c"; 12].into_iter().chain(["Escape"]) {
        window.key(key);
        std::thread::sleep(Duration::from_millis(60));
    }
    // What is told of the loss is dismissed, each time that it is: the frame after may be one that loses the device. Beneath is the
    // picture.
    wait_for("the picture of the new device", || {
        window.key("BackSpace");
        std::thread::sleep(Duration::from_millis(300));
        (window.picture() == expected).then_some(())
    });
    window.key("q");
    let output = window.end();
    must_succeed(&output);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        told.contains("the device was lost; it was opened again"),
        "{told}"
    );
}

#[test]
fn a_device_that_is_lost_at_every_frame_ends_the_program_with_a_sentence() {
    let Some(display) = Display::open() else {
        return;
    };
    let arguments = ["generate:statue:2000", "--size", "160x120"];
    for (fault, sentence) in [
        ("--lose-device-every", "the device was lost"),
        ("--exhaust-memory-every", "memory"),
    ] {
        let mut command = display.surfel(&arguments);
        let output = run(command.args(["--exit-after-frames", "9", fault, "1"]));
        assert_eq!(output.status.code(), Some(1));
        let text = String::from_utf8_lossy(&output.stderr).to_lowercase();
        let last = text.lines().last().unwrap_or_default();
        assert!(last.contains(sentence), "{fault}: {text}");
    }
}

#[test]
fn without_memory_the_model_goes_and_the_window_stays() {
    let Some(display) = Display::open() else {
        return;
    };
    let arguments = ["generate:statue:2000", "--size", "300x200", "--validate"];
    let window = Window::open(
        &display,
        &[&arguments[..], &["--exhaust-memory-every", "5"]].concat(),
    );
    window.wait_for_title("threshold");
    for key in ["c", "c", "c", "c", "c"] {
        window.key(key);
        std::thread::sleep(Duration::from_millis(60));
    }
    let title = window.wait_for_title("vkQueueSubmit2");
    assert!(title.to_lowercase().contains("memory"), "{title}");
    window.key("q");
    must_succeed(&window.end());
}

#[test]
fn closing_while_a_model_is_loaded_is_clean() {
    let Some(display) = Display::open() else {
        return;
    };
    let window = Window::open(&display, &["generate:statue:3000000", "--validate"]);
    let title = window.title();
    window.key("q");
    let output = window.end();
    must_succeed(&output);
    assert!(
        output.stderr.is_empty(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(title.starts_with("generate:statue:3000000 - "), "{title}");
}

#[test]
fn a_model_that_cannot_be_opened_is_told_and_the_window_stays() {
    let Some(display) = Display::open() else {
        return;
    };
    let mut missing = display.surfel(&["no-such-file.ply", "--screenshot", "none.png"]);
    let missing = run(&mut missing);
    assert_eq!(missing.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&missing.stderr).contains("no-such-file.ply"));
    let arguments = ["no-such-file.ply", "--validate", "--panel", "off"];
    let window = Window::open(&display, &arguments);
    let title = window.wait_for_title("cannot");
    assert!(title.contains("no-such-file.ply"), "{title}");
    // The message stands in the window until it is dismissed.
    wait_for("the message in the window", || {
        (lit_pixels(&window.picture()) > 1000).then_some(())
    });
    window.key("BackSpace");
    wait_for("the message to go", || {
        (lit_pixels(&window.picture()) == 0).then_some(())
    });
    window.key("Escape");
    let output = window.end();
    must_succeed(&output);
    assert!(String::from_utf8_lossy(&output.stderr).contains("no-such-file.ply"));
}

#[test]
fn without_a_display_the_program_says_what_to_do() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_surfel"));
    // Both ways to draw differ by a level here and there.
    command.env("SURFEL_CALIBRATE", "off");
    let output = run(command.arg("generate:sphere:100").env_remove("DISPLAY"));
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(
        text.contains("cannot open a window") && text.contains("DISPLAY"),
        "{text}"
    );
    assert!(text.contains("surfel render"), "{text}");
}
