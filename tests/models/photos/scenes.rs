//! Real files: the cameras must take the sparse points to where they were measured.

use crate::common_models::real_file;
use surfel::photos::formats::read_scene;
use surfel::photos::scene::{PhotoScene, SceneFormat};

/// Sorted distances between measured and projected points, pixels.
fn errors(scene: &PhotoScene) -> Vec<f64> {
    let mut errors: Vec<f64> = (scene.points.iter())
        .flat_map(|point| point.views.iter().map(move |view| (point, view)))
        .filter(|(_, view)| view.pixel[0].is_finite())
        .map(|(point, view)| {
            let seen = scene.photos[view.photo as usize]
                .camera
                .project(point.position);
            let [x, y] = view.pixel.map(f64::from);
            seen.map_or(f64::INFINITY, |p| (p.x - x).hypot(p.y - y))
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    errors
}

fn read(name: &str) -> Option<PhotoScene> {
    Some(read_scene(&real_file(name)?, None).unwrap())
}

#[test]
fn kermit_is_reprojected_as_its_program_says() {
    let Some(scene) = read("photos/kermit/bundle.out") else {
        return;
    };
    assert_eq!((scene.photos.len(), scene.points.len()), (9, 634));
    assert!(
        scene.remarks[0].contains("kermit004.jpg, kermit006.jpg"),
        "{:?}",
        scene.remarks
    );
    let errors = errors(&scene);
    let (median, p95) = (errors[errors.len() / 2], errors[errors.len() * 95 / 100]);
    println!(
        "{} views, {median:.3} px median, {p95:.3} px at 95%",
        errors.len()
    );
    // The program measured 0.20 and 0.84.
    assert!(errors.len() == 2039 && median < 0.21 && p95 < 0.85);
}

#[test]
fn the_castle_is_the_same_in_two_formats() {
    let (Some(mvs), Some(bundle)) = (
        read("photos/sceaux/scene.mvs"),
        read("photos/sceaux/derived/bundle.out"),
    ) else {
        return;
    };
    assert_eq!((mvs.photos.len(), mvs.points.len()), (11, 12_683));
    // As Sparse.ply beside it has it.
    assert_eq!(mvs.points[0].color, [185, 184, 180]);
    assert_eq!((bundle.photos.len(), bundle.points.len()), (10, 12_043));
    assert_eq!(
        mvs.photos
            .iter()
            .filter(|photo| photo.file.is_some())
            .count(),
        10
    );
    // The bundle's photographs are crops from (73, 123), at half the size; whoever made them counted centers of pixels from 0,
    // so half a pixel is to be expected.
    for (a, b) in mvs.photos.iter().zip(&bundle.photos) {
        assert!(
            a.name.ends_with(b.name.rsplit('/').next().unwrap()),
            "{} {}",
            a.name,
            b.name
        );
        for point in mvs.points.iter().step_by(97) {
            let (Some(p), Some(q)) = (
                a.camera.project(point.position),
                b.camera.project(point.position),
            ) else {
                continue;
            };
            let away = [(p.x - 73.0) / 2.0 - q.x, (p.y - 123.0) / 2.0 - q.y];
            assert!(away.iter().all(|d| d.abs() < 0.8), "{away:?}");
        }
    }
}

#[test]
fn the_castle_of_colmap_is_reprojected() {
    let Some(path) = real_file("photos/sceaux_colmap/images.txt") else {
        return;
    };
    let scene = read_scene(path.parent().unwrap(), None).unwrap();
    assert_eq!(scene.format, SceneFormat::ColmapText);
    assert_eq!((scene.photos.len(), scene.points.len()), (11, 7862));
    let errors = errors(&scene);
    println!(
        "{} views, {:.3} px median",
        errors.len(),
        errors[errors.len() / 2]
    );
    assert!(errors.len() > 30_000 && errors[errors.len() / 2] < 0.6);
}

#[test]
fn the_castle_of_visualsfm_is_reprojected() {
    let Some(mut scene) = read("photos/sceaux_nvm/VisualSFM_example.nvm") else {
        return;
    };
    assert_eq!((scene.photos.len(), scene.points.len()), (11, 7817));
    // Its photographs are not there, so their size is told here.
    for photo in &mut scene.photos {
        (photo.camera.width, photo.camera.height) = (2832, 2128);
        photo.camera.principal = [1416.0, 1064.0];
    }
    let errors = errors(&scene);
    println!(
        "{} views, {:.3} px median",
        errors.len(),
        errors[errors.len() / 2]
    );
    assert!(errors.len() > 30_000 && errors[errors.len() / 2] < 0.8);
    // With the distortion on the other side it is worse by far.
    for photo in &mut scene.photos {
        let k = photo.camera.lens.coefficients[0];
        photo.camera.lens =
            surfel::photos::lens::CameraLens::new(surfel::photos::lens::LensModel::Brown, &[k]);
    }
    let wrong = self::errors(&scene);
    assert!(wrong[wrong.len() / 2] > 5.0 * errors[errors.len() / 2]);
}
