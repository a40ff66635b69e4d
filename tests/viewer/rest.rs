//! A window at rest: its picture becomes smooth, and then nothing is done.

use super::display::{Display, Window, load, must_succeed, wait_for};
use super::render;
use std::time::Duration;

/// Mean difference, levels of 255.
fn levels(one: &image::RgbImage, two: &image::RgbImage) -> f64 {
    if one.dimensions() != two.dimensions() {
        return 255.0;
    }
    let pairs = one.as_raw().iter().zip(two.as_raw());
    let sum: u64 = pairs.map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / one.as_raw().len() as f64
}

#[test]
fn a_resting_window_becomes_smooth_and_then_does_nothing() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("drawn.png");
    let look = ["generate:statue:60000", "--size", "300x200", "--validate"];
    let exact = ["--method", "triangles", "--samples", "64"];
    let mean = render(&[&look[..], &exact[..]].concat(), &file);
    let single = render(&look, &file);
    let off = levels(&single, &mean);
    let more = ["--panel", "off", "--smooth", "on"];
    let window = Window::open(&display, &[&look[..], &more[..]].concat());
    let is_smooth = || (levels(&window.picture(), &mean) < (off / 3.0).min(1.0)).then_some(());
    wait_for("a smooth picture", is_smooth);
    // Of the same view begun anew it is the same in the end.
    window.key("r");
    wait_for("a smooth picture again", is_smooth);
    if window.processor_time().is_some() {
        wait_for("rest", || {
            let before = window.processor_time()?;
            std::thread::sleep(Duration::from_millis(1500));
            let used = window.processor_time()? - before;
            (used <= Duration::from_millis(70)).then_some(())
        });
    }
    let rested = window.picture();
    assert!(levels(&rested, &mean) < 1.0);
    window.key("q");
    must_succeed(&window.end());
}

#[test]
fn a_small_model_becomes_smooth_after_one_motion() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("drawn.png");
    // So small that no frame is coarse: nothing happens after the motion.
    let look = ["generate:sphere:500", "--size", "120x90", "--validate"];
    let mean = render(&[&look[..], &["--samples", "64"]].concat(), &file);
    let more = ["--panel", "off", "--smooth", "on"];
    let window = Window::open(&display, &[&look[..], &more[..]].concat());
    let difference = || levels(&window.picture(), &mean);
    wait_for("a smooth picture", || (difference() < 0.5).then_some(()));
    window.move_to(60, 45);
    window.button(4, true);
    window.button(4, false);
    wait_for("another view", || (difference() > 1.0).then_some(()));
    window.key("r");
    wait_for("a smooth picture again", || {
        (difference() < 0.5).then_some(())
    });
    window.key("q");
    must_succeed(&window.end());
}

#[test]
fn a_picture_that_is_asked_for_is_the_one_that_the_view_becomes() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let look = ["generate:statue:60000", "--size", "300x200", "--validate"];
    let exact = ["--method", "triangles", "--samples", "64"];
    let mean = render(&[&look[..], &exact[..]].concat(), &file("drawn.png"));
    let off = levels(&render(&look, &file("drawn.png")), &mean);
    let more = ["--panel", "off", "--smooth", "on"];
    let window = Window::open_in(&display, folder.path(), &[&look[..], &more[..]].concat());
    window.wait_for_title("threshold 1 px");
    // A view begun anew is not smooth yet.
    window.key("r");
    window.key("p");
    wait_for("the picture", || {
        file("surfel-000.png").is_file().then_some(())
    });
    let picture = load(&file("surfel-000.png"));
    let is = levels(&picture, &mean);
    assert!(is < off / 3.0, "{is} of {off}");
    // Asked twice, or with another view, it is written as it is.
    for (number, keys) in [(1, ["r", "p", "p"]), (2, ["p", "r", "9"])] {
        keys.iter().for_each(|key| window.key(key));
        let path = file(&format!("surfel-{number:03}.png"));
        wait_for("another picture", || path.is_file().then_some(()));
    }
    // So is one that is waited for when the window closes.
    window.key("r");
    window.key("p");
    window.key("q");
    must_succeed(&window.end());
    assert!(file("surfel-003.png").is_file());
}
