//! Photographs in the window: what is up in them is up in the view, and what a scene that is dropped is taken for.

use super::display::{Display, changed, load, must_succeed, run};
use glam::DVec3;
use std::fmt::Write as _;
use std::path::Path;

/// A wall that stands along `up` with three photographs of it, red above the middle and blue below.
fn scene(folder: &Path, up: DVec3) {
    let right = up.any_orthonormal_vector();
    let back = right.cross(up);
    let mut wall = String::new();
    for k in 0..17 * 17 {
        let [x, y] = [k % 17, k / 17].map(|v| 0.125 * f64::from(v) - 1.0);
        let [x, y, z] = (right * x + up * y).to_array();
        writeln!(wall, "v {x} {y} {z}").unwrap();
    }
    for k in (0..16 * 16).map(|k| 17 * (k / 16) + k % 16 + 1) {
        writeln!(wall, "f {k} {} {} {}", k + 1, k + 18, k + 17).unwrap();
    }
    std::fs::write(folder.join("wall.obj"), wall).unwrap();
    let halves = |_, y| image::Rgb(if y < 60 { [200, 0, 0] } else { [0, 0, 200] });
    let mut frames = Vec::new();
    for (index, x) in [-0.5, 0.0, 0.5].into_iter().enumerate() {
        let name = format!("{index}.png");
        let picture = image::RgbImage::from_fn(160, 120, halves);
        picture.save(folder.join(&name)).unwrap();
        let row = |i: usize| {
            let [a, b, c] = [right[i], up[i], back[i]];
            format!("[{a},{b},{c},{}]", 4.0 * back[i] + x * right[i])
        };
        let rows = [0, 1, 2].map(row).join(",");
        frames.push(format!(
            r#"{{"file_path":"{name}","transform_matrix":[{rows},[0,0,0,1]]}}"#
        ));
    }
    let camera = r#""w":160,"h":120,"fl_x":160,"fl_y":160,"cx":80,"cy":60,"camera_model":"OPENCV""#;
    let text = format!(r#"{{{camera},"frames":[{}]}}"#, frames.join(","));
    std::fs::write(folder.join("transforms.json"), text).unwrap();
    // The same with green points of the wall, for Bundler.
    let mut bundle = "# Bundle file v0.3\n3 1089\n".to_owned();
    for x in [-0.5, 0.0, 0.5] {
        let center = 4.0 * back + x * right;
        writeln!(bundle, "160 0 0").unwrap();
        for row in [right, up, back] {
            writeln!(bundle, "{} {} {}", row.x, row.y, row.z).unwrap();
        }
        let [x, y, z] = [right, up, back].map(|row| -row.dot(center));
        writeln!(bundle, "{x} {y} {z}").unwrap();
    }
    for k in 0..33 * 33 {
        let [x, y] = [k % 33, k / 33].map(|v| f64::from(v) / 16.0 - 1.0);
        let [x, y, z] = (right * x + up * y).to_array();
        writeln!(bundle, "{x} {y} {z}\n0 200 0\n0").unwrap();
    }
    std::fs::write(folder.join("bundle.out"), bundle).unwrap();
    std::fs::write(folder.join("list.txt"), "0.png\n1.png\n2.png\n").unwrap();
}

/// The last picture of a replay of these events after the first, each in a step of its own.
fn last_picture(
    display: &Display,
    folder: &Path,
    arguments: &[&str],
    events: &[&str],
) -> image::RgbImage {
    let first = r#"{"size":{"width":200,"height":150,"scale":1.0}}"#;
    let mut text = "{\"surfel_input\":1}\n".to_owned();
    for (step, event) in [first].iter().chain(events).enumerate() {
        writeln!(text, r#"{{"step":{step},"time":{step},"event":{event}}}"#).unwrap();
    }
    let (input, pictures) = (folder.join("input.jsonl"), folder.join("pictures"));
    std::fs::write(&input, text).unwrap();
    let _ = std::fs::remove_dir_all(&pictures);
    let mut command = display.surfel(arguments);
    command.args(["--panel", "off", "--headless", "--replay"]);
    command.arg(&input).arg("--pictures").arg(&pictures);
    must_succeed(&run(command.current_dir(folder)));
    let mut files: Vec<_> = std::fs::read_dir(&pictures).unwrap().collect();
    files.sort_by_key(|file| file.as_ref().unwrap().path());
    load(&files.last().expect("a picture").as_ref().unwrap().path())
}

#[test]
fn a_scene_on_an_empty_window_is_the_model_and_else_lies_on_it() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    scene(at, DVec3::Y);
    let picture =
        |arguments: &[&str], events: &[&str]| last_picture(&display, at, arguments, events);
    let (dropped, loaded) = (r#"{"drop":"bundle.out"}"#, r#"{"loaded":"bundle.out"}"#);
    let of_points = picture(&["bundle.out"], &[loaded]);
    // Photographs lie on the points, which are green: at most at their rims it is seen.
    let count = |is: fn([u8; 3]) -> bool| of_points.pixels().filter(|p| is(p.0)).count();
    let red = count(|[r, g, b]| r > 100 && g < 50 && b < 50);
    let green = count(|[_, g, _]| g > 50);
    assert!(red > 1000 && 10 * green < red, "{red} {green}");
    for before in [&[][..], &[r#"{"loaded":"missing.ply"}"#]] {
        let events = [before, &[dropped, loaded]].concat();
        assert!(picture(&[], &events) == of_points, "{before:?}");
    }
    assert!(picture(&["photos", "bundle.out"], &[loaded]) == of_points);
    let of_wall = r#"{"loaded":"wall.obj"}"#;
    let on_wall = picture(&["wall.obj", "--photos", "bundle.out"], &[of_wall]);
    let named = ["photos", "bundle.out", "--mesh", "wall.obj"];
    assert!(picture(&named, &[of_wall]) == on_wall);
    assert!(picture(&["wall.obj"], &[of_wall, dropped]) == on_wall);
    assert!(on_wall != of_points && on_wall != picture(&["wall.obj"], &[of_wall]));
    // On a paged file too, all of which is read then. Places move by half a step of its grid.
    must_succeed(&run(display
        .surfel(&["build", "wall.obj", "-o", "wall.surfel"])
        .current_dir(at)));
    let paged = r#"{"loaded":"wall.surfel"}"#;
    let on_pages = picture(&["wall.surfel"], &[paged, dropped, paged]);
    assert!(changed(&on_pages, &on_wall) < 100);
    let started = ["wall.surfel", "--photos", "bundle.out"];
    assert!(picture(&started, &[paged]) == on_pages);
    // They stay when the model is opened again.
    let again = r#"{"key":{"key":{"f":5},"pressed":true}}"#;
    assert!(picture(&["wall.obj"], &[of_wall, dropped, again, of_wall]) == on_wall);
}

/// First rows of blue in two columns left and right of the middle of a picture.
fn border_rows(picture: &image::RgbImage) -> [u32; 2] {
    let (width, height) = picture.dimensions();
    [width / 2 - 10, width / 2 + 10].map(|x| {
        let is_blue = |y: &u32| picture.get_pixel(x, *y).0[2] > 100;
        (0..height).find(is_blue).unwrap()
    })
}

#[test]
fn what_is_up_in_photographs_stays_up_when_a_pose_is_left() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    scene(folder.path(), DVec3::new(0.6, 0.5, -0.6).normalize());
    let input = folder.path().join("input.jsonl");
    let lines = [
        r#"{"surfel_input":1}"#,
        r#"{"step":0,"time":0,"event":{"size":{"width":200,"height":150,"scale":1.0}}}"#,
        r#"{"step":1,"time":1,"event":{"loaded":"wall.obj"}}"#,
        r#"{"step":2,"time":2,"event":{"key":{"key":{"char":"]"},"pressed":true}}}"#,
        r#"{"step":3,"time":3,"event":{"cursor":[100,75]}}"#,
        r#"{"step":4,"time":4,"event":{"scroll":[0,-1]}}"#,
        r#"{"step":5,"time":5,"event":{"cursor":[101,75]}}"#,
    ];
    std::fs::write(&input, lines.join("\n")).unwrap();
    let last = |look: &[&str]| {
        let pictures = folder.path().join("pictures");
        let _ = std::fs::remove_dir_all(&pictures);
        let mut command = display.surfel(&["wall.obj", "--photos", "transforms.json"]);
        command.args(["--panel", "off", "--headless"]).args(look);
        command.arg("--replay").arg(&input);
        command.arg("--pictures").arg(&pictures);
        must_succeed(&run(command.current_dir(folder.path())));
        let mut files: Vec<_> = std::fs::read_dir(&pictures).unwrap().collect();
        files.sort_by_key(|file| file.as_ref().unwrap().path());
        border_rows(&load(&files.last().unwrap().as_ref().unwrap().path()))
    };
    let [left, right] = last(&[]);
    assert!(left.abs_diff(right) <= 1, "{left} {right}");
    // What a person says goes before.
    let [left, right] = last(&["--up", "y"]);
    assert!(left.abs_diff(right) > 10, "{left} {right}");
}
