//! Points of a scan, measured in the window and drawn by `surfel render`.

use crate::display::{Display, changed, must_succeed, run};
use crate::render;
use glam::{DVec3, Vec3};
use surfel::math::camera::Camera;

/// A slope of a hundred points, in the coordinates of a map.
fn place(i: usize) -> [f64; 3] {
    let (x, y) = ((i % 10) as f64, (i / 10) as f64);
    [635_000.0 + x, 4_849_000.0 + y, 400.0 + 0.25 * x]
}

#[test]
fn visible_points_are_measured_saved_and_drawn() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let text = |name: &str| file(name).to_str().unwrap().to_owned();
    let rows: String = (0..100)
        .map(|i| {
            let [x, y, z] = place(i);
            format!("{x},{y},{z},{i}\n")
        })
        .collect();
    std::fs::write(file("a.csv"), format!("x,y,z,intensity\n{rows}")).unwrap();
    let (model, camera) = (text("a.csv"), text("c.json"));
    let look = [
        &model,
        "--camera",
        &camera,
        "--threshold",
        "3",
        "--method",
        "points",
    ];
    let first = [
        &model,
        "--save-camera",
        &camera,
        "--size",
        "400x300",
        "--orbit",
        "20,50,1",
    ];
    render(&first, &file("first.png"));
    // Where the points are seen, a little beside.
    let origin = DVec3::new(635_000.0, 4_849_000.0, 400.0);
    let view = Camera::read(&file("c.json")).unwrap().view(origin).unwrap();
    let seen = |i: usize| {
        let own = (DVec3::from_array(place(i)) - origin).as_vec3();
        let (x, y, _) = view.project(own);
        [x, y]
    };
    let step = |step: u32, event: &str| {
        let time = f64::from(step) / 30.0;
        format!(r#"{{"step":{step},"time":{time},"event":{event}}}"#)
    };
    let mut lines = vec![
        r#"{"surfel_input":1}"#.to_owned(),
        step(0, r#"{"size":{"width":400,"height":300,"scale":1.0}}"#),
        step(1, &format!(r#"{{"loaded":"{model}"}}"#)),
    ];
    let mut now = 2;
    let both = r#""modifiers":{"shift":true,"control":true}"#;
    let mut click = |lines: &mut Vec<String>, [x, y]: [f32; 2]| {
        lines.push(step(now, &format!(r#"{{"cursor":[{x},{y}]}}"#)));
        for is_down in [true, false] {
            let button = format!(r#""button":"left","pressed":{is_down},{both}"#);
            lines.push(step(now, &format!(r#"{{"button":{{{button}}}}}"#)));
        }
        now += 1;
    };
    let key = |letter: char| {
        format!(
            r#"{{"key":{{"key":{{"char":"{letter}"}},"pressed":true,"modifiers":{{"control":true}}}}}}"#
        )
    };
    for i in [22, 57] {
        let [x, y] = seen(i);
        click(&mut lines, [x + 1.5, y - 1.0]);
    }
    // Beside everything there is nothing.
    click(&mut lines, [3.0, 3.0]);
    lines.push(step(4, &key('n')));
    for i in [11, 17, 77] {
        click(&mut lines, seen(i));
    }
    for letter in ['j', 'i', 's'] {
        lines.push(step(20, &key(letter)));
    }
    lines.sort_by_key(|line| {
        let number = line
            .split("\"step\":")
            .nth(1)
            .map(|rest| rest.split(',').next().unwrap());
        number.map_or(0, |number| 1 + number.parse::<u32>().unwrap())
    });
    std::fs::write(file("input.jsonl"), lines.join("\n")).unwrap();
    let mut command = display.surfel(&look);
    command.args(["--validate", "--panel", "off", "--headless", "--replay"]);
    let output = run(command.arg(file("input.jsonl")).current_dir(folder.path()));
    must_succeed(&output);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("nothing is seen there"), "{said}");
    let saved = std::fs::read_to_string(file("surfel-measures-000.json")).unwrap();
    let saved: serde_json::Value = serde_json::from_str(&saved).unwrap();
    let points = |i: usize| &saved["measures"][i]["points"];
    assert_eq!(saved["up"], "z");
    assert_eq!(*points(0), serde_json::json!([place(22), place(57)]));
    assert_eq!(
        *points(1),
        serde_json::json!([place(11), place(17), place(77)])
    );
    let number = |i: usize, name: &str| saved["measures"][i][name].as_f64().unwrap();
    assert!((number(0, "length") - (25.0_f64 + 9.0 + 1.5625).sqrt()).abs() < 1e-9);
    assert!((number(0, "height_difference") - 1.25).abs() < 1e-9);
    // 6 by 6 over the slope, half of it.
    assert!((number(1, "area") - 18.0 * 1.0625_f64.sqrt()).abs() < 1e-6);
    assert!((number(1, "horizontal_area") - 18.0).abs() < 1e-6);
    // The same in a picture: line and places, and nothing else.
    let measures = text("surfel-measures-000.json");
    let plain = render(&look, &file("plain.png"));
    let marked = render(
        &[&look[..], &["--measures", &measures]].concat(),
        &file("b.png"),
    );
    for i in [22, 57, 11, 17, 77] {
        let [x, y] = seen(i).map(|value| value as u32);
        assert_eq!(marked.get_pixel(x, y).0, [255, 217, 26], "point {i}");
    }
    let middle = 0.5
        * (Vec3::from([seen(22)[0], seen(22)[1], 0.0])
            + Vec3::from([seen(57)[0], seen(57)[1], 0.0]));
    assert_eq!(marked.get_pixel(middle.x as u32, middle.y as u32).0[0], 255);
    let differ = changed(&plain, &marked);
    assert!((200..6000).contains(&differ), "{differ}");
}
