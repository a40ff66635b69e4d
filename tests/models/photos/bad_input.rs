//! Bad input: nothing is black, nothing is lost, and each cause is said in one sentence.

use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;
use surfel::image::Image;
use surfel::mesh::Mesh;
use surfel::photos::error::PhotoError;
use surfel::photos::formats::read_scene;
use surfel::photos::look::LookSettings;
use surfel::photos::scene::PhotoScene;
use surfel::photos::stage::PhotoStage;
use surfel::photos::surface::{SurfaceDrawer, renderer_camera};
use surfel::progress::SilentProgress;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Method, PhotoDisplay, PictureOutputs, Settings};
use surfel::tree::{BuildOptions, Model};

/// Width and height of photographs.
const SIZE: [u32; 2] = [64, 48];

/// Color of the good photographs.
const GOOD: [u8; 3] = [200, 120, 40];

/// A wall of 4 x 3 in z = 0 that fills a photograph from a distance of 4.
fn wall() -> Model {
    let mut mesh = Mesh::default();
    for y in [-1.5, 1.5] {
        for x in [-2.0, 2.0] {
            mesh.positions.push(glam::Vec3::new(x, y, 0.0));
        }
    }
    mesh.triangles = vec![[0, 1, 3], [0, 3, 2]];
    surfel::tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

fn save(folder: &Path, name: &str, [width, height]: [u32; 2], color: [u8; 3]) {
    let picture = image::RgbImage::from_pixel(width, height, image::Rgb(color));
    picture.save(folder.join(name)).unwrap();
}

/// A frame of a scene, calibrated at [`SIZE`], with the eye there; `backward` is 1 for one that looks along -z.
fn frame(name: &str, [x, y, z]: [f64; 3], backward: f64) -> Value {
    json!({
        "file_path": name,
        "transform_matrix": [
            [backward, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, backward, z], [0.0, 0.0, 0.0, 1.0],
        ],
    })
}

fn scene(folder: &Path, frames: &[Value]) -> Result<PhotoScene, PhotoError> {
    let all = json!({"fl_x": 64.0, "w": SIZE[0], "h": SIZE[1], "frames": frames});
    let file = folder.join("transforms.json");
    std::fs::write(&file, all.to_string()).unwrap();
    read_scene(&file, None)
}

fn staged(scene: &PhotoScene, model: &Model) -> Result<(PhotoStage, Vec<String>), PhotoError> {
    let drawer = SurfaceDrawer::new(&Backend::Cpu, model);
    PhotoStage::load(scene, &drawer, 16, 4096, &SilentProgress)
}

/// The wall from the pose of the first photograph, which it fills, by both renderers of the processor.
fn pictures(scene: &PhotoScene, model: &Model, stage: &PhotoStage) -> [Image; 2] {
    let camera = renderer_camera(&scene.photos[0].camera.pinhole(), model).unwrap();
    let view = camera.view(model.origin).unwrap();
    let photos = Arc::new(stage.frame(&view, &LookSettings::default(), &|_| true, &[]));
    let settings = Settings {
        method: Method::Triangles,
        photos: PhotoDisplay::Color,
        marks_uncovered: true,
        ..Settings::default()
    };
    [Backend::Cpu, Backend::Reference].map(|backend| {
        let outputs = PictureOutputs {
            values: true,
            ..PictureOutputs::default()
        };
        let size = (view.width, view.height);
        let mut engine = Engine::new(&backend, model, size, outputs).unwrap();
        engine.set_photos(Some(photos.clone())).unwrap();
        engine.render(&view, &settings).unwrap()
    })
}

/// Tells whether every pixel has the color of the good photographs.
fn assert_good(pictures: &[Image; 2], what: &str) {
    for picture in pictures {
        for (index, (color, value)) in picture.color.iter().zip(&picture.values).enumerate() {
            let apart = (0..3).map(|c| color[c].abs_diff(GOOD[c])).max().unwrap();
            assert!(
                apart <= 12 && color[3] == 255,
                "{what}: pixel {index} is {color:?}"
            );
            assert!(value.iter().all(|v| v.is_finite()), "{what}: {value:?}");
        }
    }
}

#[test]
fn photographs_that_are_missing_damaged_resized_or_turned_leave_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    save(at, "good.png", SIZE, GOOD);
    save(at, "half.png", SIZE.map(|side| side / 2), GOOD);
    save(at, "turned.png", [SIZE[1], SIZE[0]], [0, 255, 0]);
    save(at, "other.png", [64, 64], [0, 255, 0]);
    save(at, "hurt.png", SIZE, [0, 0, 255]);
    let whole = std::fs::read(at.join("hurt.png")).unwrap();
    std::fs::write(at.join("hurt.png"), &whole[..whole.len() / 2]).unwrap();
    let names = [
        "good.png",
        "missing.png",
        "half.png",
        "turned.png",
        "other.png",
        "hurt.png",
    ];
    let frames: Vec<Value> = (0..)
        .zip(names)
        .map(|(k, name)| frame(name, [0.05 * f64::from(k), 0.0, 4.0], 1.0))
        .collect();
    let scene = scene(at, &frames).unwrap();
    let model = wall();
    let (mut stage, remarks) = staged(&scene, &model).unwrap();
    let said = [scene.remarks.join("\n"), remarks.join("\n")].join("\n");
    for name in ["missing.png", "turned.png", "other.png", "hurt.png"] {
        assert_eq!(said.matches(name).count(), 1, "{name}: {said}");
    }
    // The camera of what was made smaller is made smaller with it.
    let half = scene
        .photos
        .iter()
        .find(|own| own.name == "half.png")
        .unwrap();
    assert_eq!((half.camera.width, half.camera.focal[0]), (32, 32.0));
    let used: Vec<&str> = (scene.photos.iter().zip(stage.photos()))
        .filter(|(_, own)| own.is_some())
        .map(|(photo, _)| photo.name.as_str())
        .collect();
    assert_eq!(used, ["good.png", "half.png"]);
    assert_good(&pictures(&scene, &model, &stage), "thumbnails");
    let camera = renderer_camera(&scene.photos[0].camera, &model).unwrap();
    let view = camera.view(model.origin).unwrap();
    let all = stage.frame(&view, &LookSettings::default(), &|_| true, &[]);
    assert!(stage.load_whole(&scene, &all, 4096).is_empty());
    assert_good(&pictures(&scene, &model, &stage), "whole");
}

#[test]
fn cameras_far_away_behind_and_in_the_surface_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    save(at, "good.png", SIZE, GOOD);
    save(at, "bad.png", SIZE, [10, 10, 250]);
    let model = wall();
    for (what, place, backward) in [
        ("far away", [3e11, 0.0, 9e11], 1.0),
        ("looks away", [0.5, 0.0, 4.0], -1.0),
        ("behind the wall", [0.0, 0.0, -4.0], 1.0),
        ("in the surface", [0.0, 0.0, 0.0], 1.0),
        ("next to the surface", [0.3, 0.2, 1e-6], 1.0),
    ] {
        let frames = [
            frame("good.png", [0.0, 0.0, 4.0], 1.0),
            frame("bad.png", place, backward),
        ];
        let scene = scene(at, &frames).unwrap();
        let (stage, remarks) = staged(&scene, &model).unwrap();
        assert!(remarks.is_empty(), "{what}: {remarks:?}");
        assert_eq!(stage.photos().iter().flatten().count(), 2, "{what}");
        assert_good(&pictures(&scene, &model, &stage), what);
    }
    // At infinity there is no camera.
    let mut infinite = frame("bad.png", [0.0; 3], 1.0);
    infinite["transform_matrix"][0][3] = json!(1e300);
    let scene = scene(at, &[frame("good.png", [0.0, 0.0, 4.0], 1.0), infinite]).unwrap();
    assert_eq!(scene.photos.len(), 1);
    assert!(
        scene.remarks.join("\n").contains("bad.png is left out"),
        "{:?}",
        scene.remarks
    );
}

#[test]
fn scenes_of_which_nothing_can_be_used_say_why() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    save(at, "good.png", SIZE, GOOD);
    let good = frame("good.png", [0.0, 0.0, 4.0], 1.0);
    let of = |frames: &[Value], model: &Model| -> String {
        let scene = scene(at, frames).unwrap();
        staged(&scene, model).unwrap_err().to_string()
    };
    let mut elsewhere = wall();
    elsewhere.origin = glam::DVec3::new(900.0, 0.0, 0.0);
    let message = of(std::slice::from_ref(&good), &elsewhere);
    assert!(message.contains("different frames"), "{message}");
    let message = of(&[frame("none.png", [0.0, 0.0, 4.0], 1.0)], &wall());
    assert!(message.contains("no photograph is there"), "{message}");
    // No camera is registered: Bundler has a focal length of 0 then.
    let none =
        "# Bundle file v0.3\n2 0\n".to_owned() + &"0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n".repeat(2);
    std::fs::write(at.join("bundle.out"), none).unwrap();
    std::fs::write(at.join("list.txt"), "good.png\nother.png\n").unwrap();
    let message = read_scene(&at.join("bundle.out"), None)
        .unwrap_err()
        .to_string();
    assert!(message.contains("none is registered"), "{message}");
}
