//! The check of conventions: high for the right one, a warning for planted wrong ones.

use crate::common_models::real_file;
use glam::{DMat3, DVec3};
use surfel::photos::check::{LEAST_CORRELATION, check_scene};
use surfel::photos::formats::read_scene;
use surfel::photos::scene::{CalibratedCamera, PhotoScene};

fn scenes() -> Vec<PhotoScene> {
    [
        "photos/sceaux/scene.mvs",
        "photos/sceaux/derived/bundle.out",
        "photos/kermit/bundle.out",
    ]
    .iter()
    .filter_map(|name| Some(read_scene(&real_file(name)?, None).unwrap()))
    .collect()
}

fn with(scene: &PhotoScene, change: impl Fn(&mut CalibratedCamera)) -> PhotoScene {
    let mut changed = scene.clone();
    changed
        .photos
        .iter_mut()
        .for_each(|photo| change(&mut photo.camera));
    changed
}

#[test]
fn right_conventions_correlate_and_wrong_ones_warn() {
    for scene in scenes() {
        let name = scene.path.display();
        let right = check_scene(&scene);
        println!(
            "{name}: {:?}, reprojection {:?}",
            right.correlation, right.reprojection_px
        );
        for photo in &right.photos {
            println!("  {:?}", photo);
        }
        assert!(right.correlation.unwrap() > 0.8, "{right:?}");
        assert!(
            !right.warnings.iter().any(|w| w.contains("wrong")),
            "{:?}",
            right.warnings
        );
        let flip = |x: f64, y: f64, z: f64| DMat3::from_diagonal(DVec3::new(x, y, z));
        let about_y = flip(-1.0, 1.0, -1.0);
        for (what, wrong) in [
            (
                "y up",
                with(&scene, |c| c.rotation = flip(-1.0, -1.0, 1.0) * c.rotation),
            ),
            (
                "mirrored",
                with(&scene, |c| c.rotation = flip(-1.0, 1.0, 1.0) * c.rotation),
            ),
            (
                "upside down",
                with(&scene, |c| c.rotation = flip(1.0, -1.0, 1.0) * c.rotation),
            ),
            (
                "backwards",
                with(&scene, |c| c.rotation = about_y * c.rotation),
            ),
            (
                "half the focal length",
                with(&scene, |c| c.focal = c.focal.map(|f| 0.5 * f)),
            ),
            (
                "camera to world",
                with(&scene, |c| c.rotation = c.rotation.transpose()),
            ),
        ] {
            let check = check_scene(&wrong);
            println!(
                "  {what}: {:?} {:?}",
                check.correlation,
                check.warnings.first()
            );
            let warned = check
                .warnings
                .iter()
                .any(|w| w.contains("conventions look wrong"));
            assert!(warned, "{name} {what}: {:?}", check.correlation);
            assert!(check.correlation.is_none_or(|r| r < LEAST_CORRELATION));
        }
        // Photographs in another order.
        let mut shifted = scene.clone();
        let files: Vec<_> = scene
            .photos
            .iter()
            .map(|photo| photo.file.clone())
            .collect();
        for (i, photo) in shifted.photos.iter_mut().enumerate() {
            photo.file = files[(i + 1) % files.len()].clone();
        }
        let check = check_scene(&shifted);
        println!("  shifted list: {:?}", check.correlation);
        assert!(
            check.warnings.iter().any(|w| w.contains("wrong")),
            "{check:?}"
        );
    }
}
