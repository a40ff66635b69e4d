//! COLMAP, text and binary.

use super::{assert_same, folder, quaternion, truth, words};
use crate::photos::error::PhotoError;
use crate::photos::formats::read_scene;
use crate::photos::lens::{CameraLens, LensModel};
use crate::photos::scene::SceneFormat;
use std::fmt::Write;
use std::path::Path;

/// A COLMAP model as text: the second image has no features, so its line is empty.
pub(super) fn save_colmap(folder: &Path, model: &str) {
    let at = |name: &str| folder.join(name);
    std::fs::write(at("cameras.txt"), format!("# cameras\n7 {model}\n")).unwrap();
    let mut images = String::from("# images\n");
    for (id, (name, camera)) in [("a.png", truth()[0]), ("b.png", truth()[1])]
        .iter()
        .enumerate()
    {
        let q = quaternion(camera.rotation);
        let t = -(camera.rotation * camera.center);
        let pose = words(q.into_iter().chain(t.to_array()));
        let features = if id == 0 { "1.5 2.5 -1 10 11 5" } else { "" };
        let _ = writeln!(images, "{} {pose} 7 {name}\n{features}", id + 3);
    }
    std::fs::write(at("images.txt"), images).unwrap();
    std::fs::write(at("points3D.txt"), "5 1 2 3 200 100 50 0.4 3 1 4 0\n").unwrap();
}

#[test]
fn colmap_text_keeps_empty_lines_and_its_pixels() {
    let folder = folder();
    let sparse = folder.path().join("sparse/0");
    std::fs::create_dir_all(&sparse).unwrap();
    save_colmap(&sparse, "PINHOLE 64 48 70 70 30.25 25.5");
    let scene = read_scene(folder.path(), None).unwrap();
    assert_eq!(scene.format, SceneFormat::ColmapText);
    // The center of the first pixel is at one half, as here.
    assert_same(&scene, &truth());
    let views = &scene.points[0].views;
    assert_eq!((views[0].photo, views[0].pixel), (0, [10.0, 11.0]));
    assert!(views[1].pixel[0].is_nan(), "a feature that is not there");
    // Any of its files stands for the folder.
    let again = read_scene(&sparse.join("images.txt"), None).unwrap();
    assert_eq!((again.path, again.photos), (scene.path, scene.photos));
}

#[test]
fn colmap_models_are_known_by_name_and_others_refused() {
    let folder = folder();
    let lens = |model: &str| {
        save_colmap(folder.path(), model);
        read_scene(folder.path(), None).map(|scene| scene.photos[0].camera)
    };
    let brown = |k: &[f64]| CameraLens::new(LensModel::Brown, k);
    for (model, wanted) in [
        ("SIMPLE_PINHOLE 64 48 70 30 25", CameraLens::default()),
        ("SIMPLE_RADIAL 64 48 70 30 25 -0.1", brown(&[-0.1])),
        ("RADIAL 64 48 70 30 25 -0.1 0.02", brown(&[-0.1, 0.02])),
        (
            "OPENCV 64 48 70 71 30 25 -0.1 0.02 0.001 0.002",
            brown(&[-0.1, 0.02, 0.001, 0.002]),
        ),
        (
            "FULL_OPENCV 64 48 70 71 30 25 .1 .2 .3 .4 .5 .6 .7 .8",
            CameraLens::new(
                LensModel::Rational,
                &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8],
            ),
        ),
        (
            "OPENCV_FISHEYE 64 48 70 71 30 25 .1 .2 .3 .4",
            CameraLens::new(LensModel::Fisheye, &[0.1, 0.2, 0.3, 0.4]),
        ),
        (
            "RADIAL_FISHEYE 64 48 70 30 25 .1 .2",
            CameraLens::new(LensModel::Fisheye, &[0.1, 0.2]),
        ),
    ] {
        let camera = lens(model).unwrap();
        assert_eq!(camera.lens, wanted, "{model}");
        let second = if model.contains(" 71 ") { 71.0 } else { 70.0 };
        assert_eq!(
            (camera.focal, camera.principal),
            ([70.0, second], [30.0, 25.0]),
            "{model}"
        );
    }
    for model in [
        "FOV 64 48 70 70 30 25 0.9",
        "THIN_PRISM_FISHEYE 64 48 1 2 3 4 5 6 7 8 9 10 11 12",
        "MAGIC 64 48 1",
    ] {
        let error = lens(model).unwrap_err();
        assert!(matches!(error, PhotoError::Lens { .. }), "{error}");
        let name = model.split(' ').next().unwrap();
        assert!(error.to_string().contains(name), "{error}");
    }
    let error = lens("PINHOLE 64 48 70 30 25").unwrap_err().to_string();
    assert!(error.contains("3 parameters instead of 4"), "{error}");
}

/// The binary form of a model that was read as text.
fn save_colmap_binary(folder: &Path) {
    let mut cameras = 1_u64.to_le_bytes().to_vec();
    cameras.extend(7_u32.to_le_bytes());
    cameras.extend(1_u32.to_le_bytes());
    cameras.extend([64_u64, 48].iter().flat_map(|v| v.to_le_bytes()));
    cameras.extend(
        [70.0_f64, 70.0, 30.25, 25.5]
            .iter()
            .flat_map(|v| v.to_le_bytes()),
    );
    std::fs::write(folder.join("cameras.bin"), cameras).unwrap();
    let mut images = 2_u64.to_le_bytes().to_vec();
    for (id, (name, camera)) in [("a.png", truth()[0]), ("b.png", truth()[1])]
        .iter()
        .enumerate()
    {
        images.extend((id as u32 + 3).to_le_bytes());
        let t = -(camera.rotation * camera.center);
        let pose = quaternion(camera.rotation).into_iter().chain(t.to_array());
        images.extend(pose.flat_map(f64::to_le_bytes));
        images.extend(7_u32.to_le_bytes());
        images.extend(name.bytes().chain([0]));
        let features: &[[f64; 2]] = if id == 0 {
            &[[1.5, 2.5], [10.0, 11.0]]
        } else {
            &[]
        };
        images.extend((features.len() as u64).to_le_bytes());
        for [x, y] in features {
            images.extend([x, y].iter().flat_map(|v| v.to_le_bytes()));
            images.extend((-1_i64).to_le_bytes());
        }
    }
    std::fs::write(folder.join("images.bin"), images).unwrap();
    let mut points = 1_u64.to_le_bytes().to_vec();
    points.extend(5_u64.to_le_bytes());
    points.extend([1.0_f64, 2.0, 3.0].iter().flat_map(|v| v.to_le_bytes()));
    points.extend([200, 100, 50]);
    points.extend(0.4_f64.to_le_bytes());
    points.extend(2_u64.to_le_bytes());
    points.extend([3_u32, 1, 4, 0].iter().flat_map(|v| v.to_le_bytes()));
    std::fs::write(folder.join("points3D.bin"), points).unwrap();
}

#[test]
fn colmap_binary_is_the_same_model_and_refuses_every_truncation() {
    let folder = folder();
    save_colmap_binary(folder.path());
    let scene = read_scene(folder.path(), None).unwrap();
    assert_eq!(scene.format, SceneFormat::ColmapBinary);
    assert_same(&scene, &truth());
    assert_eq!(scene.points[0].color, [200, 100, 50]);
    assert_eq!(scene.points[0].views[0].pixel, [10.0, 11.0]);
    for name in ["cameras.bin", "images.bin", "points3D.bin"] {
        let path = folder.path().join(name);
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            let message = read_scene(folder.path(), None).unwrap_err().to_string();
            assert!(
                message.contains(name) && message.contains("byte"),
                "{message}"
            );
        }
        // A count that no memory holds.
        let mut huge = whole.clone();
        huge[..8].copy_from_slice(&u64::MAX.to_le_bytes());
        std::fs::write(&path, huge).unwrap();
        let message = read_scene(folder.path(), None).unwrap_err().to_string();
        assert!(message.contains("damaged"), "{message}");
        std::fs::write(&path, whole).unwrap();
    }
}
