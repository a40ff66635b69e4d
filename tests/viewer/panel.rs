//! The panel, keys and messages, and what they do to the picture.

use super::display::{Display, Window, changed, lit_pixels, load, must_succeed, run, wait_for};
use super::render;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Pixels left of `x`, and those right of it.
fn halves(picture: &image::RgbImage, x: u32) -> (image::RgbImage, image::RgbImage) {
    let (width, height) = picture.dimensions();
    let part = |left, width| image::imageops::crop_imm(picture, left, 0, width, height).to_image();
    (part(0, x), part(x, width - x))
}

/// A camera file in `folder` that looks from another side, and the picture that it gives.
fn elsewhere(look: &[&str], folder: &Path) -> (PathBuf, image::RgbImage) {
    let camera = folder.join("camera.json");
    let words = ["--orbit", "100,50,0.5", "--save-camera"];
    let words = [look, &words, &[camera.to_str().unwrap()]].concat();
    let picture = render(&words, &folder.join("elsewhere.png"));
    (camera, picture)
}

#[test]
fn the_panel_covers_its_place_and_nothing_when_hidden() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let look = ["generate:statue:20000", "--size", "800x600", "--validate"];
    let expected = render(&look, &folder.path().join("drawn.png"));
    let narrow = ["generate:statue:20000", "--size", "524x600", "--validate"];
    let right = render(&narrow, &folder.path().join("narrow.png"));
    let window = Window::open(&display, &[&look[..], &["--panel", "on"]].concat());
    window.wait_for_title("threshold 1 px");
    wait_for("the panel beside the picture", || {
        let (covered, beside) = halves(&window.picture(), 276);
        (beside == right && lit_pixels(&covered) > 40_000).then_some(())
    });
    // A click on "points" draws points; one beside the panel draws nothing anew.
    window.key("Tab");
    window.wait_for_picture("the whole picture", &expected);
    window.key("Tab");
    wait_for("the panel again", || {
        (changed(&window.picture(), &expected) > 10_000).then_some(())
    });
    // Turning beside the panel turns the model, dragging on it does not.
    window.drag(&[(100, 590), (140, 580)]);
    window.key("Tab");
    window.wait_for_picture("the picture as it was", &expected);
    window.drag(&[(500, 300), (540, 300)]);
    wait_for("the model turned", || {
        (changed(&window.picture(), &expected) > 1000).then_some(())
    });
    window.key("r");
    window.wait_for_picture("the first view", &expected);
    window.key("question");
    wait_for("the list of keys", || {
        (changed(&window.picture(), &expected) > 100_000).then_some(())
    });
    window.key("Escape");
    window.wait_for_picture("the list closed", &expected);
    window.key("h");
    wait_for("the graph", || {
        (changed(&window.picture(), &expected) > 10_000).then_some(())
    });
    window.key("h");
    window.key("q");
    must_succeed(&window.end());
}

#[test]
fn every_method_and_kind_of_splat_is_drawn_or_refused_with_a_message() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let look = ["generate:statue:20000", "--size", "300x200", "--validate"];
    let filtered = [&look[..], &["--splat", "filtered"]].concat();
    let expected = render(&filtered, &folder.path().join("drawn.png"));
    let window = Window::open(&display, &[&look[..], &["--panel", "off"]].concat());
    window.wait_for_title("pop, threshold 1 px");
    // The last kind needs sums that the tree was built without: it is built again. The message that says so covers
    // the picture.
    window.key("Shift+n");
    wait_for("filtered splats", || {
        window.key("BackSpace");
        std::thread::sleep(Duration::from_millis(50));
        (window.picture() == expected).then_some(())
    });
    // They cannot tell the sides of a surface apart, so the key of that is refused, and says so.
    window.key("u");
    let title = window.wait_for_title("filtered splats");
    assert!(title.contains("sides"), "{title}");
    window.key("BackSpace");
    window.wait_for_picture("the last picture that could be drawn", &expected);
    window.key("Tab");
    for method in ["a", "s", "x", "d"] {
        window.key(method);
        for key in [
            "n", "n", "n", "n", "n", "n", "m", "m", "m", "m", "k", "k", "k", "j", "j", ",", ".",
            "l", "u", "u", "v", "v", "i", "e", "e", "e", "e", "e", "b", "c", "4", "plus", "-", "t",
        ] {
            // A turntable is a folder full of pictures.
            if key != "t" {
                window.key(key);
            }
        }
    }
    for _ in 0..4 {
        window.key("BackSpace");
    }
    window.key("1");
    window.key("d");
    window.wait_for_title("pop, threshold 1 px");
    window.key("q");
    must_succeed(&window.end());
}

#[test]
fn the_panel_follows_the_scale_of_the_screen() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let shot = |name: &str, more: &[&str]| {
        let file = folder.path().join(name);
        let arguments = [
            "generate:statue:2000",
            "--size",
            "1000x700",
            "--panel",
            "on",
        ];
        let mut command = display.surfel(&arguments);
        command.args(more).args(["--background", "white"]);
        command.args(["--validate", "--screenshot", file.to_str().unwrap()]);
        must_succeed(&run(&mut command));
        load(&file)
    };
    // Where the light background begins beside the dark panel.
    let width = |picture: &image::RgbImage| {
        (0..picture.width())
            .find(|&x| picture.get_pixel(x, picture.height() - 3).0[0] > 200)
            .unwrap()
    };
    let once = width(&shot("once.png", &[]));
    assert!((270..290).contains(&once), "{once}");
    assert_eq!(width(&shot("asked.png", &["--ui-scale", "2"])), 2 * once);
    display.set_dots_per_inch(192);
    assert_eq!(width(&shot("dense.png", &[])), 2 * once);
}

#[test]
fn a_dropped_model_is_opened_and_a_broken_one_is_told() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let arguments = [
        "generate:statue:2000",
        "--size",
        "300x200",
        "--validate",
        "--panel",
        "off",
    ];
    let window = Window::open(&display, &arguments);
    window.wait_for_title("generate:statue:2000 - pop");
    std::fs::write(
        file("tile.obj"),
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
    )
    .unwrap();
    window.drop_file(&file("tile.obj"));
    window.wait_for_title("tile.obj - pop");
    let tile = [file("tile.obj").to_str().unwrap().to_owned()];
    let look = [tile[0].as_str(), "--size", "300x200"];
    let expected = render(&look, &file("drawn.png"));
    window.wait_for_picture("the dropped model", &expected);
    std::fs::write(file("broken.obj"), "v 0 0 0\nf 1 2 x\n").unwrap();
    window.drop_file(&file("broken.obj"));
    // Not the title of while it is opened, which names it too.
    wait_for("the place of the error in the title", || {
        let title = window.title();
        let has_place = title.contains("line 2") || title.contains(":2");
        (has_place && title.contains("broken.obj")).then_some(())
    });
    wait_for("the message", || {
        (changed(&window.picture(), &expected) > 1000).then_some(())
    });
    window.key("BackSpace");
    window.wait_for_picture("the model that was there", &expected);
    // A camera is dropped like a model.
    let (camera, other) = elsewhere(&look, folder.path());
    window.drop_file(&camera);
    window.wait_for_picture("the view of the dropped camera", &other);
    window.key("q");
    must_succeed(&window.end());
}

/// A tile whose corners have a color, as OBJ.
fn tile_of_color(color: &str) -> String {
    let corners = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"].map(|at| format!("v {at} {color}\n"));
    corners.concat() + "f 1 2 3 4\n"
}

#[test]
fn files_are_opened_again_by_a_key_or_when_they_change_and_seen_as_before() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tile.obj");
    std::fs::write(&path, tile_of_color("1 0 0")).unwrap();
    let tile = path.to_str().unwrap();
    let look = [tile, "--size", "300x200"];
    for is_watched in [false, true] {
        let watch = is_watched.then_some("--watch");
        let more = ["--validate", "--panel", "off"].into_iter().chain(watch);
        let arguments: Vec<&str> = look.into_iter().chain(more).collect();
        let window = Window::open(&display, &arguments);
        window.wait_for_title("tile.obj - pop");
        let (camera, red) = elsewhere(&look, folder.path());
        window.drop_file(&camera);
        window.wait_for_picture("the first file from elsewhere", &red);
        std::fs::write(&path, tile_of_color("0 0 1")).unwrap();
        let (_, blue) = elsewhere(&look, folder.path());
        assert!(changed(&red, &blue) > 300, "the files look alike");
        if !is_watched {
            window.key("F5");
        }
        window.wait_for_picture("the second file from elsewhere", &blue);
        window.key("q");
        must_succeed(&window.end());
        std::fs::write(&path, tile_of_color("1 0 0")).unwrap();
    }
}

#[test]
fn files_dropped_together_are_shown_together() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    for (name, x) in [("left.obj", 0), ("right.obj", 2)] {
        let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| format!("v {} {j} 0\n", x + i));
        std::fs::write(file(name), corners.concat() + "f 1 2 3 4\n").unwrap();
    }
    let size = ["--size", "300x200"];
    let quiet = ["--validate", "--panel", "off"];
    let window = Window::open(
        &display,
        &[&["generate:statue:2000"], &size[..], &quiet].concat(),
    );
    window.wait_for_title("generate:statue:2000 - pop");
    let both = [file("left.obj"), file("right.obj")];
    window.drop_files(&[&both[0], &both[1]]);
    window.wait_for_title("left.obj - pop");
    let names = both.each_ref().map(|path| path.to_str().unwrap());
    let expected = render(&[&names[..], &size].concat(), &file("drawn.png"));
    window.wait_for_picture("both models", &expected);
    // What cannot be opened is told, and the rest is shown.
    window.drop_files(&[&both[1], &file("missing.obj")]);
    window.wait_for_title("missing.obj");
    let alone = render(&[&[names[1]], &size[..]].concat(), &file("alone.png"));
    wait_for("the model and a message", || {
        let off = changed(&window.picture(), &alone);
        (off > 1000 && off < 20_000).then_some(())
    });
    window.key("BackSpace");
    window.wait_for_picture("the model that is there", &alone);
    window.key("q");
    must_succeed(&window.end());
}

#[test]
fn full_screen_fills_the_screen_and_gives_it_back() {
    let Some(display) = Display::open() else {
        return;
    };
    let arguments = ["generate:statue:2000", "--size", "300x200", "--validate"];
    let window = Window::open(&display, &arguments);
    window.wait_for_title("threshold");
    window.key("F11");
    wait_for("the full screen", || {
        (window.size() == (1280, 1024)).then_some(())
    });
    wait_for("a picture on it", || {
        let picture = window.picture();
        (picture.dimensions() == (1280, 1024) && lit_pixels(&picture) > 100_000).then_some(())
    });
    window.key("F11");
    wait_for("the window again", || {
        (window.size() == (300, 200)).then_some(())
    });
    window.key("q");
    must_succeed(&window.end());
}

#[test]
fn flying_moves_the_eye_and_the_camera_goes_through_the_clipboard() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let look = ["generate:statue:20000", "--size", "300x200", "--validate"];
    let file = folder.path().join("drawn.png");
    let expected = render(&look, &file);
    let window = Window::open(&display, &[&look[..], &["--panel", "off"]].concat());
    window.wait_for_picture("the first picture", &expected);
    window.key("Control+c");
    let camera = window.clipboard();
    let path = folder.path().join("camera.json");
    std::fs::write(&path, &camera).unwrap();
    let with_camera = [look[0], "--camera", path.to_str().unwrap()];
    assert!(render(&with_camera, &file) == expected, "another camera");
    window.key("g");
    window.hold("w");
    std::thread::sleep(Duration::from_millis(300));
    window.release("w");
    window.key("g");
    window.key("BackSpace");
    wait_for("the model to come nearer", || {
        let more = lit_pixels(&window.picture()) > lit_pixels(&expected) + 500;
        more.then_some(())
    });
    window.key("Control+v");
    window.wait_for_picture("the view that was copied", &expected);
    window.key("q");
    must_succeed(&window.end());
}

#[test]
fn a_camera_file_decides_the_view() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    // Another field of view and a shift of the picture: what no turntable has.
    let camera = r#"{"width": 240, "height": 180, "view": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,-4,1],
        "proj": [2.2,0,0,0, 0,2.9,0,0, 0.3,-0.1,-1.2,-1, 0,0,-1.1,0], "light": "directional"}"#;
    std::fs::write(file("camera.json"), camera).unwrap();
    let path = file("camera.json");
    let arguments = ["generate:statue:20000", "--camera", path.to_str().unwrap()];
    let expected = render(&arguments, &file("drawn.png"));
    let shown = file("shown.png");
    let mut command = display.surfel(&arguments);
    must_succeed(&run(command.args(["--screenshot", shown.to_str().unwrap()])));
    assert!(lit_pixels(&expected) > 2000);
    assert!(load(&shown) == expected, "the view of the window differs");
    let mut bad = display.surfel(&["generate:statue:20000", "--camera", "none.json"]);
    let bad = run(&mut bad);
    assert_eq!(bad.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&bad.stderr).contains("none.json"));
}

#[test]
fn at_rest_the_picture_is_as_fine_as_it_was_asked_for() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let look = ["generate:statue:60000", "--size", "300x200", "--validate"];
    let expected = render(&look, &folder.path().join("drawn.png"));
    // No device draws this in a millisecond, so the threshold rises while the view is turned to and fro.
    let more = ["--panel", "off", "--frame-ms", "1"];
    let window = Window::open(&display, &[&look[..], &more].concat());
    window.wait_for_picture("the first picture", &expected);
    window.drag(&[(150, 100), (170, 110), (190, 120), (150, 100)]);
    window.key("r");
    window.wait_for_picture("the fine picture", &expected);
    window.key("q");
    must_succeed(&window.end());
}

fn is_near(a: &Path, b: &image::RgbImage) -> bool {
    // The angle is the sum of two in one case, and single pixels at the rim follow its last bit.
    let a = load(a);
    a.dimensions() == b.dimensions() && changed(&a, b) <= a.len() / 3 / 200
}

#[test]
fn a_turntable_is_pictures_from_all_around() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let turn = folder.path().join("new/turn");
    let look = ["generate:statue:20000", "--size", "200x160"];
    let mut command = display.surfel(&look);
    command.args(["--validate", "--turntable", turn.to_str().unwrap()]);
    must_succeed(&run(command.args(["--frames", "3"])));
    let count = std::fs::read_dir(&turn).unwrap().count();
    assert_eq!(count, 3);
    for (index, orbit) in ["30,20,1", "150,20,1", "270,20,1"].iter().enumerate() {
        let file = folder.path().join("drawn.png");
        let drawn = render(&[&look[..], &["--orbit", orbit]].concat(), &file);
        let picture = turn.join(format!("turn-{index:03}.png"));
        assert!(is_near(&picture, &drawn), "picture {index}");
    }
}

#[test]
fn the_window_shows_what_render_draws_with_every_method_and_splat() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let look = ["generate:statue:30000", "--size", "200x160", "--validate"];
    // In studio light a closed surface is the same from one side and from both.
    let light = ["--light", "headlight", "--ambient-occlusion", "off"];
    let look = [&look[..], &light, &["--threshold", "3"]].concat();
    let window = Window::open(&display, &[&look[..], &["--panel", "off"]].concat());
    window.wait_for_title("pop, threshold 3 px");
    let mut pictures: Vec<image::RgbImage> = Vec::new();
    // Keys, one after the other in one window, and what makes the same picture on the command line.
    for (keys, words) in [
        (&[][..], ""),
        (&["n"], "--splat disc"),
        (&["n"], "--splat ellipse"),
        (&["n"], "--splat gauss"),
        (&["j"], "--splat gauss --splat-shading deferred"),
        (
            &["."],
            "--splat gauss --splat-shading deferred --depth-offset 1.25",
        ),
        (&["o", "j", "n"], "--splat visibility"),
        (&["k"], "--splat visibility --reconstruct density"),
        (&["k"], "--splat visibility --reconstruct pull-push"),
        (
            &["c", "c"],
            "--splat visibility --reconstruct pull-push --color-by classification",
        ),
        (&["Shift+c", "Shift+c", "k", "n"], "--splat filtered"),
        // Around, to squares, whose usual way of blending is told by its name first.
        (&["n", "m", "m"], "--blend two-pass"),
        // Two ways are passed over with a message.
        (&["m", "c"], "--color-by primitive"),
        (&["c"], "--color-by level"),
        (&["c"], "--color-by normal"),
        (&["c"], "--color-by depth"),
        (&["c"], "--color-by overdraw"),
        (
            &["c", "Shift+c", "a"],
            "--method triangles --color-by overdraw",
        ),
        (&["Shift+c"], "--method triangles --color-by depth"),
        (&["Shift+c"], "--method triangles --color-by normal"),
        // There are no levels without a cut: no message, the next.
        (&["Shift+c", "c", "d"], "--color-by normal"),
        (&["c", "c", "c", "b"], "--culling off"),
        (&["b", "a"], "--method triangles"),
        (&["u"], "--method triangles --one-sided"),
        (&["u", "s"], "--method points"),
        (&["x"], "--method splats"),
        (&["n"], "--method splats --splat disc"),
        (&["Shift+n", "d"], ""),
    ] {
        for key in keys {
            window.key(key);
            // A key that comes again within 20 ms is held, for the window system.
            std::thread::sleep(Duration::from_millis(40));
        }
        let words: Vec<&str> = words.split_whitespace().collect();
        let drawn = render(
            &[&look[..], &words].concat(),
            &folder.path().join("drawn.png"),
        );
        wait_for(&format!("the picture of {words:?}"), || {
            if window.picture() == drawn {
                return Some(());
            }
            // What was passed over or refused is told on top of the picture.
            window.key("BackSpace");
            std::thread::sleep(Duration::from_millis(30));
            None
        });
        let last = pictures.last();
        assert!(
            last.is_none_or(|last| *last != drawn),
            "{words:?} is as before"
        );
        pictures.push(drawn);
    }
    assert!(pictures.last() == pictures.first());
    window.key("q");
    must_succeed(&window.end());
}

#[test]
fn a_hidden_panel_has_no_pass() {
    let Some(display) = Display::open() else {
        return;
    };
    let passes = |panel: &str| {
        let arguments = [
            "generate:statue:2000",
            "--size",
            "400x300",
            "--panel",
            panel,
            "--path",
            "raster",
        ];
        let mut command = display.surfel(&arguments);
        command.args(["--exit-after-frames", "4", "--log", "surfel=debug"]);
        let output = run(&mut command);
        must_succeed(&output);
        let log = String::from_utf8_lossy(&output.stderr).into_owned();
        let count = |pass: &str| log.matches(&format!("pass{{name=\"{pass}\"}}")).count();
        (count("opaque.triangles"), count("overlay"))
    };
    let (drawn, covered) = passes("off");
    assert!(
        drawn >= 4 && covered == 0,
        "{drawn} frames, {covered} covered"
    );
    let (drawn, covered) = passes("on");
    assert!(
        drawn >= 4 && covered >= 4,
        "{drawn} frames, {covered} covered"
    );
}

#[test]
fn nothing_is_done_while_nothing_moves_and_a_minimised_window_comes_back() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let look = ["generate:statue:20000", "--size", "300x200", "--validate"];
    let file = folder.path().join("drawn.png");
    let expected = render(&look, &file);
    let window = Window::open(&display, &[&look[..], &["--panel", "off"]].concat());
    window.wait_for_picture("the first picture", &expected);
    let rests = |what: &str| {
        // It may have something left to finish.
        std::thread::sleep(Duration::from_millis(300));
        let (Some(before), wait) = (window.processor_time(), Duration::from_millis(1500)) else {
            eprintln!("no processor times here: rest is not tested");
            return;
        };
        std::thread::sleep(wait);
        let used = window.processor_time().unwrap() - before;
        println!("{what}: {used:?} of the processor in {wait:?}");
        // A window that draws or polls takes all of it, or as much as others leave. Two wake-ups a second take less
        // than a hundredth.
        assert!(
            used <= Duration::from_millis(70),
            "{what}: {used:?} in {wait:?}"
        );
    };
    rests("at rest");
    window.minimise(true);
    rests("minimised");
    // What comes meanwhile is taken, and shown when the window is.
    let (camera, other) = elsewhere(&look, folder.path());
    window.drop_file(&camera);
    std::thread::sleep(Duration::from_millis(100));
    window.minimise(false);
    window.wait_for_picture("the view that was dropped meanwhile", &other);
    window.minimise(true);
    window.minimise(false);
    window.wait_for_picture("the same view", &other);
    window.key("q");
    must_succeed(&window.end());
}

#[test]
fn a_large_model_has_a_coarse_picture_first_and_the_view_stays() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("input.jsonl");
    let look = ["generate:statue:400000", "--size", "300x200", "--validate"];
    let window = Window::open(
        &display,
        &[
            &look[..],
            &["--panel", "off", "--threshold", "2", "--record"],
            &[input.to_str().unwrap()],
        ]
        .concat(),
    );
    window.wait_for_title("threshold 2 px");
    let threshold = [&look[..], &["--threshold", "2"]].concat();
    let whole = render(&threshold, &folder.path().join("drawn.png"));
    window.wait_for_picture("the whole model", &whole);
    window.key("q");
    must_succeed(&window.end());
    let recorded = std::fs::read_to_string(&input).unwrap();
    let at = |what: &str| {
        recorded
            .find(what)
            .unwrap_or_else(|| panic!("no {what}: {recorded}"))
    };
    assert!(at("\"preview\"") < at("\"loaded\""));
    // The same with a turn in between: the view of the preview stays when the model comes.
    let (before, after) = recorded.split_at(recorded[..at("\"loaded\"")].rfind('\n').unwrap() + 1);
    let step = |text: &str| -> u64 {
        let start = text.find("\"step\":").unwrap() + 7;
        let digits = text[start..].split(|c: char| !c.is_ascii_digit()).next();
        digits.unwrap().parse().unwrap()
    };
    let key = r#"{"key":{"key":{"pad":3},"pressed":true}}"#;
    let turned = format!(
        "{before}{{\"step\":{},\"time\":1.0,\"event\":{key}}}\n{after}",
        step(after)
    );
    std::fs::write(&input, turned).unwrap();
    let pictures = folder.path().join("pictures");
    let mut command = display.surfel(&threshold);
    command.args(["--replay"]).arg(&input).arg("--headless");
    must_succeed(&run(command.arg("--pictures").arg(&pictures)));
    let mut names: Vec<_> = std::fs::read_dir(&pictures)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    names.sort();
    let side = [&threshold[..], &["--orbit", "90,0,1"]].concat();
    let side = render(&side, &folder.path().join("drawn.png"));
    let (coarse, fine) = (load(&names[0]), load(names.last().unwrap()));
    assert!(
        changed(&fine, &side) <= 60,
        "{} pixels",
        changed(&fine, &side)
    );
    // Coarse, but of the same shape: its outline is the model's but for the size of its points.
    assert!(coarse != whole);
    let outline = |p: &image::RgbImage, q: &image::RgbImage| {
        let lit = |p: &image::Rgb<u8>| p.0 != [0; 3];
        p.pixels()
            .zip(q.pixels())
            .filter(|(a, b)| lit(a) != lit(b))
            .count()
    };
    let (apart, lit) = (outline(&coarse, &whole), lit_pixels(&whole));
    assert!(10 * apart < lit, "{apart} of {lit} pixels");
}
