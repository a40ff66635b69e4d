//! The window, as a user has it: the program under a virtual X server, with validation.
//!
//! Without Xvfb, a Vulkan device or (for synthetic input) xdotool and ImageMagick's `import`, a test says so
//! and ends; with `SURFEL_REQUIRE_DEVICE=1` a missing Xvfb or device fails it.
#![cfg(feature = "viewer")]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// How long anything may take before a test counts as hung.
const HANG: Duration = Duration::from_secs(60);

/// A virtual X server of its own, so that tests share neither pointer nor focus.
struct Display {
    server: Child,
    name: String,
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

fn skip(reason: &str) {
    assert!(
        std::env::var_os("SURFEL_REQUIRE_DEVICE").is_none(),
        "a window is required here: {reason}"
    );
    eprintln!("no window, nothing tested: {reason}");
}

impl Display {
    fn open() -> Option<Self> {
        let devices = Command::new(env!("CARGO_BIN_EXE_surfel"))
            .arg("devices")
            .output()
            .unwrap();
        if !devices.status.success() {
            skip("no Vulkan device");
            return None;
        }
        // Without -noreset the server starts anew whenever its last client leaves, and refuses others meanwhile.
        let server = Command::new("Xvfb")
            .args([
                "-displayfd",
                "1",
                "-screen",
                "0",
                "1280x1024x24",
                "-noreset",
                "-nolisten",
                "tcp",
            ])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let Ok(mut server) = server else {
            skip("Xvfb is not installed");
            return None;
        };
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap())
            .read_line(&mut number)
            .unwrap();
        let name = format!(":{}", number.trim());
        let display = Self { server, name };
        assert!(!number.trim().is_empty(), "Xvfb did not start");
        Some(display)
    }

    fn surfel(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_surfel"));
        command.args(arguments).env("DISPLAY", &self.name);
        command
    }

    fn tool(&self, name: &str, arguments: &[&str]) -> Option<String> {
        let output = Command::new(name)
            .args(arguments)
            .env("DISPLAY", &self.name)
            .output()
            .ok()?;
        output
            .status
            .success()
            .then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    }

    /// Whether synthetic input and pictures of the screen can be had.
    fn has_tools(&self) -> bool {
        let is_there = |name: &str| Command::new(name).arg("-version").output().is_ok();
        let both = is_there("xdotool") && is_there("import");
        if !both {
            eprintln!(
                "xdotool or import (ImageMagick) is not installed: synthetic input is not tested"
            );
        }
        both
    }
}

/// A running window with its place on the screen.
struct Window<'d> {
    display: &'d Display,
    process: Child,
    id: String,
}

impl Drop for Window<'_> {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(start.elapsed() < HANG, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

impl<'d> Window<'d> {
    fn open(display: &'d Display, arguments: &[&str]) -> Self {
        Self::open_in(display, Path::new("."), arguments)
    }

    fn open_in(display: &'d Display, folder: &Path, arguments: &[&str]) -> Self {
        let mut process = display
            .surfel(arguments)
            .current_dir(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let pid = process.id().to_string();
        let id = wait_for("the window", || {
            if let Some(status) = process.try_wait().unwrap() {
                let mut text = String::new();
                process
                    .stderr
                    .take()
                    .unwrap()
                    .read_to_string(&mut text)
                    .unwrap();
                panic!("ended before its window came, {status}: {text}");
            }
            let ids = display.tool("xdotool", &["search", "--pid", &pid])?;
            Some(ids.lines().last()?.to_owned())
        });
        Self {
            display,
            process,
            id,
        }
    }

    fn title(&self) -> String {
        self.display
            .tool("xdotool", &["getwindowname", &self.id])
            .unwrap_or_default()
    }

    fn wait_for_title(&self, part: &str) -> String {
        wait_for(&format!("a title with {part:?}"), || {
            Some(self.title()).filter(|title| title.contains(part))
        })
    }

    fn key(&self, key: &str) {
        self.display
            .tool("xdotool", &["key", "--window", &self.id, key])
            .expect("xdotool key");
    }

    fn mouse(&self, arguments: &[&str]) {
        self.display.tool("xdotool", arguments).expect("xdotool");
    }

    fn resize(&self, width: u32, height: u32) {
        let (width, height) = (width.to_string(), height.to_string());
        self.mouse(&["windowsize", &self.id, &width, &height]);
    }

    /// What is on the screen.
    fn picture(&self, path: &Path) -> image::RgbImage {
        self.display
            .tool("import", &["-window", &self.id, path.to_str().unwrap()])
            .expect("import");
        image::open(path).unwrap().to_rgb8()
    }

    /// Waits for the program to end.
    fn end(mut self) -> Output {
        output_of(&mut self.process)
    }
}

/// Waits for a program with piped output, which must be little, and kills it when it hangs.
fn output_of(process: &mut Child) -> Output {
    let start = Instant::now();
    let status = loop {
        if let Some(status) = process.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > HANG {
            process.kill().unwrap();
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    let mut output = Output {
        status,
        stdout: Vec::new(),
        stderr: Vec::new(),
    };
    if let Some(mut out) = process.stdout.take() {
        out.read_to_end(&mut output.stdout).unwrap();
    }
    if let Some(mut err) = process.stderr.take() {
        err.read_to_end(&mut output.stderr).unwrap();
    }
    output
}

fn run(command: &mut Command) -> Output {
    let mut process = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    output_of(&mut process)
}

fn must_succeed(output: &Output) {
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{:?}: {text}", output.status);
}

fn load(path: &Path) -> image::RgbImage {
    image::open(path).unwrap().to_rgb8()
}

fn lit_pixels(picture: &image::RgbImage) -> usize {
    picture.pixels().filter(|p| p.0 != [0; 3]).count()
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
    let looks: [&[&str]; 3] = [
        &[
            "--size",
            "320x240",
            "--color-by",
            "primitive",
            "--threshold",
            "2",
        ],
        &[
            "--size",
            "200x300",
            "--method",
            "points",
            "--threshold",
            "3",
            "--orbit",
            "-70,-30,1.5",
        ],
        &[
            "--size",
            "257x131",
            "--method",
            "triangles",
            "--background",
            "#204060",
            "--vsync",
            "off",
        ],
    ];
    for look in looks {
        let mut arguments = vec!["generate:statue:60000", "--validate"];
        arguments.extend(look);
        let mut to_window = arguments.clone();
        to_window.extend(["--screenshot", shown.to_str().unwrap()]);
        must_succeed(&run(&mut display.surfel(&to_window)));
        let mut to_file: Vec<&str> = arguments
            .into_iter()
            .filter(|a| !["--vsync", "off"].contains(a))
            .collect();
        to_file.insert(0, "render");
        to_file.extend(["-o", drawn.to_str().unwrap()]);
        must_succeed(&run(&mut display.surfel(&to_file)));
        let (shown, drawn) = (load(&shown), load(&drawn));
        assert!(lit_pixels(&drawn) > 3000, "{look:?} shows something");
        assert!(shown == drawn, "{look:?}: the window's picture differs");
    }
}

#[test]
fn what_is_on_the_screen_after_turning_and_resizing_is_what_render_draws() {
    let Some(display) = Display::open() else {
        return;
    };
    if !display.has_tools() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let arguments = [
        "generate:statue:60000",
        "--size",
        "400x300",
        "--validate",
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
        Some(window.picture(&file("size.png")))
            .filter(|p| p.dimensions() == (320, 240) && lit_pixels(p) > 1000)
    });
    window.mouse(&[
        "mousemove",
        "--window",
        &window.id,
        "160",
        "120",
        "mousedown",
        "1",
    ]);
    window.mouse(&["mousemove_relative", "--", "40", "-15"]);
    window.mouse(&["mousemove_relative", "--", "20", "-10", "mouseup", "1"]);
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
    let drawn = file("drawn.png");
    let render = |view: &[&str]| {
        let mut arguments = vec!["render", "generate:statue:60000", "--color-by", "primitive"];
        arguments.extend([
            "--threshold",
            "3.25",
            "--culling",
            "off",
            "-o",
            drawn.to_str().unwrap(),
        ]);
        arguments.extend(view);
        must_succeed(&run(&mut display.surfel(&arguments)));
        load(&drawn)
    };
    let expected = render(&["--camera", file("camera.json").to_str().unwrap()]);
    // The frame may be on its way still when its camera is printed.
    let screen = wait_for("the picture of the printed camera on the screen", || {
        Some(window.picture(&file("screen.png"))).filter(|screen| *screen == expected)
    });
    window.key("p");
    wait_for("the picture written by P", || {
        file("surfel-000.png").is_file().then_some(())
    });
    assert!(
        load(&file("surfel-000.png")) == expected,
        "P writes another picture"
    );
    // A double click on the model moves the center of rotation, and nothing that is seen.
    let place = ["mousemove", "--window", &window.id, "150", "110"];
    window.mouse(&place);
    window.mouse(&["click", "--repeat", "2", "--delay", "50", "1"]);
    window.key("p");
    wait_for("the second picture", || {
        file("surfel-001.png").is_file().then_some(())
    });
    let same = load(&file("surfel-001.png"));
    let changed = same
        .pixels()
        .zip(expected.pixels())
        .filter(|(a, b)| a != b)
        .count();
    assert!(
        changed < 320 * 240 / 50,
        "a double click changed {changed} pixels"
    );
    window.key("Escape");
    must_succeed(&window.end());
    let unturned = render(&["--size", "320x240"]);
    assert!(screen != unturned, "the drag turned nothing");
    // Splats are red where the picture is right; a swapped byte order would make them blue.
    assert!(
        screen.pixels().any(|p| p.0[0] > 2 * p.0[2]),
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
}

#[test]
fn closing_while_a_model_is_loaded_is_clean() {
    let Some(display) = Display::open() else {
        return;
    };
    if !display.has_tools() {
        return;
    }
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
    if !display.has_tools() {
        return;
    }
    let window = Window::open(&display, &["no-such-file.ply", "--validate"]);
    let title = window.wait_for_title("cannot");
    assert!(title.contains("no-such-file.ply"), "{title}");
    window.key("Escape");
    let output = window.end();
    must_succeed(&output);
    assert!(String::from_utf8_lossy(&output.stderr).contains("no-such-file.ply"));
}

#[test]
fn without_a_display_the_program_says_what_to_do() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_surfel"));
    let output = run(command.arg("generate:sphere:100").env_remove("DISPLAY"));
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(
        text.contains("cannot open a window") && text.contains("DISPLAY"),
        "{text}"
    );
    assert!(text.contains("surfel render"), "{text}");
}
