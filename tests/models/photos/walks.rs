//! A walk along generated photographs: what changes by view pops no more than a fixed texture, and the measure sees what pops.

use glam::{DMat3, DVec2, DVec3, Vec3};
use std::path::Path;
use surfel::mesh::Mesh;
use surfel::photos::look::LookSettings;
use surfel::photos::scene::{CalibratedCamera, PhotoScene, SceneFormat, ScenePhoto};
use surfel::photos::stage::PhotoStage;
use surfel::photos::surface::SurfaceDrawer;
use surfel::photos::walk::{PhotoWalk, WalkFigures, walk_cameras};
use surfel::progress::SilentProgress;
use surfel::projective::lens::CameraLens;
use surfel::render::engine::Backend;
use surfel::tree::{BuildOptions, Model};

/// A wall of 16 x 4 in z = 0, of cells small enough that exposures are compared at their corners.
fn wall() -> Model {
    let mut mesh = Mesh::default();
    for j in 0..=16_u32 {
        for i in 0..=64_u32 {
            let (x, y) = (0.25 * i as f32 - 8.0, 0.25 * j as f32 - 2.0);
            mesh.positions.push(Vec3::new(x, y, 0.0));
        }
    }
    for j in 0..16_u32 {
        for i in 0..64_u32 {
            let [a, b] = [65 * j + i, 65 * j + i + 1];
            let [c, d] = [b + 65, a + 65];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    surfel::tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// Ten cameras along the wall, which see a part of it each, with photographs of other exposures.
fn scene(folder: &Path) -> PhotoScene {
    let photos = (0..10_u32).map(|index| {
        let camera = CalibratedCamera {
            width: 120,
            height: 90,
            focal: [90.0; 2],
            principal: [60.0, 45.0],
            lens: CameraLens::default(),
            rotation: DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)),
            center: DVec3::new(
                1.2 * f64::from(index) - 5.4,
                0.1 * f64::from(index % 2),
                4.0,
            ),
        };
        let exposure = [1.0, 0.9, 1.1, 0.95][index as usize % 4];
        let name = format!("{index}.png");
        let file = folder.join(&name);
        let picture = image::RgbImage::from_fn(120, 90, |x, y| {
            let ray = camera
                .direction(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5))
                .unwrap();
            let at = camera.center - ray * (camera.center.z / ray.z);
            let wave = |v: f64| exposure * (110.0 + 60.0 * v.sin());
            image::Rgb([wave(2.7 * at.x), wave(3.1 * at.y), wave(at.x + at.y)].map(|v| v as u8))
        });
        picture.save(&file).unwrap();
        ScenePhoto {
            name,
            file: Some(file),
            mask: None,
            camera,
        }
    });
    PhotoScene {
        format: SceneFormat::Nerfstudio,
        path: folder.to_owned(),
        photos: photos.collect(),
        points: Vec::new(),
        remarks: Vec::new(),
    }
}

#[test]
fn photographs_change_on_the_way_without_a_pop() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, model) = (scene(folder.path()), wall());
    let drawer = SurfaceDrawer::new(&Backend::Cpu, &model);
    // Fewer than there are, so that the choice changes on the way.
    let (mut stage, remarks) = PhotoStage::load(&scene, &drawer, 4, 4096, &SilentProgress).unwrap();
    assert!(remarks.is_empty(), "{remarks:?}");
    let mut walk = PhotoWalk {
        scene: &scene,
        model: &model,
        stage: &mut stage,
        backend: &Backend::Cpu,
        longest_side: 4096,
        settings: LookSettings::default(),
    };
    let cameras = walk_cameras(&walk.poses(), 120, 100);
    let steps = walk.measure(&cameras, &SilentProgress).unwrap();
    let exchanged: usize = steps.iter().map(|step| step.exchanged).sum();
    let found = WalkFigures::of(&steps);
    println!("{found:?}, {exchanged} exchanged");
    assert_eq!(steps.len(), 119);
    assert!(exchanged >= 8, "{exchanged}");
    assert!(found.largest_fixed > 0.01, "{found:?}");
    // With parts by the angle, not by its square, 1.46.
    assert!(found.ratio <= 1.3, "{found:?}");
    // The best photograph alone, as it is exposed, pops.
    walk.settings = LookSettings {
        blend: 1,
        consensus: false,
        gains: false,
        ..LookSettings::default()
    };
    let popping = WalkFigures::of(&walk.measure(&cameras, &SilentProgress).unwrap());
    assert!(
        popping.ratio > 1.5 && popping.ratio > 1.5 * found.ratio,
        "{popping:?}"
    );
}
