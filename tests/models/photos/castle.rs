//! The castle: a photograph predicted from the others, and bad input.

use crate::common_models::real_file;
use surfel::photos::error::PhotoError;
use surfel::photos::formats::read_scene;
use surfel::photos::scene::PhotoScene;
use surfel::photos::score::{PhotoJudge, ladder};
use surfel::photos::session::{PhotoSession, SessionOptions};
use surfel::photos::surface::{SurfaceDrawer, calibrated_camera, renderer_camera};
use surfel::progress::SilentProgress;
use surfel::render::engine::Backend;
use surfel::tree::Model;

fn castle() -> Option<(PhotoScene, Model)> {
    let scene = read_scene(&real_file("photos/sceaux/scene.mvs")?, None).unwrap();
    let mesh = real_file("photos/sceaux/scene_mesh.ply")?;
    let model = surfel::open(mesh, &Default::default(), &SilentProgress)
        .unwrap()
        .model;
    Some((scene, model))
}

fn session<'m>(scene: &'m PhotoScene, model: &'m Model) -> Result<PhotoSession<'m>, PhotoError> {
    let options = SessionOptions {
        longest_side: 800,
        ..SessionOptions::default()
    };
    PhotoSession::new(
        scene,
        SurfaceDrawer::new(&Backend::Cpu, model),
        options,
        &SilentProgress,
    )
}

#[test]
fn a_photograph_of_the_castle_is_predicted_from_the_others() {
    let Some((scene, model)) = castle() else {
        return;
    };
    let mut session = session(&scene, &model).unwrap();
    assert_eq!(session.usable().len(), 10);
    let mut judge = PhotoJudge {
        session: &mut session,
        rungs: ladder(),
        longest_side: 320,
    };
    let (score, pictures) = judge.score(6).unwrap();
    for (rung, of) in ladder().iter().zip(&score.rungs) {
        println!("{:<9} {:?}", rung.name, of.seen);
    }
    let of = |name: &str| {
        let index = ladder().iter().position(|rung| rung.name == name).unwrap();
        score.rungs[index].seen
    };
    // Each of these has what the one before it has and one thing more.
    let order = ["hull", "visible", "best", "gains", "blend"].map(of);
    for pair in order.windows(2) {
        assert!(pair[1].psnr_db > pair[0].psnr_db, "{pair:?}");
    }
    let others = ladder().into_iter().filter(|rung| rung.name != "blend");
    for rung in others {
        let other = of(rung.name).one_minus_ncc;
        assert!(of("blend").one_minus_ncc < other, "{}: {other}", rung.name);
    }
    assert!(of("blend").psnr_db > of("vertices").psnr_db + 1.0);
    // A texture, baked as large as one likes, is the same from everywhere.
    for texture in ["atlas", "mean"] {
        assert!(of("blend").psnr_db > of(texture).psnr_db + 1.0, "{texture}");
    }
    assert!(score.seen_pixels > score.mesh_pixels * 9 / 10);
    // The conventions: half a pixel costs more than two decibels.
    println!(
        "self {:.2}, shifted {:.2}",
        score.self_psnr_db, score.shifted_self_psnr_db
    );
    assert!(score.self_psnr_db > 30.0);
    assert!(score.shifted_self_psnr_db < score.self_psnr_db - 2.0);
    assert_eq!(pictures.rungs.len(), score.rungs.len());
}

#[test]
fn cameras_survive_the_way_to_the_renderer_and_back() {
    let Some((scene, model)) = castle() else {
        return;
    };
    for photo in &scene.photos {
        let there = renderer_camera(&photo.camera, &model).unwrap();
        let back = calibrated_camera(&there).unwrap();
        for point in scene.points.iter().step_by(500) {
            let [a, b] = [photo.camera, back].map(|camera| camera.project(point.position));
            assert!(a.unwrap().distance(b.unwrap()) < 1e-6);
        }
    }
}

#[test]
fn a_mesh_elsewhere_and_photographs_that_are_not_there_are_one_sentence_each() {
    let Some((mut scene, model)) = castle() else {
        return;
    };
    // Behind all cameras.
    let mut elsewhere = model.clone();
    let away = scene.photos[0].camera.axis() * -1000.0;
    elsewhere.origin += away;
    let message = session(&scene, &elsewhere).unwrap_err().to_string();
    assert!(message.contains("different frames"), "{message}");
    // One that is damaged is left out with a remark, and a camera in the surface draws.
    let folder = tempfile::tempdir().unwrap();
    let hurt = folder.path().join("hurt.jpg");
    std::fs::write(&hurt, b"\xff\xd8\xff\xe0 no photograph").unwrap();
    scene.photos[2].file = Some(hurt);
    scene.photos[3].camera.center = model.origin + model.orbit_center.as_dvec3();
    let session_with_damage = session(&scene, &model).unwrap();
    assert_eq!(session_with_damage.usable().len(), 9);
    assert!(session_with_damage.remarks[0].contains("hurt.jpg"));
    for photo in &mut scene.photos {
        photo.file = None;
    }
    let message = session(&scene, &model).unwrap_err().to_string();
    assert!(message.contains("no photograph is there"), "{message}");
}
