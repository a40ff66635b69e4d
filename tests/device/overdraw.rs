//! The heat map of overdraw against closed forms, and the device against the mirror pixel by pixel.

use crate::common::{Device, generated, orbit, orthographic};
use glam::{DVec3, Vec3};
use surfel::generate::GeneratedShape;
use surfel::image::Image;
use surfel::math::camera::{Camera, View};
use surfel::mesh::Mesh;
use surfel::pack::{ColorBy, falsecolor};
use surfel::progress::SilentProgress;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::stats::OverdrawSummary;
use surfel::render::{
    Blend, Culling, Method, Occlusion, Path, Settings, Shading, SplatKind, SumFormat,
};
use surfel::tree::{self, BuildOptions, Model};

/// The mirror, and the device where there is one; it is checked when it goes.
struct Backends(
    Vec<Backend>,
    #[allow(dead_code, reason = "checked when dropped")] Option<Device>,
);

fn backends() -> Backends {
    let device = Device::open();
    let on_device = device.as_ref().map(|d| Backend::Device(d.gpu().clone()));
    let both = [Some(Backend::Reference), on_device];
    Backends(both.into_iter().flatten().collect(), device)
}

/// Settings of a frame that counts.
fn counting(method: Method, splat: SplatKind, threshold_px: f32) -> Settings {
    Settings {
        method,
        splat,
        threshold_px,
        color_by: ColorBy::Overdraw,
        ..Settings::default()
    }
}

/// The picture and the counts, which agree with each other and with the figures of the frame.
fn draw(backend: &Backend, model: &Model, view: &View, settings: &Settings) -> (Image, Vec<u32>) {
    let size = (view.width, view.height);
    let mut engine = Engine::new(backend, model, size, PictureOutputs::default()).unwrap();
    let times = engine.draw(view, settings).unwrap();
    let image = engine.read(view).unwrap();
    let counts = engine.overdraw().unwrap();
    assert_eq!(
        times.overdraw,
        Some(OverdrawSummary::of(counts.iter().copied()))
    );
    assert_eq!(counts.len(), image.color.len());
    let background = settings.background;
    for (&count, &shown) in counts.iter().zip(&image.color) {
        let ([r, g, b], alpha) = match count {
            0 => (background, 0),
            _ => (falsecolor::of_overdraw(count), 255),
        };
        let expected = [r, g, b].map(|c| (c * 255.0).round() as u8);
        // A logarithm in single precision.
        let is_near = (0..3).all(|c| shown[c].abs_diff(expected[c]) <= 1);
        assert!(is_near && shown[3] == alpha, "{count}: {shown:?}");
    }
    // Nothing is counted of a frame that shows something else.
    let usual = Settings {
        color_by: ColorBy::Shading,
        ..*settings
    };
    assert_eq!(engine.draw(view, &usual).unwrap().overdraw, None);
    assert_eq!(engine.overdraw(), None);
    (image, counts)
}

const SIDE: u32 = 90;

/// Looks along -z at zero.
fn facing() -> View {
    let eye = DVec3::new(0.0, 0.0, 3.0);
    Camera::look_at((SIDE, SIDE), eye, DVec3::ZERO, DVec3::Y, 0.6, [0.1, 10.0])
        .view(DVec3::ZERO)
        .unwrap()
}

fn model(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Model {
    let mesh = Mesh {
        normals: vec![Vec3::Z; positions.len()],
        positions,
        triangles,
        ..Mesh::default()
    };
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// Squares of the side `2 half` at these depths, each of two triangles.
fn sheets(half: f32, depths: &[f32]) -> Model {
    let corners = [[-half, -half], [half, -half], [half, half], [-half, half]];
    let positions = depths
        .iter()
        .flat_map(|&z| corners.map(|[x, y]| Vec3::new(x, y, z)));
    let triangles = (0..depths.len() as u32).flat_map(|i| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| 4 * i + k);
        [[a, b, c], [a, c, d]]
    });
    model(positions.collect(), triangles.collect())
}

#[test]
fn parallel_squares_are_counted_once_each_whichever_hides_which() {
    let view = facing();
    let backends = backends();
    for backend in &backends.0 {
        for depths in [&[0.0, -1.0][..], &[-1.0, 0.0], &[0.5, 0.0, 0.0, -0.5, -1.0]] {
            // They fill the picture; large on screen, so in pop they are triangles too.
            let model = sheets(4.0, depths);
            for method in [Method::Triangles, Method::Pop] {
                let settings = counting(method, SplatKind::Square, 3.0);
                let (_, counts) = draw(backend, &model, &view, &settings);
                let all = depths.len() as u32;
                // The diagonal belongs to one of its triangles.
                assert!(counts.iter().all(|&c| c == all), "{method:?}");
            }
        }
    }
}

#[test]
fn points_in_one_place_are_as_many_as_they_are() {
    let view = facing();
    let backends = backends();
    for backend in &backends.0 {
        for many in [1, 7, 1000] {
            let model = model(vec![Vec3::ZERO; many], Vec::new());
            // In the middle of the picture four pixels meet. Of the 6 x 6 around it 16 have their centers within 2.5.
            for (splat, covered) in [(SplatKind::Square, 25), (SplatKind::Disc, 16)] {
                let settings = counting(Method::Points, splat, 5.0);
                let (_, counts) = draw(backend, &model, &view, &settings);
                let found = OverdrawSummary::of(counts.iter().copied());
                let expected = OverdrawSummary {
                    covered,
                    primitives: covered * many as u64,
                    most: many as u32,
                };
                assert_eq!(found, expected, "{splat:?}");
            }
        }
    }
}

#[test]
fn squares_of_a_pixel_are_one_count_each() {
    let model = generated(GeneratedShape::Statue, 20_000);
    let view = orbit(&model, (160, 120), 40.0, 25.0, 0.9);
    let backends = backends();
    for backend in &backends.0 {
        let settings = counting(Method::Points, SplatKind::Square, 1.0);
        let (_, counts) = draw(backend, &model, &view, &settings);
        // The whole model is in the picture.
        let found = OverdrawSummary::of(counts.iter().copied());
        assert_eq!(found.primitives, model.vertices.len() as u64);
    }
}

/// Every way to draw: method, splat, blend.
const WAYS: [(Method, SplatKind, Option<Blend>); 14] = [
    (Method::Triangles, SplatKind::Square, None),
    (Method::Points, SplatKind::Square, None),
    (Method::Points, SplatKind::Disc, None),
    (Method::Points, SplatKind::Gauss, None),
    (Method::Points, SplatKind::Visibility, None),
    (Method::Pop, SplatKind::Square, None),
    (Method::Pop, SplatKind::Disc, None),
    (Method::Pop, SplatKind::Ellipse, None),
    (Method::Pop, SplatKind::Gauss, None),
    (Method::Pop, SplatKind::Square, Some(Blend::TwoPass)),
    (Method::Pop, SplatKind::Visibility, None),
    (Method::Pop, SplatKind::Filtered, None),
    (Method::Splats, SplatKind::Ellipse, None),
    (Method::Splats, SplatKind::Filtered, None),
];

#[test]
fn device_and_mirror_count_the_same() {
    let Some(device) = Device::open() else {
        return;
    };
    let subpixel_bits = device.gpu().info().subpixel_bits;
    let device = Backend::Device(device.gpu().clone());
    let model = generated(GeneratedShape::Statue, 30_000);
    let views = [
        orbit(&model, (200, 160), 40.0, 25.0, 1.3),
        orthographic(&model, (150, 130)),
    ];
    for view in &views {
        for (method, splat, blend) in WAYS {
            let settings = Settings {
                blend,
                ..counting(method, splat, 3.0)
            };
            let (_, ours) = draw(&device, &model, view, &settings);
            let size = (view.width, view.height);
            let mut mirror =
                Engine::new(&Backend::Reference, &model, size, PictureOutputs::default())
                    .unwrap()
                    .with_subpixel_bits(subpixel_bits);
            mirror.draw(view, &settings).unwrap();
            let theirs = mirror.overdraw().unwrap();
            let covered = theirs.iter().filter(|&&c| c > 0).count();
            let apart = || ours.iter().zip(&theirs).map(|(a, b)| a.abs_diff(*b));
            let differ = apart().filter(|&by| by > 0).count();
            let what = format!("{method:?} {splat:?} {blend:?}: {differ} of {covered}");
            println!("{what}, {}", OverdrawSummary::of(theirs.iter().copied()));
            // A pixel center on a rim may fall on either side by a last bit: in 2 pixels of any of these pictures at most.
            // Filtered splats count where they overlap a pixel by however little, and their places are rounded to parts
            // of 256 of a pixel: rectangles of 10 pixels' outline end there by chance in a pixel of 50.
            let part = if splat == SplatKind::Filtered {
                32
            } else {
                match crate::common::is_card() {
                    // Sizes of points are in steps there.
                    true => 100,
                    false => 2000,
                }
            };
            assert!(covered > 6000 && differ <= covered / part, "{what}");
            assert!(apart().all(|by| by <= 2), "{what}");
            // As many more as less, so the figures are the same.
            let [a, b] = [&ours, &theirs].map(|c| OverdrawSummary::of(c.iter().copied()).mean());
            assert!((a - b).abs() <= 0.002 * b, "{what}: {a} {b}");
        }
    }
}

/// The pictures that a device draws with and without counting.
#[test]
fn what_is_drawn_stays_the_same() {
    let model = generated(GeneratedShape::Statue, 20_000);
    let view = orbit(&model, (120, 100), 200.0, 10.0, 1.0);
    let backends = backends();
    for backend in &backends.0 {
        for splat in [SplatKind::Square, SplatKind::Gauss, SplatKind::Filtered] {
            let settings = counting(Method::Pop, splat, 2.0);
            let outputs = PictureOutputs {
                depth: true,
                ..PictureOutputs::default()
            };
            let mut engine = Engine::new(backend, &model, (120, 100), outputs).unwrap();
            let counted = engine.render(&view, &settings).unwrap();
            let usual = Settings {
                color_by: ColorBy::Depth,
                // By the device too, whose depths these are.
                path: Path::Raster,
                ..settings
            };
            let usual = engine.render(&view, &usual).unwrap();
            let pixels = counted.depth.iter().zip(&usual.depth);
            // Where splats are blended a rim shows nothing though a footprint reaches it.
            let is_shown = usual.color.iter().map(|c| c[3] > 0);
            assert!(pixels.zip(is_shown).all(|((a, b), shown)| a == b || !shown));
            assert!(counted.depth.iter().filter(|d| d.is_finite()).count() > 3000);
        }
    }
}

#[test]
fn what_the_cut_leaves_out_is_not_counted() {
    let model = generated(GeneratedShape::Statue, 100_000);
    let view = orbit(&model, (120, 100), 40.0, 25.0, 0.8);
    let backends = backends();
    for backend in &backends.0 {
        let counts = [Occlusion::Off, Occlusion::On].map(|occlusion| {
            let settings = Settings {
                occlusion,
                ..counting(Method::Pop, SplatKind::Square, 2.0)
            };
            draw(backend, &model, &view, &settings).1
        });
        let [off, on] = &counts;
        // What is hidden is hidden by something that is there.
        assert!(off.iter().zip(on).all(|(off, on)| off >= on));
        assert!(off.iter().zip(on).all(|(off, on)| (*off > 0) == (*on > 0)));
        let [off, on] = counts.map(|c| OverdrawSummary::of(c).mean());
        assert!(on < 0.7 * off, "{on} {off}");
    }
}

#[test]
fn how_it_would_be_drawn_and_lit_does_not_matter() {
    let backends = backends();
    let model = generated(GeneratedShape::Statue, 30_000);
    let view = orbit(&model, (120, 100), 40.0, 25.0, 2.0);
    for backend in &backends.0 {
        for splat in [SplatKind::Square, SplatKind::Filtered, SplatKind::Gauss] {
            // Some triangles of this threshold cover one pixel: small ones are otherwise splats, or drawn by compute.
            let settings = Settings {
                occlusion: Occlusion::Off,
                ..counting(Method::Pop, splat, 1.0)
            };
            let (image, counts) = draw(backend, &model, &view, &settings);
            for other in [
                Settings {
                    path: Path::Raster,
                    ..settings
                },
                Settings {
                    use_colors: false,
                    ..settings
                },
                Settings {
                    light: surfel::pack::SurfaceLighting::Phong(surfel::pack::Phong::default()),
                    ..settings
                },
            ] {
                let (other_image, other) = draw(backend, &model, &view, &other);
                assert!(other == counts && other_image == image);
            }
        }
    }
}

#[test]
fn what_has_no_counts_is_refused_by_name() {
    let model = sheets(0.5, &[0.0]);
    let view = facing();
    let backends = backends();
    for backend in &backends.0 {
        let size = (view.width, view.height);
        let mut engine = Engine::new(backend, &model, size, PictureOutputs::default()).unwrap();
        let settings = counting(Method::Pop, SplatKind::Gauss, 3.0);
        let mut refused = |settings: Settings, words: &str| {
            let error = engine.draw(&view, &settings).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        };
        refused(
            Settings {
                path: Path::Compute,
                ..settings
            },
            "leave --path compute out",
        );
        refused(
            Settings {
                shading: Shading::Deferred,
                ..settings
            },
            "overdraw are not lit",
        );
        let error = engine.sample(&view, &settings).unwrap_err().to_string();
        assert!(error.contains("draw one sample a pixel"), "{error}");
        // Sums of any format, and nothing culled.
        for settings in [
            Settings {
                sums: Some(SumFormat::Half),
                ..settings
            },
            Settings {
                culling: Culling::Off,
                ..settings
            },
        ] {
            engine.draw(&view, &settings).unwrap();
        }
    }
}
