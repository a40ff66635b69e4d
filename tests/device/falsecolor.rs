//! Colors by level, normal and depth against closed forms, on the device and the mirror; and a cut that is looked at from
//! elsewhere.

use crate::common::{Device, generated, orbit, pictures};
use glam::{DVec3, Vec3};
use surfel::cut::{Cut, CutSelector};
use surfel::generate::GeneratedShape;
use surfel::image::Image;
use surfel::math::camera::{Camera, View};
use surfel::mesh::Mesh;
use surfel::pack::{ColorBy, Phong, SurfaceLighting, falsecolor};
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::stats::FrameCounts;
use surfel::render::{Blend, Method, Occlusion, Path, Settings, Shading, SplatKind, cut_key};
use surfel::tree::{self, BuildOptions, Model};

/// Every way to draw that no other stands for.
const WAYS: [(Method, SplatKind); 10] = [
    (Method::Triangles, SplatKind::Square),
    (Method::Points, SplatKind::Square),
    (Method::Points, SplatKind::Ellipse),
    (Method::Pop, SplatKind::Square),
    (Method::Pop, SplatKind::Disc),
    (Method::Pop, SplatKind::Ellipse),
    (Method::Pop, SplatKind::Gauss),
    (Method::Pop, SplatKind::Visibility),
    (Method::Pop, SplatKind::Filtered),
    (Method::Splats, SplatKind::Square),
];

/// The mirror, and the device where there is one; it is checked when it goes.
struct Backends(
    Vec<Backend>,
    #[allow(dead_code, reason = "checked when dropped")] Option<Device>,
);

fn backends() -> Backends {
    let device = Device::open();
    let on_device = device.as_ref().map(|d| Backend::Device(d.gpu().clone()));
    Backends(
        [Some(Backend::Reference), on_device]
            .into_iter()
            .flatten()
            .collect(),
        device,
    )
}

fn draw(
    backend: &Backend,
    model: &Model,
    view: &View,
    settings: &Settings,
) -> (Image, FrameCounts) {
    let size = (view.width, view.height);
    let mut engine = Engine::new(backend, model, size, PictureOutputs::default()).unwrap();
    let counts = engine.draw(view, settings).unwrap().counts;
    (engine.read(view).unwrap(), counts)
}

/// The unit square in z = 0 as a grid of n x n cells, whose normals all are `normal`.
fn tile(n: u32, normal: Vec3) -> Model {
    let side = n + 1;
    let at = |i: u32| i as f32 / n as f32 - 0.5;
    let mesh = Mesh {
        positions: (0..side * side)
            .map(|i| Vec3::new(at(i % side), at(i / side), 0.0))
            .collect(),
        normals: vec![normal; (side * side) as usize],
        triangles: (0..n * n)
            .flat_map(|cell| {
                let a = cell / n * side + cell % n;
                [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]
            })
            .collect(),
        ..Mesh::default()
    };
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

const SIDE: u32 = 120;

/// Looks at zero from a direction to the right, so that the tile is tilted by 40 degrees.
fn tilted(distance: f64) -> View {
    let angle = 40f64.to_radians();
    let eye = distance * DVec3::new(angle.sin(), 0.0, angle.cos());
    let range = [0.1, 10.0];
    Camera::look_at((SIDE, SIDE), eye, DVec3::ZERO, DVec3::Y, 0.6, range)
        .view(DVec3::ZERO)
        .unwrap()
}

/// Distance along the view direction of the tile's plane through the middle of a pixel.
fn distance_of_plane(view: &View, i: usize) -> f32 {
    let (x, y) = (i as u32 % SIDE, i as u32 / SIDE);
    let ndc = |p: u32| 2.0 * (p as f32 + 0.5) / SIDE as f32 - 1.0;
    let ray = Vec3::new(ndc(x) / view.scale[0], -ndc(y) / view.scale[1], -1.0);
    let to_model = view.view_from_model.inverse();
    let direction = to_model.transform_vector3(ray);
    -view.eye.z / direction.z
}

/// Pixels that are wholly covered, with their colors.
fn whole(image: &Image) -> Vec<(usize, [u8; 3])> {
    let found = image.color.iter().enumerate().filter(|(_, c)| c[3] == 255);
    found.map(|(i, &[r, g, b, _])| (i, [r, g, b])).collect()
}

fn eight_bits(color: [f32; 3]) -> [i32; 3] {
    color.map(|c| (c * 255.0).round() as i32)
}

#[test]
fn a_plane_has_the_one_color_of_its_normal() {
    let normal = Vec3::new(0.48, -0.36, 0.8);
    let model = tile(60, normal);
    let expected = eight_bits([0.74, 0.32, 0.9]);
    let backends = backends();
    for backend in &backends.0 {
        for (method, splat) in WAYS {
            for light in [
                SurfaceLighting::Headlight,
                SurfaceLighting::Phong(Phong::default()),
            ] {
                let settings = Settings {
                    method,
                    splat,
                    light,
                    threshold_px: 4.0,
                    color_by: ColorBy::Normal,
                    ..Settings::default()
                };
                let (image, _) = draw(backend, &model, &tilted(2.0), &settings);
                let whole = whole(&image);
                assert!(whole.len() > 3000, "{method:?} {splat:?}");
                for (i, color) in whole {
                    for (is, should) in color.into_iter().zip(expected) {
                        // Octahedral codes, means and UNORM: a level.
                        assert!(
                            (i32::from(is) - should).abs() <= 1,
                            "{} {method:?} {splat:?} {i}: {color:?}, not {expected:?}",
                            backend.name()
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn what_has_no_normal_is_gray() {
    let mesh = Mesh {
        positions: (0..400)
            .map(|i| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0) / 20.0)
            .collect(),
        ..Mesh::default()
    };
    let cloud = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    let view = orbit(&cloud, (60, 60), 0.0, 0.0, 1.0);
    let settings = Settings {
        color_by: ColorBy::Normal,
        ..Settings::default()
    };
    let backends = backends();
    for backend in &backends.0 {
        let (image, _) = draw(backend, &cloud, &view, &settings);
        let whole = whole(&image);
        assert!(whole.len() > 300);
        assert!(
            whole
                .iter()
                .all(|(_, c)| c.iter().all(|c| c.abs_diff(128) <= 1))
        );
    }
}

#[test]
fn the_depth_of_a_tilted_plane_is_a_ramp() {
    let model = tile(60, Vec3::Z);
    let view = tilted(2.0);
    let radius = 0.5f32.hypot(0.5);
    let range = [2.0 - radius, 2.0 + radius];
    let ours = falsecolor::depth_range(model.orbit_center, model.orbit_radius, &view);
    assert!(
        (0..2).all(|i| (ours[i] - range[i]).abs() < 1e-5),
        "{ours:?}"
    );
    let backends = backends();
    for backend in &backends.0 {
        for (method, splat) in WAYS {
            let threshold_px = 4.0;
            let settings = Settings {
                method,
                splat,
                threshold_px,
                color_by: ColorBy::Depth,
                ..Settings::default()
            };
            let (image, _) = draw(backend, &model, &view, &settings);
            let is_whole = method == Method::Triangles;
            let whole = whole(&image);
            assert!(whole.len() > 3000, "{method:?} {splat:?}");
            let mut seen = [[255; 3], [0; 3]];
            for (i, color) in whole {
                let z = distance_of_plane(&view, i);
                // A splat has the depth of its center, up to a splat's width beside the pixel; a reconstruction has the
                // mean of centers twice as far away. A pixel beside it the plane's distance is another by this much.
                let step = 40f32.to_radians().tan() * z / view.focal_px() * 1.2;
                let reach = match splat {
                    _ if is_whole => 0.05,
                    SplatKind::Visibility => 2.0 * threshold_px,
                    _ => threshold_px + 0.5,
                } * step;
                let samples: Vec<[i32; 3]> = (0..=40)
                    .map(|k| z + (k as f32 / 20.0 - 1.0) * reach)
                    .map(|z| eight_bits(falsecolor::ramp((range[1] - z) / (2.0 * radius))))
                    .collect();
                for (channel, is) in color.into_iter().enumerate() {
                    let values = samples.iter().map(|s| s[channel]);
                    let (least, most) = (values.clone().min().unwrap(), values.max().unwrap());
                    assert!(
                        (least - 1..=most + 1).contains(&i32::from(is)),
                        "{} {method:?} {splat:?} {i}: {is} of channel {channel} is not in {least}..={most}",
                        backend.name()
                    );
                    seen[0][channel] = seen[0][channel].min(is);
                    seen[1][channel] = seen[1][channel].max(is);
                }
            }
            // The tile's own range is nearly all of the green channel between the ends that it reaches.
            assert!(
                seen[1][1] - seen[0][1] > 80,
                "{method:?} {splat:?}: {seen:?}"
            );
        }
    }
}

/// Levels that a cut draws, the leaves' among them, with how many splats and triangles each has.
fn levels_of(model: &Model, view: &View, settings: &Settings) -> Vec<usize> {
    let mut cut = Cut::default();
    let with = cut_key::cut_settings(settings, model);
    CutSelector::default().select(model, view, &with, &mut cut);
    let count = model.tree.level_count();
    let mut levels = vec![0; count + 1];
    for &node in cut.nodes.iter().chain(cut.strips.iter().map(|s| &s.node)) {
        levels[model.tree.level_of(node)] += 1;
    }
    levels[count] = cut.leaves.len() + cut.triangles.len();
    levels
}

#[test]
fn colors_step_through_the_levels_as_the_threshold_rises() {
    let model = tile(64, Vec3::Z);
    let view = tilted(2.0);
    let count = model.tree.level_count();
    let palette: Vec<[i32; 3]> = (0..=count)
        .map(|level| eight_bits(falsecolor::ramp(level as f32 / count as f32)))
        .collect();
    let backends = backends();
    for backend in &backends.0 {
        for splat in [SplatKind::Square, SplatKind::Ellipse, SplatKind::Visibility] {
            let mut coarsest = count;
            for threshold_px in [0.0, 2.0, 4.0, 8.0, 16.0, 400.0] {
                let settings = Settings {
                    splat,
                    threshold_px,
                    color_by: ColorBy::Level,
                    ..Settings::default()
                };
                let drawn = levels_of(&model, &view, &settings);
                let (image, _) = draw(backend, &model, &view, &settings);
                let mut seen = vec![0; count + 1];
                let mut mixed = 0;
                let whole = whole(&image);
                assert!(whole.len() > 3000, "{splat:?} {threshold_px}");
                for &(_, color) in &whole {
                    let is = |p: &[i32; 3]| (0..3).all(|c| (i32::from(color[c]) - p[c]).abs() <= 1);
                    match palette.iter().position(is) {
                        Some(level) => seen[level] += 1,
                        None => mixed += 1,
                    }
                }
                // Only a reconstruction mixes colors.
                assert!(
                    mixed == 0 || splat == SplatKind::Visibility && threshold_px > 0.0,
                    "{splat:?} {threshold_px}: {mixed} pixels of no level"
                );
                for level in 0..=count {
                    assert!(
                        seen[level] == 0 || drawn[level] > 0 || mixed > 0,
                        "{splat:?} {threshold_px}: level {level} is shown and not drawn: {drawn:?}"
                    );
                }
                let now = seen.iter().position(|&n| n > 0).unwrap();
                assert!(now <= coarsest, "{splat:?} {threshold_px}: finer again");
                coarsest = now;
                if threshold_px == 0.0 {
                    assert_eq!(seen[count], whole.len(), "triangles are all leaves");
                }
            }
            // The tile as one splat.
            assert_eq!(coarsest, 0, "{splat:?}");
        }
    }
}

#[test]
fn filtered_and_blended_levels_are_means_of_what_the_cut_draws() {
    let model = tile(64, Vec3::Z);
    let view = tilted(2.0);
    let backends = backends();
    for backend in &backends.0 {
        for splat in [SplatKind::Gauss, SplatKind::Filtered] {
            for threshold_px in [2.0, 6.0] {
                let settings = Settings {
                    splat,
                    threshold_px,
                    color_by: ColorBy::Level,
                    ..Settings::default()
                };
                let levels = levels_of(&model, &view, &settings);
                let count = levels.len() - 1;
                let colors: Vec<[i32; 3]> = (0..=count)
                    .filter(|&level| levels[level] > 0)
                    .map(|level| eight_bits(falsecolor::ramp(level as f32 / count as f32)))
                    .collect();
                let (image, _) = draw(backend, &model, &view, &settings);
                for (i, color) in whole(&image) {
                    for channel in 0..3 {
                        let values = colors.iter().map(|c| c[channel]);
                        let (least, most) = (values.clone().min().unwrap(), values.max().unwrap());
                        assert!(
                            (least - 1..=most + 1).contains(&i32::from(color[channel])),
                            "{} {splat:?} {threshold_px} {i}: {color:?} of {colors:?}",
                            backend.name()
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn what_cannot_be_drawn_is_refused_by_name() {
    let model = tile(8, Vec3::Z);
    let view = tilted(2.0);
    let level = Settings {
        color_by: ColorBy::Level,
        ..Settings::default()
    };
    let depth = Settings {
        color_by: ColorBy::Depth,
        ..Settings::default()
    };
    let backends = backends();
    for backend in &backends.0 {
        let mut cases = vec![
            (
                Settings {
                    method: Method::Triangles,
                    ..level
                },
                "color by level",
            ),
            (
                Settings {
                    method: Method::Points,
                    ..level
                },
                "color by level",
            ),
            (
                Settings {
                    splat: SplatKind::Gauss,
                    blend: Some(Blend::TwoPass),
                    shading: Shading::Deferred,
                    ..depth
                },
                "deferred shading",
            ),
        ];
        if matches!(backend, Backend::Device(_)) {
            let blended = Settings {
                splat: SplatKind::Gauss,
                path: Path::Compute,
                ..depth
            };
            cases.push((blended, "drawing by compute"));
        }
        for (settings, what) in cases {
            let size = (view.width, view.height);
            let mut engine = Engine::new(backend, &model, size, PictureOutputs::default()).unwrap();
            let error = engine.draw(&view, &settings).unwrap_err().to_string();
            assert!(error.contains(what), "{error}");
        }
    }
}

/// How many pixels differ by more than a level, or in coverage.
fn apart(a: &Image, b: &Image) -> usize {
    let differs = |(a, b): &(&[u8; 4], &[u8; 4])| (0..4).any(|c| a[c].abs_diff(b[c]) > 1);
    a.color.iter().zip(&b.color).filter(differs).count()
}

#[test]
fn data_as_colors_are_the_same_on_device_and_mirror() {
    let Some(device) = Device::open() else {
        return;
    };
    let device = Backend::Device(device.gpu().clone());
    let model = generated(GeneratedShape::Statue, 30_000);
    let view = orbit(&model, (200, 160), 40.0, 25.0, 1.3);
    for (method, splat) in WAYS {
        for color_by in [ColorBy::Level, ColorBy::Normal, ColorBy::Depth] {
            let settings = Settings {
                method,
                splat,
                color_by,
                threshold_px: 3.0,
                ..Settings::default()
            };
            if color_by == ColorBy::Level && !settings.has_cut() {
                continue;
            }
            let (ours, _) = draw(&device, &model, &view, &settings);
            let (theirs, _) = draw(&Backend::Reference, &model, &view, &settings);
            let what = format!("{method:?} {splat:?} {color_by:?}");
            pictures::REFERENCE_DATA.assert_same(&theirs, &ours, &what);
        }
    }
}

/// Kinds of splats that a cut is drawn with.
const KINDS: [SplatKind; 6] = [
    SplatKind::Square,
    SplatKind::Disc,
    SplatKind::Ellipse,
    SplatKind::Gauss,
    SplatKind::Visibility,
    SplatKind::Filtered,
];

#[test]
fn a_held_cut_is_drawn_wherever_the_camera_goes() {
    let model = generated(GeneratedShape::Statue, 30_000);
    let there = orbit(&model, (160, 160), 40.0, 25.0, 0.6);
    // Half of what the cut has is behind the picture here, where a cut of this view would have nothing.
    let beside = orbit(&model, (160, 160), 130.0, -10.0, 2.5);
    let backends = backends();
    for splat in KINDS {
        let follows = Settings {
            splat,
            threshold_px: 3.0,
            // Of a held cut nothing is hidden.
            occlusion: Occlusion::Off,
            ..Settings::default()
        };
        let held = Settings {
            cut_view: Some(there),
            ..follows
        };
        let mut pictures = Vec::new();
        for backend in &backends.0 {
            let (plain, counts) = draw(backend, &model, &there, &follows);
            let (same, held_counts) = draw(backend, &model, &there, &held);
            // Filtered splats of what faces away are dropped one by one, but not where they may be seen from behind.
            let is_filtered = splat == SplatKind::Filtered;
            if !is_filtered {
                // The box that they are drawn in is wider.
                let held_counts = FrameCounts {
                    draw_list_bytes: counts.draw_list_bytes,
                    ..held_counts
                };
                assert_eq!(counts, held_counts);
            }
            let oracle = match is_filtered {
                true => pictures::HELD_CUT_FILTERED,
                false => pictures::HELD_CUT,
            };
            oracle.assert_same(&plain, &same, &format!("{} {splat:?}", backend.name()));
            let (elsewhere, counts) = draw(backend, &model, &beside, &held);
            let (followed, other) = draw(backend, &model, &beside, &follows);
            assert_eq!(counts.nodes_visited, held_counts.nodes_visited);
            assert_ne!(counts.nodes_visited, other.nodes_visited);
            assert!(apart(&elsewhere, &followed) > 1000);
            pictures.push(elsewhere);
        }
        if let [mirror, device] = &pictures[..] {
            let what = format!("{splat:?} from elsewhere");
            pictures::REFERENCE_DATA.assert_same(mirror, device, &what);
        }
    }
}

#[test]
fn splats_of_a_held_cut_grow_as_the_camera_comes_near() {
    // A tile that is seen whole from afar and fills the picture from near: without holes only if splats grow.
    let model = tile(128, Vec3::Z);
    let facing = |distance: f64| {
        let eye = distance * DVec3::Z;
        Camera::look_at((SIDE, SIDE), eye, DVec3::ZERO, DVec3::Y, 0.6, [0.1, 10.0])
            .view(DVec3::ZERO)
            .unwrap()
    };
    let (far, near) = (facing(3.0), facing(0.75));
    let backends = backends();
    for backend in &backends.0 {
        for splat in KINDS {
            let settings = Settings {
                splat,
                threshold_px: 4.0,
                cut_view: Some(far),
                ..Settings::default()
            };
            let (image, counts) = draw(backend, &model, &near, &settings);
            let empty = image.color.iter().filter(|c| c[3] < 255).count();
            assert_eq!(empty, 0, "{} {splat:?}", backend.name());
            assert!(counts.triangles == 0 && counts.splats < 5000, "{counts:?}");
        }
    }
}
