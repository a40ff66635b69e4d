//! Visibility splats: the device against the mirror, classes, reconstructions, and what they promise at silhouettes.

use crate::common::{Device, generated, orbit, pictures};
use glam::{DMat4, DVec3, Vec3};
use surfel::generate::{GeneratedShape, ShapeSpec};
use surfel::image::{Image, compare};
use surfel::math::camera::{Camera, View};
use surfel::mesh::Mesh;
use surfel::pack::ColorBy;
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Blend, Method, Path, Reconstruction, Settings, Shading, SplatKind};
use surfel::tree::{self, BuildOptions, Model};

const ALL: PictureOutputs = PictureOutputs {
    depth: true,
    normal: true,
    values: false,
};

const RECONSTRUCTIONS: [Reconstruction; 3] = [
    Reconstruction::Gaussian,
    Reconstruction::Density,
    Reconstruction::PullPush,
];

/// The colors of [`ColorBy::Classification`].
const FOREGROUND: [u8; 4] = [255; 4];
const HOLE: [u8; 4] = [128, 128, 128, 255];
const UNREACHED: [u8; 4] = [255, 0, 0, 255];

fn settings(method: Method, threshold_px: f32, reconstruction: Reconstruction) -> Settings {
    Settings {
        method,
        splat: SplatKind::Visibility,
        reconstruction,
        threshold_px,
        ..Settings::default()
    }
}

fn build(mesh: Mesh) -> Model {
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

fn engine<'m>(backend: &Backend, model: &'m Model, view: &View) -> Engine<'m> {
    Engine::new(backend, model, (view.width, view.height), ALL).unwrap()
}

fn draw(engine: &mut Engine, view: &View, settings: &Settings) -> Image {
    engine.render(view, settings).unwrap()
}

fn classes(engine: &mut Engine, view: &View, settings: &Settings) -> Image {
    let settings = Settings {
        color_by: ColorBy::Classification,
        ..*settings
    };
    draw(engine, view, &settings)
}

fn count(image: &Image, color: [u8; 4]) -> usize {
    image.color.iter().filter(|c| **c == color).count()
}

/// Compares device and mirror: classes, colors, depths and normals.
///
/// What is reconstructed from a pixel of another class may differ too, so pixels near it are not compared.
fn agree(device: &Device, model: &Model, view: &View, settings: &Settings, name: &str) {
    let backend = Backend::Device(device.gpu().clone());
    let one = |backend: &Backend| {
        let mut engine =
            engine(backend, model, view).with_subpixel_bits(device.gpu().info().subpixel_bits);
        (
            classes(&mut engine, view, settings),
            draw(&mut engine, view, settings),
        )
    };
    let ((class, mut picture), (mirror_class, mirror)) = (one(&backend), one(&Backend::Reference));
    pictures::REFERENCE_CLASSES.assert_same(&mirror_class, &class, name);
    let (width, height) = (mirror.width as usize, mirror.height as usize);
    let class_differs: Vec<usize> = (0..class.color.len())
        .filter(|&i| class.color[i] != mirror_class.color[i])
        .collect();
    // Far enough for every kernel at these thresholds; coarse levels of the pyramid reach farther, by little weight.
    let reach = 2 * settings.threshold_px.max(1.0).ceil() as usize + 4;
    let mut is_near_difference = vec![false; width * height];
    for &i in &class_differs {
        let (x, y) = (i % width, i / width);
        for row in y.saturating_sub(reach)..(y + reach + 1).min(height) {
            for column in x.saturating_sub(reach)..(x + reach + 1).min(width) {
                is_near_difference[row * width + column] = true;
            }
        }
    }
    for i in (0..width * height).filter(|&i| is_near_difference[i]) {
        picture.color[i] = mirror.color[i];
        picture.depth[i] = mirror.depth[i];
        picture.normal[i] = mirror.normal[i];
    }
    pictures::REFERENCE_RECONSTRUCTION.assert_same(&mirror, &picture, name);
    let compared = is_near_difference.iter().filter(|n| !**n).count();
    assert!(
        2 * compared > width * height,
        "{name}: too little left to compare"
    );
}

fn cloud(shape: GeneratedShape, triangles: u64) -> Model {
    let mut mesh = surfel::generate::mesh(&ShapeSpec::with_triangles(shape, triangles).unwrap());
    mesh.triangles.clear();
    mesh.colors = (mesh.positions.iter())
        .map(|p| {
            [
                (p.x * 100.0 + 128.0) as u8,
                90,
                (p.z * 100.0 + 128.0) as u8,
                255,
            ]
        })
        .collect();
    build(mesh)
}

#[test]
fn the_device_draws_what_the_mirror_draws() {
    let Some(device) = Device::open() else { return };
    let statue = generated(GeneratedShape::Statue, 60_000);
    let torus = generated(GeneratedShape::Torus, 40_000);
    let cloud = cloud(GeneratedShape::Sphere, 20_000);
    for reconstruction in RECONSTRUCTIONS {
        for (name, model, method, fill, threshold) in [
            ("statue", &statue, Method::Pop, 1.0, 1.0),
            ("statue", &statue, Method::Pop, 0.9, 4.5),
            ("statue, triangles too", &statue, Method::Pop, 4.0, 6.0),
            ("torus", &torus, Method::Pop, 1.0, 3.0),
            ("vertices", &statue, Method::Points, 1.0, 3.0),
            ("splats only", &statue, Method::Splats, 4.0, 3.0),
            ("cloud", &cloud, Method::Pop, 1.0, 2.0),
            ("cloud, near", &cloud, Method::Pop, 3.0, 2.0),
        ] {
            let view = orbit(model, (161, 140), 40.0, 25.0, fill);
            let settings = Settings {
                background: [0.2, 0.4, 0.6],
                ..settings(method, threshold, reconstruction)
            };
            for &path in device.paths() {
                // What has no cut has one path.
                if path == Path::Compute && method == Method::Points {
                    continue;
                }
                let settings = Settings { path, ..settings };
                let name = format!("{name} {threshold} {reconstruction:?} {path:?}");
                agree(&device, model, &view, &settings, &name);
            }
        }
    }
}

#[test]
fn orthographic_views_and_other_settings_agree_too() {
    let Some(device) = Device::open() else { return };
    let model = generated(GeneratedShape::Statue, 30_000);
    let mut camera = Camera::orbit((150, 170), DVec3::ZERO, 1.6, 0.7, 0.3, 1.0);
    let (near, far) = (1.0, 8.0);
    camera.proj = DMat4::from_cols_array(&[
        0.6,
        0.0,
        0.0,
        0.0,
        0.0,
        0.5,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0 / (near - far),
        0.0,
        0.1,
        -0.05,
        near / (near - far),
        1.0,
    ]);
    camera.view = DMat4::from_scale(DVec3::splat(0.8)) * camera.view;
    let view = camera.view(DVec3::ZERO).unwrap();
    for reconstruction in RECONSTRUCTIONS {
        for depth_offset in [0.0, 0.5, 4.0] {
            let settings = Settings {
                depth_offset: Some(depth_offset),
                two_sided: false,
                ..settings(Method::Pop, 3.0, reconstruction)
            };
            for &path in device.paths() {
                let settings = Settings { path, ..settings };
                let name =
                    format!("orthographic, offset {depth_offset} {reconstruction:?} {path:?}");
                agree(&device, &model, &view, &settings, &name);
            }
        }
    }
}

/// A camera on the z axis, fifty degrees wide, that looks at the origin.
fn axis_view(size: (u32, u32), distance: f64) -> View {
    Camera::look_at(
        size,
        DVec3::new(0.0, 0.0, distance),
        DVec3::ZERO,
        DVec3::Y,
        50f64.to_radians(),
        [0.1, 100.0],
    )
    .view(DVec3::ZERO)
    .unwrap()
}

/// Methods 15.12: one foreground pixel in a picture of holes gives every pixel its color.
#[test]
fn one_center_fills_a_picture_of_holes() {
    let mesh = Mesh {
        positions: vec![Vec3::ZERO],
        normals: vec![Vec3::Z],
        colors: vec![[250, 101, 7, 255]],
        ..Mesh::default()
    };
    let model = build(mesh);
    let device = Device::open();
    for size in [(37, 20), (64, 64), (1, 1), (1, 9), (50, 3)] {
        let view = axis_view(size, 3.0);
        for backend in backends(device.as_ref()) {
            let mut engine = engine(&backend, &model, &view);
            for method in [Method::Points, Method::Pop] {
                let settings = settings(method, 200.0, Reconstruction::PullPush);
                let class = classes(&mut engine, &view, &settings);
                assert_eq!(count(&class, FOREGROUND), 1);
                let all = (size.0 * size.1) as usize;
                assert_eq!(count(&class, HOLE), all - 1);
                let picture = draw(&mut engine, &view, &settings);
                // 0.8 times the color.
                let wanted = [200, 81, 6, 255];
                assert_eq!(count(&picture, wanted), all, "{size:?} {method:?}");
                assert!(picture.depth.iter().all(|d| (d - 3.0).abs() < 1e-4));
            }
        }
    }
}

fn backends(device: Option<&Device>) -> Vec<Backend> {
    let mut backends = vec![Backend::Reference];
    backends.extend(device.map(|d| Backend::Device(d.gpu().clone())));
    backends
}

/// Two sheets that face the eye, as points on a grid: a near red one and a far green one, which reaches out behind it
/// by half its width. `tilt` turns both about the y axis, radians.
fn sheets(gap: f32, tilt: f32, spacing: f32) -> Model {
    let mut mesh = Mesh::default();
    let (sin, cos) = tilt.sin_cos();
    for (offset, side, color) in [(0.0, 0.5, [255, 0, 0, 255]), (-gap, 1.0, [0, 255, 0, 255])] {
        let n = (side / spacing) as i32;
        for j in -n..=n {
            for i in -n..=n {
                // Off the other sheet's grid, so that not all far centers lie behind near ones.
                let (x, y) = (i as f32 * spacing + 0.3 * offset, j as f32 * spacing);
                mesh.positions.push(Vec3::new(
                    x * cos + offset * sin,
                    y,
                    -x * sin + offset * cos,
                ));
                mesh.normals.push(Vec3::new(sin, 0.0, cos));
                mesh.colors.push(color);
            }
        }
    }
    build(mesh)
}

/// Covered pixels that have some of both colors.
fn mixed(image: &Image) -> usize {
    (image.color.iter())
        .filter(|c| c[3] > 0 && c[0] > 0 && c[1] > 0)
        .count()
}

/// The guard: no color crosses a step in depth of more than twice the offset. A splat of 6 pixels here has the radius
/// 3 d / f = 0.07 at distance 4, so the smallest gap, 0.3, is more than twice that.
#[test]
fn no_color_crosses_a_step_in_depth() {
    let device = Device::open();
    let view = axis_view((160, 160), 4.0);
    for (gap, tilt) in [(0.3, 0.0), (0.8, 0.0), (0.8, 0.6), (1.5, 1.1)] {
        let model = sheets(gap, tilt, 0.04);
        for backend in backends(device.as_ref()) {
            let mut engine = engine(&backend, &model, &view);
            for reconstruction in RECONSTRUCTIONS {
                for method in [Method::Points, Method::Pop] {
                    // Points of a cloud have sizes of their own, so pull-push has no bound of reach, and the sheets
                    // are at the same distance in places far apart.
                    let is_unbounded = method == Method::Pop && tilt > 1.0;
                    if is_unbounded && reconstruction == Reconstruction::PullPush {
                        continue;
                    }
                    let guarded = settings(method, 6.0, reconstruction);
                    let name = format!("{reconstruction:?}, gap {gap}, tilt {tilt}, {method:?}");
                    let picture = draw(&mut engine, &view, &guarded);
                    let red = picture.color.iter().filter(|c| c[0] > 0).count();
                    let green = picture.color.iter().filter(|c| c[1] > 0).count();
                    assert!(red > 900 && green > 900, "{name}: {red} red, {green} green");
                    assert_eq!(mixed(&picture), 0, "{name}: color crosses the step");
                    // Holes: else nothing could cross.
                    let class = classes(&mut engine, &view, &guarded);
                    assert!(count(&class, HOLE) > 900, "{name}");
                    // With an offset as large as the gap both sheets are one surface, and the test can see it.
                    if tilt == 0.0 {
                        let open = Settings {
                            depth_offset: Some(40.0),
                            ..guarded
                        };
                        let picture = draw(&mut engine, &view, &open);
                        assert!(mixed(&picture) > 100, "{name}: the test sees nothing");
                    }
                }
            }
        }
    }
}

/// How far footprints of a sphere reach beyond its silhouette, pixels, as centers of pixels count. In a plane that
/// touches a sphere a disc of radius r reaches r^2 / 2 radii of the sphere beyond; but seen from the side it is kept at a
/// tenth of its width, so r / 10. A node is as thick as its sphere bulges, again about r^2 / 2. All of that is below
/// a tenth of the threshold here; the rest is the square of a pixel that the smallest footprints are.
fn grows_by(threshold_px: f32) -> f64 {
    0.75 + 0.1 * f64::from(threshold_px)
}

/// A near sphere over a far square: every color is one of the two, and the rim of the sphere is that of its mask.
#[test]
fn a_near_rim_keeps_its_color_over_a_far_surface() {
    let device = Device::open();
    let mut mesh =
        surfel::generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Sphere, 20_000).unwrap());
    let mut wall =
        surfel::generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Square, 8_000).unwrap());
    mesh.colors = vec![[255, 0, 0, 255]; mesh.positions.len()];
    let first = mesh.positions.len() as u32;
    for position in &mut wall.positions {
        *position = *position * 6.0 + Vec3::new(0.0, 0.0, -2.5);
    }
    mesh.positions.extend(&wall.positions);
    mesh.normals.extend(&wall.normals);
    mesh.colors
        .extend(vec![[0, 255, 0, 255]; wall.positions.len()]);
    mesh.triangles
        .extend(wall.triangles.iter().map(|t| t.map(|i| i + first)));
    let both = build(mesh);
    let view = axis_view((160, 160), 4.0);
    for backend in backends(device.as_ref()) {
        let mut engine = engine(&backend, &both, &view);
        for reconstruction in RECONSTRUCTIONS {
            for threshold in [3.0, 8.0] {
                let settings = settings(Method::Pop, threshold, reconstruction);
                let name = format!("{reconstruction:?} {threshold}");
                let picture = draw(&mut engine, &view, &settings);
                // Methods 15.1.
                let silhouette = f64::from(view.focal_px()) / (4.0f64.powi(2) - 1.0).sqrt();
                let grows = grows_by(threshold);
                let (mut near, mut far) = (0, 0);
                for (i, color) in picture.color.iter().enumerate() {
                    // The sphere ends at 5, the wall is at 6.5. At a rim red may be as dark as 0.
                    let is_near = picture.depth[i] < 5.0;
                    let foreign = if is_near { color[1] } else { color[0] };
                    assert_eq!(foreign, 0, "{name}: pixel {i} at {}", picture.depth[i]);
                    let (x, y) = (i as f64 % 160.0 + 0.5 - 80.0, (i / 160) as f64 + 0.5 - 80.0);
                    let radius = x.hypot(y);
                    if is_near {
                        assert!(radius < silhouette + grows, "{name}: {radius}");
                    } else {
                        assert!(radius > silhouette - 1.0, "{name}: {radius}");
                    }
                    near += usize::from(is_near);
                    far += usize::from(picture.depth[i].is_finite() && !is_near);
                }
                assert!(near > 1000 && far > 1000, "{name}: {near} near, {far} far");
            }
        }
    }
}

/// Methods 15.1 and F1: the silhouette of a sphere neither shrinks nor grows by more than the footprints do.
#[test]
fn the_silhouette_of_a_sphere_is_that_of_its_footprints() {
    let device = Device::open();
    let model = generated(GeneratedShape::Sphere, 200_000);
    let view = axis_view((300, 300), 3.0);
    let silhouette = f64::from(view.focal_px()) / (3.0f64.powi(2) - 1.0).sqrt();
    for backend in backends(device.as_ref()) {
        let mut engine = engine(&backend, &model, &view);
        for threshold in [1.0, 2.0, 4.0, 8.0] {
            for reconstruction in RECONSTRUCTIONS {
                let settings = settings(Method::Pop, threshold, reconstruction);
                let picture = draw(&mut engine, &view, &settings);
                let class = classes(&mut engine, &view, &settings);
                let name = format!("{threshold} {reconstruction:?}");
                let (mut largest, mut smallest) = (0.0f64, f64::INFINITY);
                for (i, color) in picture.color.iter().enumerate() {
                    let (x, y) = (i % 300, i / 300);
                    let radius = (x as f64 + 0.5 - 150.0).hypot(y as f64 + 0.5 - 150.0);
                    if color[3] > 0 {
                        largest = largest.max(radius);
                    } else {
                        smallest = smallest.min(radius);
                    }
                }
                let grows = largest - silhouette;
                let shrinks = silhouette - smallest;
                let holes = count(&class, UNREACHED);
                println!("{name}: grows {grows:.2}, shrinks {shrinks:.2} px; {holes} unreached");
                assert!(shrinks < 0.8, "{name}: shrinks by {shrinks} px");
                let bound = grows_by(threshold);
                assert!(grows < bound, "{name}: grows by {grows} px, bound {bound}");
            }
        }
    }
}

/// What it is for: at large thresholds nearer to the surface than squares of the same size; and no pixel inside of the
/// surface is left out.
#[test]
fn it_is_more_accurate_than_squares_and_leaves_no_hole() {
    let Some(device) = Device::open() else { return };
    let backend = Backend::Device(device.gpu().clone());
    let model = generated(GeneratedShape::Statue, 200_000);
    let view = orbit(&model, (250, 250), 30.0, 20.0, 1.0);
    let mut engine = engine(&backend, &model, &view);
    let triangles = Settings {
        method: Method::Triangles,
        ..Settings::default()
    };
    let reference = engine.supersample(&view, &triangles, 4).unwrap();
    for threshold_px in [4.0, 8.0] {
        let squares = Settings {
            threshold_px,
            ..Settings::default()
        };
        let squares = compare(&reference, &draw(&mut engine, &view, &squares), 0.0).unwrap();
        for reconstruction in RECONSTRUCTIONS {
            let settings = settings(Method::Pop, threshold_px, reconstruction);
            let picture = draw(&mut engine, &view, &settings);
            let d = compare(&reference, &picture, 0.0).unwrap();
            let class = classes(&mut engine, &view, &settings);
            println!(
                "{threshold_px} {reconstruction:?}: RMSE {:.4}, squares {:.4}; {} unreached",
                d.object.rmse,
                squares.object.rmse,
                count(&class, UNREACHED)
            );
            // Discs in the plane of a rough surface can leave a pixel between them.
            assert!(
                d.hole_pixels <= d.object.pixels / 5_000,
                "{threshold_px} {reconstruction:?}: {} holes",
                d.hole_pixels
            );
            assert!(
                d.object.rmse < 0.95 * squares.object.rmse,
                "{threshold_px} {reconstruction:?}: {} against {}",
                d.object.rmse,
                squares.object.rmse
            );
        }
    }
}

/// A center is hidden by what lies nearer than its footprint's offset, and by nothing else: of two points a bit more
/// and a bit less than the offset apart the far one is seen or not. With no offset it still sees itself.
#[test]
fn a_center_is_seen_unless_a_footprint_hides_it() {
    let device = Device::open();
    let view = axis_view((100, 100), 4.0);
    // Seven pixels, radius 3.5 d / f; facing the eye, so this is the offset at factor 1.
    let radius = 3.5 * 4.0 / view.focal_px();
    for (behind, factor, seen) in [
        (0.9 * radius, 1.0, 2),
        (1.1 * radius, 1.0, 1),
        (1.1 * radius, 1.2, 2),
        (0.01 * radius, 0.0, 1),
    ] {
        let model = build(Mesh {
            positions: vec![
                Vec3::ZERO,
                // Two pixels beside, on the way from the eye.
                Vec3::new(2.0 * (4.0 + behind) / view.focal_px(), 0.0, -behind),
            ],
            normals: vec![Vec3::Z; 2],
            ..Mesh::default()
        });
        for backend in backends(device.as_ref()) {
            let settings = Settings {
                depth_offset: Some(factor),
                ..settings(Method::Points, 7.0, Reconstruction::Gaussian)
            };
            let class = classes(&mut engine(&backend, &model, &view), &view, &settings);
            assert_eq!(
                count(&class, FOREGROUND),
                seen,
                "{behind} behind, factor {factor}"
            );
        }
    }
}

/// A hole without any center of its surface in reach shows its own footprint, at the depth of it.
#[test]
fn a_hole_out_of_reach_shows_its_footprint() {
    let device = Device::open();
    let view = axis_view((120, 120), 4.0);
    // A far point whose center is hidden by a near one, and whose square of 40 pixels reaches out behind it by 15.
    let model = build(Mesh {
        positions: vec![
            Vec3::ZERO,
            Vec3::new(15.0 / view.focal_px() * 6.0, 0.0, -2.0),
        ],
        normals: vec![Vec3::Z; 2],
        colors: vec![[255, 0, 0, 255], [0, 255, 0, 255]],
        ..Mesh::default()
    });
    for backend in backends(device.as_ref()) {
        let mut engine = engine(&backend, &model, &view);
        for reconstruction in RECONSTRUCTIONS {
            let settings = settings(Method::Points, 40.5, reconstruction);
            let class = classes(&mut engine, &view, &settings);
            let picture = draw(&mut engine, &view, &settings);
            let unreached = count(&class, UNREACHED);
            let of = |channel: usize| picture.color.iter().filter(|c| c[channel] > 0).count();
            let (red, green) = (of(0), of(1));
            assert_eq!(count(&class, FOREGROUND), 1, "{reconstruction:?}");
            assert!(green > 500, "{reconstruction:?}: {green} green");
            // The density's radius is bounded, so it does not reach the end of such a square either.
            let is_bounded = reconstruction == Reconstruction::Density;
            assert!(
                unreached == green || is_bounded,
                "{reconstruction:?}: {unreached}"
            );
            assert_eq!(mixed(&picture), 0);
            assert_eq!(red + green, picture.covered_pixels() as usize);
            let far = (0..picture.color.len()).filter(|&i| (picture.depth[i] - 6.0).abs() < 1e-3);
            assert_eq!(far.count(), green, "{reconstruction:?}");
        }
    }
}

#[test]
fn ways_to_blend_and_shade_are_refused_by_name() {
    let model = generated(GeneratedShape::Sphere, 1_000);
    let view = axis_view((50, 50), 3.0);
    for settings in [
        Settings {
            blend: Some(Blend::TwoPass),
            ..settings(Method::Pop, 1.0, Reconstruction::Gaussian)
        },
        Settings {
            shading: Shading::Deferred,
            ..settings(Method::Splats, 1.0, Reconstruction::Gaussian)
        },
    ] {
        let error = engine(&Backend::Reference, &model, &view).render(&view, &settings);
        let text = error.unwrap_err().to_string();
        assert!(text.contains("visibility splats"), "{text}");
    }
}

#[test]
fn classes_of_other_splats_are_refused_by_name() {
    let device = Device::open();
    let model = generated(GeneratedShape::Sphere, 1_000);
    let view = axis_view((50, 50), 3.0);
    for backend in backends(device.as_ref()) {
        for method in [Method::Triangles, Method::Points, Method::Pop] {
            let settings = Settings {
                method,
                color_by: ColorBy::Classification,
                ..Settings::default()
            };
            let error = engine(&backend, &model, &view).render(&view, &settings);
            let text = error.unwrap_err().to_string();
            assert!(text.contains("--splat visibility"), "{text}");
        }
    }
}
