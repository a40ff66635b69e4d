//! Photographs in the window: what is up in them is up in the view.

use super::display::{Display, load, must_succeed, run};
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
