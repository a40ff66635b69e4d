//! Photographs on the surface: what a device draws is what the processor draws of the same depths and normals, and a
//! photograph's own pose gives the photograph.

use crate::common::Device;
use crate::common::models::real_file;
use glam::{DMat3, DVec3, Vec3};
use std::path::Path as FilePath;
use std::sync::Arc;
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::mesh::Mesh;
use surfel::patches::{ErrorTolerances, PatchRules};
use surfel::photos::formats::read_scene;
use surfel::photos::look::{LookSettings, look_at_pixel};
use surfel::photos::scene::{CalibratedCamera, PhotoScene, SceneFormat, ScenePhoto};
use surfel::photos::stage::PhotoStage;
use surfel::photos::surface::{SurfaceDrawer, renderer_camera};
use surfel::progress::SilentProgress;
use surfel::projective::frame_photos::{ComparedPhoto, FramePhotos, UNCOVERED, photo_tint};
use surfel::projective::lens::{CameraLens, LensModel};
use surfel::projective::surface_rays::SurfaceRays;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Culling, Method, Path, PhotoDisplay, PictureOutputs, Settings, SplatKind};
use surfel::tree::{BuildOptions, Model};

/// Size of the generated photographs, and of pictures from their poses.
const SIZE: (u32, u32) = (160, 120);

/// Everything that a comparison needs.
const OUTPUTS: PictureOutputs = PictureOutputs {
    depth: true,
    normal: true,
    values: true,
};

fn photographed(method: Method) -> Settings {
    Settings {
        method,
        culling: Culling::Off,
        background: [0.1, 0.2, 0.3],
        photos: PhotoDisplay::Color,
        ..Settings::default()
    }
}

/// A wall of 8 x 6 in z = 0 and a smaller one of 2 x 2 before it, in cells, so that there are splats too.
fn walls() -> Model {
    let mut mesh = Mesh::default();
    for (width, height, z, cells) in [(8.0_f32, 6.0_f32, 0.0_f32, 40_u32), (2.0, 2.0, 1.5, 20)] {
        let first = mesh.positions.len() as u32;
        for j in 0..=cells {
            for i in 0..=cells {
                let at = |k: u32, side: f32| (k as f32 / cells as f32 - 0.5) * side;
                mesh.positions
                    .push(Vec3::new(at(i, width), at(j, height), z));
            }
        }
        let index = |i: u32, j: u32| first + j * (cells + 1) + i;
        for j in 0..cells {
            for i in 0..cells {
                let [a, b] = [index(i, j), index(i + 1, j)];
                let [c, d] = [index(i + 1, j + 1), index(i, j + 1)];
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    surfel::tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// What the walls look like: smooth over a few pixels, different for both.
fn paint(at: DVec3) -> [u8; 3] {
    let wave = |v: f64| 127.5 + 90.0 * v.sin();
    match at.z > 0.5 {
        true => [wave(3.0 * at.x), wave(2.0 * at.y), 230.0],
        false => [wave(1.7 * at.x), 40.0, wave(2.3 * at.y)],
    }
    .map(|v| v as u8)
}

/// Cameras on an arc before the walls; the second has a lens, the third is turned about its axis, the last sees one side only.
fn cameras() -> Vec<CalibratedCamera> {
    let down = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let camera = |angle: f64, roll: f64, lens: CameraLens| {
        let center = 9.0 * DVec3::new(angle.sin(), 0.1, angle.cos());
        let rotation = DMat3::from_rotation_z(roll) * down * DMat3::from_rotation_y(-angle);
        CalibratedCamera {
            width: SIZE.0,
            height: SIZE.1,
            focal: [150.0, 152.0],
            principal: [81.0, 58.5],
            lens,
            rotation,
            center,
        }
    };
    let brown = CameraLens::new(LensModel::Brown, &[-0.05, 0.01, 1e-3, 2e-3]);
    let fisheye = CameraLens::new(LensModel::Fisheye, &[0.01, 0.002]);
    let none = CameraLens::default();
    vec![
        camera(0.0, 0.0, none),
        camera(0.35, 0.0, brown),
        camera(-0.3, 0.5, none),
        camera(-0.7, 0.0, fisheye),
        camera(1.1, 0.0, none),
    ]
}

/// Closed-form photographs of the walls in files of a folder; the third has a mask that hides its left third.
fn painted_scene(folder: &FilePath) -> PhotoScene {
    let color = |camera: &CalibratedCamera, x: f64, y: f64| {
        let Some(ray) = camera.direction(glam::DVec2::new(x, y)) else {
            return [0; 3];
        };
        let meets = |z: f64, half: [f64; 2]| {
            let at = camera.center + ray * ((z - camera.center.z) / ray.z);
            (at.x.abs() <= half[0] && at.y.abs() <= half[1]).then_some(at)
        };
        let at = meets(1.5, [1.0, 1.0]).or_else(|| meets(0.0, [4.0, 3.0]));
        at.map_or([0; 3], paint)
    };
    let photos = cameras().into_iter().enumerate().map(|(index, camera)| {
        let name = format!("{index}.png");
        let file = folder.join(&name);
        let picture = image::RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            image::Rgb(color(&camera, f64::from(x) + 0.5, f64::from(y) + 0.5))
        });
        picture.save(&file).unwrap();
        let mask = (index == 2).then(|| {
            let file = folder.join("mask.png");
            let kept = |x: u32| if x < SIZE.0 / 3 { 0 } else { 255 };
            let picture = image::RgbImage::from_fn(SIZE.0, SIZE.1, |x, _| image::Rgb([kept(x); 3]));
            picture.save(&file).unwrap();
            file
        });
        ScenePhoto {
            name,
            file: Some(file),
            mask,
            camera,
        }
    });
    PhotoScene {
        format: SceneFormat::Bundler,
        path: folder.to_owned(),
        photos: photos.collect(),
        points: Vec::new(),
        remarks: Vec::new(),
    }
}

/// A scene on a model, decoded at most so large.
fn staged(scene: &PhotoScene, model: &Model, longest_side: u32) -> PhotoStage {
    let drawer = SurfaceDrawer::new(&Backend::Cpu, model);
    let (mut stage, remarks) =
        PhotoStage::load(scene, &drawer, 16, longest_side, &SilentProgress).unwrap();
    assert!(remarks.is_empty(), "{remarks:?}");
    let camera = renderer_camera(&scene.photos[0].camera.pinhole(), model).unwrap();
    let view = camera.view(model.origin).unwrap();
    let all = stage.frame(&view, &LookSettings::default(), &|_| true, &[]);
    assert!(stage.load_whole(scene, &all, longest_side).is_empty());
    stage
}

fn pose(camera: &CalibratedCamera, model: &Model) -> View {
    let camera = renderer_camera(&camera.pinhole(), model).unwrap();
    camera.view(model.origin).unwrap()
}

/// Draws a picture with photographs and, of the same depths and normals, what the processor makes of one without.
fn drawn_and_wanted(
    device: &Device,
    (model, view): (&Model, &View),
    settings: &Settings,
    photos: &FramePhotos,
) -> (Image, Vec<[f32; 4]>) {
    let backend = Backend::Vulkan(device.gpu().clone());
    let outputs = PictureOutputs {
        normal: !settings.draws_filtered(),
        ..OUTPUTS
    };
    let mut engine = Engine::new(&backend, model, (view.width, view.height), outputs).unwrap();
    engine.set_photos(Some(Arc::new(photos.clone()))).unwrap();
    let drawn = engine.render(view, settings).unwrap();
    let plain = Settings {
        photos: PhotoDisplay::Off,
        ..*settings
    };
    let base = engine.render(view, &plain).unwrap();
    let rays = SurfaceRays::of(view);
    let look_view = rays.look_view(photos.direction);
    let looks = photos.look();
    let (width, height) = (view.width, view.height);
    let depth_at = |column: i64, row: i64| {
        let is_in = column >= 0 && row >= 0 && column < i64::from(width) && row < i64::from(height);
        match is_in {
            true => base.depth[(row * i64::from(width) + column) as usize],
            false => f32::INFINITY,
        }
    };
    let wanted = (0..base.values.len()).map(|index| {
        let own = base.values[index];
        let pixel = [index as u32 % width, index as u32 / width];
        let depth = base.depth[index];
        if !depth.is_finite() || own[3] <= 0.0 {
            return own;
        }
        let normal = match base.normal.get(index) {
            Some(normal) => Vec3::from(*normal),
            None => {
                let [x, y] = pixel.map(i64::from);
                let around =
                    [(-1, 0), (1, 0), (0, -1), (0, 1)].map(|(i, j)| depth_at(x + i, y + j));
                rays.normal_of_depths(pixel, depth, around)
            }
        };
        let surface = rays.pixel(pixel, depth, normal);
        let found = look_at_pixel(&surface, &look_view, &looks, &photos.settings);
        let color = match (found.weight > 0.0, settings.photos) {
            (true, PhotoDisplay::Source) => photo_tint(looks[found.best as usize].photo.index),
            (true, _) => found.color,
            (false, _) if settings.marks_uncovered => UNCOVERED,
            (false, _) => return own,
        };
        let [r, g, b] =
            [0, 1, 2].map(|c| settings.background[c] * (1.0 - own[3]) + color[c] * own[3]);
        [r, g, b, own[3]]
    });
    let wanted = wanted.collect();
    (drawn, wanted)
}

/// Holds a picture to what is wanted. A device rounds otherwise than the processor, and keeps depths of maps to 2^-16 and
/// distances from edges to a 255th: that moves colors by less than a level, but for single pixels where a comparison falls
/// out otherwise (the test of a depth, the border of a photograph): at most one in 300.
fn hold_to(drawn: &Image, wanted: &[[f32; 4]], what: &str) {
    let mut far = 0;
    let mut sum = 0.0;
    for (own, wanted) in drawn.values.iter().zip(wanted) {
        let apart = (0..4)
            .map(|c| (own[c] - wanted[c]).abs())
            .fold(0.0, f32::max);
        far += usize::from(apart > 1.0 / 255.0);
        sum += f64::from(apart);
    }
    let mean = 255.0 * sum / wanted.len() as f64;
    println!(
        "{what}: {far} of {} pixels differ, {mean:.4} levels in the mean",
        wanted.len()
    );
    assert!(
        300 * far <= wanted.len(),
        "{what}: {far} pixels differ by more than a level"
    );
    assert!(mean < 0.2, "{what}: {mean} levels in the mean");
}

#[test]
fn a_device_draws_what_the_processor_does() {
    let Some(device) = Device::open() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (model, scene) = (walls(), painted_scene(folder.path()));
    let stage = staged(&scene, &model, 4096);
    // Between the poses, a little farther away.
    let mut camera = cameras()[0].scaled(200, 150);
    camera.center += DVec3::new(0.8, 0.3, 1.0);
    let view = pose(&camera, &model);
    let photos = stage.frame(&view, &LookSettings::default(), &|_| true, &[]);
    assert_eq!(photos.photos.len(), 5);
    let triangles = photographed(Method::Triangles);
    let of_splat = |splat: SplatKind| Settings {
        splat,
        threshold_px: 4.0,
        ..photographed(Method::Pop)
    };
    for (what, settings) in [
        ("triangles", triangles),
        (
            "which",
            Settings {
                photos: PhotoDisplay::Source,
                ..triangles
            },
        ),
        (
            "marked",
            Settings {
                marks_uncovered: true,
                ..triangles
            },
        ),
        ("squares", of_splat(SplatKind::Square)),
        ("ellipses", of_splat(SplatKind::Ellipse)),
        ("gauss", of_splat(SplatKind::Gauss)),
        ("filtered", of_splat(SplatKind::Filtered)),
    ] {
        let (drawn, wanted) = drawn_and_wanted(&device, (&model, &view), &settings, &photos);
        hold_to(&drawn, &wanted, what);
    }
    // What weights depend on: one photograph, and Princ's forms with a second stage.
    let mut one = photos.clone();
    one.photos.truncate(1);
    let (drawn, wanted) = drawn_and_wanted(&device, (&model, &view), &triangles, &one);
    hold_to(&drawn, &wanted, "one photograph");
    use surfel::photos::look::{PhotoDirection, WeightForm};
    for (form, direction) in [
        (WeightForm::Mended, PhotoDirection::Hull),
        (WeightForm::Printed, PhotoDirection::Axis),
    ] {
        let mut princ = photos.clone();
        (princ.settings.form, princ.settings.direction) = (form, direction);
        princ.settings.limit_cos = 70_f32.to_radians().cos();
        for (index, own) in princ.photos.iter_mut().enumerate() {
            own.photo.stage = u32::from(index > 1);
        }
        let (drawn, wanted) = drawn_and_wanted(&device, (&model, &view), &triangles, &princ);
        hold_to(&drawn, &wanted, &format!("{form:?}"));
    }
}

#[test]
fn every_backend_draws_photographs_and_none_draws_them_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let (model, scene) = (walls(), painted_scene(folder.path()));
    let stage = staged(&scene, &model, 4096);
    let view = pose(&cameras()[1], &model);
    let photos = Arc::new(stage.frame(&view, &LookSettings::default(), &|_| true, &[]));
    let settings = photographed(Method::Triangles);
    let mut pictures = Vec::new();
    let device = Device::open();
    let vulkan = device
        .as_ref()
        .map(|device| Backend::Vulkan(device.gpu().clone()));
    for backend in [Some(Backend::Cpu), Some(Backend::Reference), vulkan]
        .into_iter()
        .flatten()
    {
        let mut engine = Engine::new(&backend, &model, SIZE, PictureOutputs::default()).unwrap();
        let error = engine.render(&view, &settings).unwrap_err().to_string();
        assert!(error.contains("none are given"), "{error}");
        engine.set_photos(Some(photos.clone())).unwrap();
        let picture = engine.render(&view, &settings).unwrap();
        assert!(picture.normal.is_empty() && picture.depth.is_empty());
        let plain = Settings {
            photos: PhotoDisplay::Off,
            ..settings
        };
        assert_ne!(engine.render(&view, &plain).unwrap().color, picture.color);
        let data = Settings {
            color_by: surfel::pack::ColorBy::Depth,
            ..settings
        };
        let error = engine.render(&view, &data).unwrap_err().to_string();
        assert!(
            error.contains("photographs") && error.contains("--color-by"),
            "{error}"
        );
        pictures.push(picture);
    }
    // Pixels on outlines may be of the other wall.
    for other in &pictures[1..] {
        let differs = |(a, b): (&[u8; 4], &[u8; 4])| (0..3).any(|c| a[c].abs_diff(b[c]) > 2);
        let far = pictures[0]
            .color
            .iter()
            .zip(&other.color)
            .filter(|pair| differs(*pair))
            .count();
        assert!(100 * far <= other.color.len(), "{far} pixels differ");
    }
}

/// Pixels that are covered, and those of them that differ from the photograph by more than a level.
fn apart_from_photo(
    drawn: &Image,
    photo: &surfel::photos::pyramid::PhotoPixels,
    source: &Image,
    own: u32,
) -> [usize; 2] {
    let tint = photo_tint(own).map(|v| (255.0 * v + 0.5) as u8);
    let mut found = [0; 2];
    for ((color, wanted), shown) in drawn.color.iter().zip(&photo.rgb).zip(&source.color) {
        if (0..3).all(|c| shown[c].abs_diff(tint[c]) <= 1) {
            found[0] += 1;
            found[1] += usize::from((0..3).any(|c| color[c].abs_diff(wanted[c]) > 1));
        }
    }
    found
}

/// Draws from the pose of a photograph with those given, and counts where the picture is that photograph.
fn own_pose(
    device: &Device,
    model: &Model,
    view: &View,
    photos: FramePhotos,
    own: u32,
) -> [usize; 2] {
    let of_own = photos
        .photos
        .iter()
        .find(|of| of.photo.index == own)
        .unwrap();
    let pixels = of_own.pixels.levels[0].clone();
    let backend = Backend::Vulkan(device.gpu().clone());
    let size = (view.width, view.height);
    let mut engine = Engine::new(&backend, model, size, PictureOutputs::default()).unwrap();
    engine.set_photos(Some(Arc::new(photos))).unwrap();
    let settings = photographed(Method::Triangles);
    let drawn = engine.render(view, &settings).unwrap();
    let which = Settings {
        photos: PhotoDisplay::Source,
        ..settings
    };
    let source = engine.render(view, &which).unwrap();
    apart_from_photo(&drawn, &pixels, &source, own)
}

#[test]
fn a_photograph_is_its_own_pose() {
    let Some(device) = Device::open() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (model, scene) = (walls(), painted_scene(folder.path()));
    let stage = staged(&scene, &model, 4096);
    let camera = scene.photos[0].camera;
    let view = pose(&camera, &model);
    let settings = LookSettings {
        gains: false,
        ..LookSettings::default()
    };
    let one = stage.frame(&view, &settings, &|index| index == 0, &[]);
    let [covered, far] = own_pose(&device, &model, &view, one, 0);
    // The wall, 8 wide at a distance of 9: 133 columns, of rows from 23 to the lower border.
    assert!(covered.abs_diff(133 * 97) <= 133 + 97, "{covered}");
    assert_eq!(far, 0, "of {covered}");
    let all = stage.frame(&view, &settings, &|_| true, &[]);
    let [covered, far] = own_pose(&device, &model, &view, all, 0);
    assert!(
        covered > 12_000 && 50 * far <= covered,
        "{far} of {covered}"
    );
}

#[test]
fn the_castle_on_a_device_is_the_castle_on_the_processor() {
    let (Some(device), Some(path)) = (Device::open(), real_file("photos/sceaux/scene.mvs")) else {
        return;
    };
    let mut scene = read_scene(&path, None).unwrap();
    scene.photos.retain(|photo| photo.file.is_some());
    let mesh = real_file("photos/sceaux/scene_mesh.ply").unwrap();
    let model = surfel::open(mesh, &Default::default(), &SilentProgress)
        .unwrap()
        .model;
    let stage = staged(&scene, &model, 708);
    // 2832 x 2128, at a quarter.
    let camera = scene.photos[4].camera.scaled(708, 532);
    let view = pose(&camera, &model);
    let settings = LookSettings {
        gains: false,
        ..LookSettings::default()
    };
    let one = stage.frame(&view, &settings, &|index| index == 4, &[]);
    let [covered, far] = own_pose(&device, &model, &view, one, 4);
    assert!(covered > 100_000, "{covered}");
    assert_eq!(far, 0, "of {covered}");
    let mut aside = camera.scaled(354, 266);
    aside.center += DVec3::new(0.3, 0.1, 0.0);
    let view = pose(&aside, &model);
    let photos = stage.frame(&view, &LookSettings::default(), &|_| true, &[]);
    let (drawn, wanted) = drawn_and_wanted(
        &device,
        (&model, &view),
        &photographed(Method::Triangles),
        &photos,
    );
    hold_to(&drawn, &wanted, "castle");
}

#[test]
fn a_photograph_laid_over_the_picture_is_as_it_is() {
    let Some(device) = Device::open() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (model, scene) = (walls(), painted_scene(folder.path()));
    let stage = staged(&scene, &model, 4096);
    let view = pose(&scene.photos[0].camera, &model);
    let mut photos = stage.frame(&view, &LookSettings::default(), &|_| true, &[]);
    photos.compared = Some(ComparedPhoto {
        list_index: 0,
        part: 0.5,
    });
    let pixels = photos.photos[0].pixels.levels[0].clone();
    let photos = Arc::new(photos);
    for backend in [Backend::Vulkan(device.gpu().clone()), Backend::Cpu] {
        let mut engine = Engine::new(&backend, &model, SIZE, PictureOutputs::default()).unwrap();
        engine.set_photos(Some(photos.clone())).unwrap();
        let drawn = engine
            .render(&view, &photographed(Method::Triangles))
            .unwrap();
        for (index, (color, wanted)) in drawn.color.iter().zip(&pixels.rgb).enumerate() {
            let is_over = (index as u32 % SIZE.0) < SIZE.0 / 2;
            let apart = (0..3).map(|c| color[c].abs_diff(wanted[c])).max().unwrap();
            assert!(!is_over || apart <= 1, "pixel {index}: {apart}");
        }
    }
}

#[test]
fn the_choice_is_the_same_with_any_threads_and_stays_while_it_is_nearly_as_good() {
    let folder = tempfile::tempdir().unwrap();
    let (model, scene) = (walls(), painted_scene(folder.path()));
    let mut stage = staged(&scene, &model, 4096);
    stage.most = 2;
    let settings = LookSettings::default();
    let chosen = |view: &View, last: &[usize]| -> Vec<usize> {
        let frame = stage.frame(view, &settings, &|_| true, last);
        frame
            .photos
            .iter()
            .map(|own| own.photo.index as usize)
            .collect()
    };
    for (index, camera) in cameras().iter().enumerate() {
        let own = chosen(&pose(camera, &model), &[]);
        // Only what adds something is chosen.
        assert!(own.len() <= 2 && own.contains(&index), "{index}: {own:?}");
    }
    // Along the arc the choice goes over once and does not come back; the one of the last frame goes over no sooner.
    let (mut last, mut fresh_changes, mut changes) = (Vec::new(), 0, 0);
    let mut before: Option<Vec<usize>> = None;
    for step in 0..=40 {
        let angle = 0.35 - 0.65 * f64::from(step) / 40.0;
        let mut camera = cameras()[0];
        camera.center = 9.0 * DVec3::new(angle.sin(), 0.1, angle.cos());
        camera.rotation *= DMat3::from_rotation_y(-angle);
        let view = pose(&camera, &model);
        let fresh = chosen(&view, &[]);
        assert_eq!(fresh, chosen(&view, &[]));
        if step % 8 == 0 {
            for threads in [1, 2, 5] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
                let own = pool.build().unwrap().install(|| chosen(&view, &[]));
                assert_eq!(fresh, own, "{threads} threads");
            }
        }
        let own = chosen(&view, &last);
        changes += usize::from(step > 0 && own != last);
        fresh_changes += usize::from(before.is_some_and(|before| before != fresh));
        (last, before) = (own, Some(fresh));
    }
    assert!(
        changes > 0 && changes <= fresh_changes,
        "{changes} {fresh_changes}"
    );
    // What is not allowed is not chosen.
    let view = pose(&cameras()[0], &model);
    let others = stage.frame(&view, &settings, &|index| index > 2, &[]);
    assert!(others.photos.iter().all(|own| own.photo.index > 2));
}

#[test]
fn a_loader_brings_thumbnails_first_and_forgets_what_is_wanted_no_more() {
    use surfel::photos::photo_loader::{PhotoArrival, PhotoLoader, PhotoRequest};
    let folder = tempfile::tempdir().unwrap();
    let scene = painted_scene(folder.path());
    // A scene file that a reader knows: Bundler, whose cameras look along -z with y up.
    let mut text = format!("# Bundle file v0.3\n{} 0\n", scene.photos.len());
    for photo in &scene.photos {
        let camera = &photo.camera;
        let turn = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)) * camera.rotation;
        let shift = -(turn * camera.center);
        text += &format!("{} 0 0\n", camera.focal[0]);
        for row in [turn.row(0), turn.row(1), turn.row(2), shift] {
            text += &format!("{} {} {}\n", row.x, row.y, row.z);
        }
    }
    let file = folder.path().join("bundle.out");
    std::fs::write(&file, text).unwrap();
    let names: Vec<&str> = scene
        .photos
        .iter()
        .map(|photo| photo.name.as_str())
        .collect();
    std::fs::write(folder.path().join("list.txt"), names.join("\n")).unwrap();
    std::fs::write(folder.path().join("3.png"), b"no picture").unwrap();
    let request = |path: &FilePath| PhotoRequest {
        path: path.to_owned(),
        folder: None,
        model: Arc::new(walls()),
        longest_side: 4096,
        eye: Some(cameras()[4].center),
    };
    let mut loader = PhotoLoader::start(request(&file)).unwrap();
    let (mut ready, mut unusable) = (Vec::new(), Vec::new());
    loop {
        match loader.poll(true).unwrap() {
            PhotoArrival::Scene(found, model) => {
                assert!(found.photos.len() >= 4 && !model.samples.is_empty());
            }
            PhotoArrival::Ready(index, photo) => {
                assert!(!photo.is_whole && photo.pixels.size() == [SIZE.0 / 8, SIZE.1 / 8]);
                ready.push(index);
            }
            PhotoArrival::Unusable(index, sentence) => {
                assert!(sentence.contains("3.png"), "{sentence}");
                unusable.push(index);
            }
            PhotoArrival::AllReady(gains) => {
                assert!(
                    gains.iter().all(|(index, _)| ready.contains(index))
                        && gains.len() == ready.len()
                );
                break;
            }
            other => panic!("{other:?}"),
        }
    }
    assert!(ready.len() >= 4, "{ready:?} {unusable:?}");
    // The last list counts; whoever decodes already may finish one more each.
    loader.want(vec![0; 50]);
    loader.want([1]);
    let mut whole = Vec::new();
    while whole.last() != Some(&1) {
        match loader.poll(true).unwrap() {
            PhotoArrival::Whole(index, pixels) => {
                assert_eq!(pixels.size(), [SIZE.0, SIZE.1]);
                whole.push(index);
            }
            other => panic!("{other:?}"),
        }
    }
    assert!(whole.len() < 50, "{} were decoded for nothing", whole.len());
    // Nothing there: one sentence.
    let mut nothing = PhotoLoader::start(request(&folder.path().join("none"))).unwrap();
    assert!(
        matches!(nothing.poll(true), Some(PhotoArrival::Failed(text)) if text.contains("none"))
    );
}

#[test]
fn a_renderer_that_keeps_lists_switches_photographs_on_and_off() {
    let Some(device) = Device::open() else { return };
    let folder = tempfile::tempdir().unwrap();
    let (model, scene) = (walls(), painted_scene(folder.path()));
    let stage = staged(&scene, &model, 4096);
    let view = pose(&cameras()[0], &model);
    let photos = Arc::new(stage.frame(&view, &LookSettings::default(), &|_| true, &[]));
    let backend = Backend::Vulkan(device.gpu().clone());
    let engine = || {
        let mut engine = Engine::new(&backend, &model, SIZE, PictureOutputs::default()).unwrap();
        engine.set_photos(Some(photos.clone())).unwrap();
        engine
    };
    let mut kept = engine();
    kept.keep_lists(true);
    // Patches are drawn by a pipeline of their own, which knows the targets of a frame.
    let patches = PatchRules {
        tolerances: ErrorTolerances {
            rim_px: 0.25,
            inside_px: 0.5,
            shade_levels: 24.0,
        },
        covers_rims: true,
        ..PatchRules::default()
    };
    let looks = [
        photographed(Method::Pop),
        photographed(Method::Triangles),
        Settings {
            patches: Some(patches),
            path: Path::Raster,
            ..photographed(Method::Pop)
        },
    ];
    for on in looks {
        let off = Settings {
            photos: PhotoDisplay::Off,
            ..on
        };
        let which = Settings {
            photos: PhotoDisplay::Source,
            marks_uncovered: true,
            ..on
        };
        for settings in [off, on, on, which, off, off, on] {
            let fresh = engine().render(&view, &settings).unwrap();
            let own = kept.render(&view, &settings).unwrap();
            assert!(own.color == fresh.color, "{:?}", settings);
        }
    }
}
