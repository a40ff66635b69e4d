//! The section in the window: a handle of its box is dragged.

use crate::display::{Display, changed, load, must_succeed, run};
use crate::render;
use serde_json::json;
use surfel::math::camera::Camera;
use surfel::math::section_box::SectionBox;
use surfel::viewer::section_handles::{SectionFace, SectionHandles};

#[test]
fn a_face_of_the_section_follows_the_cursor() {
    let Some(display) = Display::open() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let text = |name: &str| file(name).to_str().unwrap().to_owned();
    let (model, camera) = ("generate:statue:20000", text("c.json"));
    let look = [model, "--size", "400x300"];
    let first = [&look[..], &["--orbit", "30,20,1", "--save-camera", &camera]].concat();
    let whole = render(&first, &file("whole.png"));
    let options = surfel::OpenOptions::default();
    let statue = surfel::open(model, &options, &surfel::progress::SilentProgress).unwrap();
    let statue = statue.model;
    let bounds = SectionBox {
        low: statue.min,
        high: statue.max,
    };
    // The half along z that is nearer to the eye is cut away; then its face is dragged to a quarter.
    let mut half = bounds;
    half.high.z = 0.5 * (bounds.low.z + bounds.high.z);
    let view = Camera::read(file("c.json").as_path())
        .unwrap()
        .view(statue.origin)
        .unwrap();
    let handles = SectionHandles::new(&half, bounds);
    let face = SectionFace {
        axis: 2,
        is_upper: true,
    };
    let middle = handles.place(face);
    let mut wanted = middle;
    wanted.z = bounds.low.z + 0.25 * (bounds.high.z - bounds.low.z);
    let pixel = |place| {
        let (x, y, _) = view.project(place);
        [f64::from(x), f64::from(y)]
    };
    let (from, to) = (pixel(middle), pixel(wanted));
    let between = [0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1])];
    let button =
        |is_down: bool| json!({"button": {"button": "left", "pressed": is_down, "modifiers": {}}});
    let events = [
        (
            0,
            json!({"size": {"width": 400, "height": 300, "scale": 1.0}}),
        ),
        (1, json!({ "loaded": model })),
        (
            2,
            json!({"key": {"key": {"char": "y"}, "pressed": true, "modifiers": {"shift": true}}}),
        ),
        (4, json!({ "cursor": from })),
        (5, button(true)),
        (6, json!({ "cursor": between })),
        (7, json!({ "cursor": to })),
        (8, button(false)),
        // The handle is let go: what follows moves nothing.
        (9, json!({"cursor": [5.0, 5.0]})),
    ];
    let lines =
        events.map(|(step, event)| json!({"step": step, "time": step, "event": event}).to_string());
    let recording = format!("{{\"surfel_input\":1}}\n{}\n", lines.join("\n"));
    std::fs::write(file("input.jsonl"), recording).unwrap();
    let mut command = display.surfel(&[model, "--camera", &camera, "--smooth", "off"]);
    command.args(["--validate", "--headless", "--replay", &text("input.jsonl")]);
    command.args(["--pictures", &text("pictures")]);
    must_succeed(&run(command.current_dir(folder.path())));
    let shown = |step: u32| load(&file("pictures").join(format!("step-{step:06}.png")));
    let drawn = |high: f32| {
        let [low, top] = [bounds.low, bounds.high];
        let section = format!("{},{},{},{},{},{high}", low.x, low.y, low.z, top.x, top.y);
        let more = ["--camera", &camera, "--section", &section];
        render(&[&look[..], &more].concat(), &file("drawn.png"))
    };
    let (cut, dragged) = (drawn(half.high.z), drawn(wanted.z));
    assert!(changed(&whole, &cut) > 1000 && changed(&cut, &dragged) > 1000);
    // Nothing is drawn any more once the handle is let go.
    assert!(!file("pictures").join("step-000009.png").exists());
    for (step, wanted) in [(1, &whole), (2, &cut), (7, &dragged)] {
        // Triangles at the face turn up or not by the last place of its coordinate.
        let differ = changed(&shown(step), wanted);
        assert!(differ < 60, "step {step}: {differ} pixels differ");
    }
}
