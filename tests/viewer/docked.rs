//! The picture beside the panel: that of a window without one, in what the panel leaves.

use super::display::{Display, Window, load, must_succeed, run, wait_for};
use super::render;
use std::path::Path;

/// Width of the panel, pixels.
const PANEL: u32 = 276;

/// What a window of 800 x 600 pixels shows beside the panel.
fn beside(picture: &image::RgbImage) -> image::RgbImage {
    let (width, height) = picture.dimensions();
    image::imageops::crop_imm(picture, PANEL, 0, width - PANEL, height).to_image()
}

/// The next picture that P writes; `pictures` were written before.
fn written(window: &Window<'_>, folder: &Path, pictures: &[image::RgbImage]) -> image::RgbImage {
    let path = folder.join(format!("surfel-{:03}.png", pictures.len()));
    window.key("p");
    wait_for("the picture written by P", || path.is_file().then_some(()));
    load(&path)
}

/// Wheel, double click, drags with both buttons, each followed by a picture that P writes; `left` is where the picture
/// begins in the window.
fn gestures(window: &Window<'_>, folder: &Path, left: i16) -> Vec<image::RgbImage> {
    let mut pictures = Vec::new();
    let mut write = || pictures.push(written(window, folder, &pictures));
    write();
    window.move_to(left + 330, 200);
    window.button(4, true);
    window.button(4, false);
    write();
    window.click(left + 300, 260);
    window.click(left + 300, 260);
    window.drag(&[(left + 250, 300), (left + 300, 290)]);
    write();
    window.move_to(left + 200, 200);
    window.button(3, true);
    window.move_to(left + 260, 230);
    window.button(3, false);
    write();
    pictures
}

/// Keys while the cursor rests, and then a turn from where it is.
fn turn_after(window: &Window<'_>, keys: &[&str]) {
    window.move_to(476, 300);
    for key in keys {
        window.key(key);
    }
    window.button(1, true);
    window.move_to(520, 310);
    window.button(1, false);
}

#[test]
fn the_picture_beside_the_panel_is_that_of_a_window_without_one() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let look = ["generate:statue:20000", "--validate"];
    let part = ["--size", "524x600"];
    let expected = render(
        &[&look[..], &part].concat(),
        &folder.path().join("drawn.png"),
    );
    let wide = render(
        &[&look[..], &["--size", "800x600"]].concat(),
        &folder.path().join("wide.png"),
    );
    let (with, without) = (folder.path().join("with"), folder.path().join("without"));
    std::fs::create_dir_all(&with).unwrap();
    std::fs::create_dir_all(&without).unwrap();

    let sized = [&look[..], &["--size", "800x600", "--panel", "on"]].concat();
    let window = Window::open_in(&display, &with, &sized);
    window.wait_for_title("threshold 1 px");
    wait_for("the whole model beside the panel", || {
        (beside(&window.picture()) == expected).then_some(())
    });
    // Gestures are those in the smaller picture once that was laid out anew.
    window.key("Tab");
    window.wait_for_picture("the model in the whole window", &wide);
    window.key("Tab");
    wait_for("the panel again", || {
        (beside(&window.picture()) == expected).then_some(())
    });
    let mut found = gestures(&window, &with, PANEL as i16);
    // The panel goes while the cursor stays where it is, and the next turn is as if it had not been there.
    turn_after(&window, &["r", "Tab"]);
    found.push(written(&window, &with, &found));
    window.key("r");
    window.resize(700, 500);
    let whole = render(
        &[&look[..], &["--size", "700x500"]].concat(),
        &folder.path().join("whole.png"),
    );
    window.wait_for_picture("the whole window", &whole);
    window.key("Tab");
    let narrow = render(
        &[&look[..], &["--size", "424x500"]].concat(),
        &folder.path().join("narrow.png"),
    );
    wait_for("what the panel leaves of the smaller window", || {
        (beside(&window.picture()) == narrow).then_some(())
    });
    // As wide as the panel and half of it, then a pixel narrower: no room beside it.
    window.resize(414, 500);
    let narrowest = render(
        &[&look[..], &["--size", "138x500"]].concat(),
        &folder.path().join("narrowest.png"),
    );
    wait_for("what the panel leaves of the narrowest window", || {
        (beside(&window.picture()) == narrowest).then_some(())
    });
    window.key("Tab");
    window.resize(413, 500);
    let small = render(
        &[&look[..], &["--size", "413x500"]].concat(),
        &folder.path().join("small.png"),
    );
    window.wait_for_picture("the small window", &small);
    window.key("Tab");
    wait_for("the panel over the picture", || {
        let picture = window.picture();
        let is_same = picture.dimensions() == (413, 500) && picture != small;
        let (picture, small) = (beside(&picture), beside(&small));
        (is_same && picture == small).then_some(())
    });
    window.key("q");
    must_succeed(&window.end());

    let sized = [&look[..], &part, &["--panel", "off"]].concat();
    let window = Window::open_in(&display, &without, &sized);
    window.wait_for_picture("the model in a window of that part", &expected);
    let mut wanted = gestures(&window, &without, 0);
    window.resize(800, 600);
    window.key("r");
    window.wait_for_picture("the model in the whole window", &wide);
    turn_after(&window, &[]);
    wanted.push(written(&window, &without, &wanted));
    window.key("q");
    must_succeed(&window.end());
    for (step, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
        assert!(found == wanted, "picture {step} differs beside the panel");
    }
    let idle = wanted.windows(2).position(|w| w[0] == w[1]);
    assert_eq!(idle, None, "a gesture that changed nothing");
}

#[test]
fn a_recording_says_whether_the_panel_was_shown() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let input = file("input.jsonl");
    let path = |name: &Path| name.to_str().unwrap().to_owned();
    let look = ["generate:statue:20000", "--size", "800x600", "--validate"];
    // What is cheap is drawn within the wait below.
    let mut command = display.surfel(&look);
    command.args(["--light", "headlight", "--ambient-occlusion", "off"]);
    command.args(["--panel", "on", "--record", &path(&input)]);
    let window = Window::start(&display, command);
    window.wait_for_title("threshold 1 px");
    window.drag(&[(500, 300), (560, 280), (600, 300)]);
    std::thread::sleep(std::time::Duration::from_millis(500));
    let shown = beside(&window.picture());
    window.key("q");
    must_succeed(&window.end());
    let last = |name: &str, more: &[&str]| {
        let pictures = file(name);
        let mut command = display.surfel(&["--headless", "--replay", &path(&input), "--validate"]);
        command.args(["--light", "headlight", "--ambient-occlusion", "off"]);
        command.args(["--pictures", &path(&pictures)]).args(more);
        must_succeed(&run(&mut command));
        let files = std::fs::read_dir(&pictures).unwrap();
        let last = files.map(|entry| entry.unwrap().path()).max().unwrap();
        load(&last)
    };
    assert!(last("as-recorded", &[]) == shown, "another picture again");
    let all = last("with-panel", &["--panel", "on"]);
    assert_eq!(all.dimensions(), (800, 600));
    assert!(beside(&all) == shown);
    assert_eq!(
        last("without", &["--panel", "off"]).dimensions(),
        (800, 600)
    );
}
