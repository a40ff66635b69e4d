//! Eye-dome lighting and ambient occlusion: every executor darkens its own picture by its own depths, by one rule; who asks for
//! it gets it.

use crate::common::{Device, generated, orbit};
use surfel::generate::{GeneratedShape, ShapeSpec};
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::pack::ColorBy;
use surfel::progress::SilentProgress;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{
    AmbientOcclusion, EyeDome, Method, Path, PictureOutputs, Settings, SplatKind,
};
use surfel::tree::{BuildOptions, Model};

const SIZE: (u32, u32) = (200, 160);

/// Exponent at strength 1 (docs/METHODS.md).
const EXPONENT: f64 = 18.0;

/// The points of a statue, with their normals or without.
fn cloud(has_normals: bool) -> Model {
    let spec = ShapeSpec::with_triangles(GeneratedShape::Statue, 60_000).unwrap();
    let mut mesh = surfel::generate::mesh(&spec);
    mesh.triangles.clear();
    if !has_normals {
        mesh.normals.clear();
    }
    surfel::tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

/// The rule of docs/METHODS.md, in double precision: a picture and its distances, darkened.
fn darkened(plain: &Image, background: [f64; 3], exponent: f64) -> Vec<[f64; 4]> {
    let (width, height) = (i64::from(plain.width), i64::from(plain.height));
    let level = |x: i64, y: i64| {
        let is_in = (0..width).contains(&x) && (0..height).contains(&y);
        let distance = is_in.then(|| f64::from(plain.depth[(y * width + x) as usize]));
        distance.filter(|d| d.is_finite()).map(f64::log2)
    };
    let around = [
        (-2, 0),
        (2, 0),
        (0, -2),
        (0, 2),
        (-1, -1),
        (1, -1),
        (-1, 1),
        (1, 1),
    ];
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    pixels
        .map(|(x, y)| {
            let color = plain.color[(y * width + x) as usize].map(f64::from);
            let Some(own) = level(x, y) else { return color };
            let levels = around.iter().filter_map(|(dx, dy)| level(x + dx, y + dy));
            let nearer: f64 = levels.map(|level| (own - level).max(0.0)).sum();
            let light = (-exponent * nearer).exp2();
            let mut dark = color;
            for i in 0..3 {
                let behind = 255.0 * background[i] * (1.0 - color[3] / 255.0);
                dark[i] = behind + (color[i] - behind) * light;
            }
            dark
        })
        .collect()
}

/// Height of what ambient occlusion takes for a plane: of a cloud half the median radius of its points.
fn slack_of(model: &Model) -> f64 {
    if !model.triangles.is_empty() {
        return 0.0;
    }
    let mut radii: Vec<f32> = model.tree.leaves.iter().map(|leaf| leaf.radius).collect();
    radii.sort_by(f32::total_cmp);
    0.5 * f64::from(radii[radii.len() / 2])
}

/// The same of ambient occlusion at strength 1: colors times the square of the openness. Rises are less by `slack`.
fn occluded(
    plain: &Image,
    background: [f64; 3],
    view: &View,
    (radius_px, slack): (f32, f64),
) -> Vec<[f64; 4]> {
    let (width, height) = (i64::from(plain.width), i64::from(plain.height));
    let lines = [
        (1, 0),
        (2, 1),
        (1, 1),
        (1, 2),
        (0, 1),
        (-1, 2),
        (-1, 1),
        (-2, 1),
    ];
    let parts = [
        [0.2, 0.55, 1.0],
        [0.25, 0.6, 0.95],
        [0.15, 0.45, 0.85],
        [0.3, 0.65, 1.0],
    ];
    let focal = f64::from(view.focal_px());
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let distance = |x: i64, y: i64| {
        let is_in = (0..width).contains(&x) && (0..height).contains(&y);
        let distance = is_in.then(|| f64::from(plain.depth[(y * width + x) as usize]));
        distance.filter(|d| d.is_finite())
    };
    let shaded = pixels.map(|(x, y)| {
        let color = plain.color[(y * width + x) as usize].map(f64::from);
        let Some(own) = distance(x, y) else {
            return color;
        };
        let mut hidden = 0.0;
        for (line, (dx, dy)) in lines.into_iter().enumerate() {
            let step = f64::from(dx * dx + dy * dy).sqrt();
            let horizon = |side: i64| {
                let rises = parts[line % 4].iter().filter_map(|part| {
                    let steps = (part * radius_px / step as f32 + 0.5).floor().max(1.0) as i64;
                    let at = side * steps;
                    let other = distance(x + at * i64::from(dx), y + at * i64::from(dy))?;
                    let away = steps as f64 * step;
                    let rise = match view.is_perspective {
                        true => focal * (own / other - 1.0 - slack / own) / away,
                        false => focal * (own - other - slack) / away,
                    };
                    Some(rise * (2.0 - rise * away / f64::from(radius_px)).clamp(0.0, 1.0))
                });
                rises.fold(f64::NEG_INFINITY, f64::max).atan()
            };
            hidden += (horizon(1) + horizon(-1)).max(0.0);
        }
        let light = (1.0 - hidden / (8.0 * std::f64::consts::PI)).powi(2);
        let mut dark = color;
        for i in 0..3 {
            let behind = 255.0 * background[i] * (1.0 - color[3] / 255.0);
            dark[i] = behind + (color[i] - behind) * light;
        }
        dark
    });
    shaded.collect()
}

fn picture(backend: &Backend, model: &Model, view: &View, settings: &Settings) -> Option<Image> {
    let outputs = PictureOutputs {
        depth: true,
        ..PictureOutputs::default()
    };
    let size = (view.width, view.height);
    let mut engine = Engine::new(backend, model, size, outputs).unwrap();
    // What an executor does not draw it refuses.
    engine.render(view, settings).ok()
}

/// Holds a picture to the one that was wanted, of which the plain one is known. So many pixels at most may be off.
fn compare(what: &str, before: &Image, found: &Image, wanted: &[[f64; 4]], most_odd: usize) {
    let (mut darker, mut odd) = (0, 0);
    for (i, (found, wanted)) in found.color.iter().zip(wanted).enumerate() {
        // Distances come from depths of 24 bits and more; colors are rounded once more.
        let off = (0..4).map(|c| (f64::from(found[c]) - wanted[c]).abs());
        let off = off.fold(0.0, f64::max);
        odd += usize::from(off > 1.6);
        let most = if most_odd > 0 { 10.0 } else { 1.6 };
        assert!(off <= most, "{what}, pixel {i}: {found:?}, {wanted:?}");
        let before = before.color[i];
        darker += usize::from(before[0] > found[0].saturating_add(20));
    }
    // What covers less than half a level of a pixel has a depth on the device, and none in the picture.
    assert!(odd <= most_odd, "{what}: {odd} pixels differ");
    assert!(darker > 100, "{what}: {darker} pixels are darker");
    assert!(found.depth == before.depth, "{what}: depths stay");
}

#[test]
fn every_executor_darkens_its_picture_by_its_depths() {
    let Some(device) = Device::open() else { return };
    let vulkan = Backend::Vulkan(device.gpu().clone());
    let (points, statue) = (cloud(false), generated(GeneratedShape::Statue, 20_000));
    let mut drawn = [0; 4];
    for (model, is_cloud) in [(&points, true), (&statue, false)] {
        for view in [
            orbit(model, SIZE, 30.0, 20.0, 1.3),
            crate::common::orthographic(model, SIZE),
        ] {
            for splat in [
                SplatKind::Square,
                SplatKind::Disc,
                SplatKind::Ellipse,
                SplatKind::Gauss,
                SplatKind::Filtered,
                SplatKind::Visibility,
            ] {
                let plain = Settings {
                    splat,
                    threshold_px: 3.0,
                    background: [0.2, 0.3, 0.6],
                    ..Settings::default()
                };
                for (number, (backend, path)) in [
                    (&vulkan, Path::Raster),
                    (&vulkan, Path::Compute),
                    (&Backend::Cpu, Path::Auto),
                    (&Backend::Reference, Path::Auto),
                ]
                .into_iter()
                .enumerate()
                {
                    let plain = Settings { path, ..plain };
                    let dark = Settings {
                        eye_dome: EyeDome::On,
                        eye_dome_strength: 0.5,
                        ..plain
                    };
                    let before = picture(backend, model, &view, &plain);
                    let Some(before) = before else { continue };
                    let what =
                        format!("{splat:?} by {} {path:?}, cloud {is_cloud}", backend.name());
                    let background = [0.2, 0.3, 0.6];
                    let wanted = darkened(&before, background, 0.5 * EXPONENT);
                    let found = picture(backend, model, &view, &dark).unwrap();
                    // Squares of filtered splats reach over rims, where the picture shows nothing of them and the device
                    // has their depth.
                    let [most_odd, most_hidden] = match splat {
                        SplatKind::Filtered => [4, 100],
                        _ => [0, 40],
                    };
                    compare(
                        &format!("darkened {what}"),
                        &before,
                        &found,
                        &wanted,
                        most_odd,
                    );
                    drawn[number] += 1;
                    if view.is_perspective == is_cloud {
                        continue;
                    }
                    let deep = Settings {
                        ambient_occlusion: AmbientOcclusion::On,
                        ambient_occlusion_reach_px: Some(9.0),
                        ..plain
                    };
                    let wanted = occluded(&before, background, &view, (9.0, slack_of(model)));
                    let found = picture(backend, model, &view, &deep).unwrap();
                    compare(
                        &format!("occluded {what}"),
                        &before,
                        &found,
                        &wanted,
                        most_hidden,
                    );
                }
            }
        }
    }
    println!("{drawn:?} pictures");
    assert!(
        drawn[0] == 24 && drawn[2] >= 10 && drawn[3] == 24,
        "{drawn:?}"
    );
}

#[test]
fn points_without_normals_are_darkened_where_it_is_left_open() {
    let Some(device) = Device::open() else { return };
    let vulkan = Backend::Device(device.gpu().clone());
    let auto = Settings {
        eye_dome: EyeDome::Auto,
        threshold_px: 2.0,
        ..Settings::default()
    };
    let surface = generated(GeneratedShape::Statue, 20_000);
    for (model, is_dark) in [
        (&cloud(false), true),
        (&cloud(true), false),
        (&surface, false),
    ] {
        let view = orbit(model, SIZE, 30.0, 20.0, 1.0);
        for backend in [&vulkan, &Backend::Cpu, &Backend::Reference] {
            for method in [Method::Pop, Method::Points] {
                let auto = Settings { method, ..auto };
                let of = |eye_dome| picture(backend, model, &view, &Settings { eye_dome, ..auto });
                let Some(found) = of(EyeDome::Auto) else {
                    continue;
                };
                let same_as = if is_dark { EyeDome::On } else { EyeDome::Off };
                let other = if is_dark { EyeDome::Off } else { EyeDome::On };
                assert!(found == of(same_as).unwrap() && found != of(other).unwrap());
                // Colors that are data stay.
                let data = |eye_dome| {
                    let color_by = ColorBy::Depth;
                    let settings = Settings {
                        color_by,
                        eye_dome,
                        ..auto
                    };
                    picture(backend, model, &view, &settings)
                };
                assert!(data(EyeDome::Auto) == data(EyeDome::Off));
                assert!(data(EyeDome::On).is_none(), "it is refused");
            }
        }
    }
}

/// Part of its light that ambient occlusion leaves each pixel, nothing of dark ones, and distances; `None` where the backend
/// does not draw so.
fn opened(
    backend: &Backend,
    model: &Model,
    view: &View,
    settings: &Settings,
) -> Option<(Vec<Option<f32>>, Vec<f32>)> {
    let of = |ambient_occlusion| {
        let own = Settings {
            ambient_occlusion,
            ..*settings
        };
        picture(backend, model, view, &own)
    };
    let [dark, plain] = [of(AmbientOcclusion::On)?, of(AmbientOcclusion::Off)?];
    let both = dark.color.iter().zip(&plain.color);
    let light = both.map(|(dark, plain)| {
        (plain[1] > 50 && plain[3] > 0).then(|| f32::from(dark[1]) / f32::from(plain[1]))
    });
    Some((light.collect(), plain.depth))
}

/// Distances of a picture by filtered splats, and what ambient occlusion makes of them, are those of triangles: nothing is seen
/// of how far splats are pushed away while they are blended.
#[test]
fn filtered_splats_lie_where_triangles_do() {
    let device = Device::open();
    let mut backends = vec![(Backend::Cpu, Path::Auto), (Backend::Reference, Path::Auto)];
    if let Some(device) = &device {
        let vulkan = Backend::Vulkan(device.gpu().clone());
        backends.extend(device.paths().iter().map(|&path| (vulkan.clone(), path)));
    }
    // Large triangles beside splats, and a smooth surface.
    let models = [
        generated(GeneratedShape::Statue, 40_000),
        generated(GeneratedShape::Sphere, 400_000),
    ];
    let usual = Settings {
        splat: SplatKind::Filtered,
        threshold_px: 2.0,
        ambient_occlusion_reach_px: Some(9.0),
        ..Settings::default()
    };
    for model in &models {
        let view = orbit(model, SIZE, 30.0, 20.0, 1.0);
        let triangles = Settings {
            method: Method::Triangles,
            ..usual
        };
        let (light, depth) = opened(&Backend::Reference, model, &view, &triangles).unwrap();
        for (backend, path) in &backends {
            let own = Settings {
                path: *path,
                ..usual
            };
            let what = format!("{} {path:?}", backend.name());
            let Some((found, own_depth)) = opened(backend, model, &view, &own) else {
                continue;
            };
            let both = depth.iter().zip(&own_depth);
            let mut off: Vec<f32> = both
                .filter(|(a, b)| a.is_finite() && b.is_finite())
                .map(|(a, b)| (b - a) / a * view.focal_px())
                .collect();
            off.sort_by(f32::total_cmp);
            let [low, median, high] = [1, 5, 9].map(|tenths| off[off.len() * tenths / 10]);
            let both = light.iter().zip(&found);
            let shown: Vec<f32> = both
                .filter_map(|(a, b)| Some(((*a)? - (*b)?).abs()))
                .collect();
            let mean = shown.iter().sum::<f32>() / shown.len() as f32;
            let what = format!("{what}: {low}, {median}, {high} pixels' width, light {mean}");
            println!("{what}");
            // Of squares of two pixels, which lie as deep as their centers, the nearest is seen: none is farther than the
            // surface by more than a part of a pixel.
            assert!(median < 0.1 && low > -4.0 && high < 0.5, "{what}");
            assert!(mean < 0.06, "{what}");
        }
    }
}

#[test]
fn a_background_of_two_colors_lies_behind_what_every_executor_draws() {
    let Some(device) = Device::open() else { return };
    let vulkan = Backend::Vulkan(device.gpu().clone());
    let model = generated(GeneratedShape::Statue, 20_000);
    let view = orbit(&model, SIZE, 30.0, 20.0, 0.8);
    let (top, bottom) = ([0.9, 0.5, 0.1], [0.1, 0.45, 0.3]);
    for (splat, backend) in [
        (SplatKind::Square, &vulkan),
        (SplatKind::Filtered, &vulkan),
        (SplatKind::Filtered, &Backend::Cpu),
        (SplatKind::Square, &Backend::Cpu),
        (SplatKind::Filtered, &Backend::Reference),
    ] {
        let flat = Settings {
            splat,
            background: top,
            ..Settings::default()
        };
        let gradient = Settings {
            background_bottom: Some(bottom),
            ..flat
        };
        let before = picture(backend, &model, &view, &flat).unwrap();
        let found = picture(backend, &model, &view, &gradient).unwrap();
        let what = format!("{splat:?} by {}", backend.name());
        let mut open = 0;
        for (i, (found, before)) in found.color.iter().zip(&before.color).enumerate() {
            let down = ((i / SIZE.0 as usize) as f32 + 0.5) / SIZE.1 as f32;
            let part = 1.0 - f32::from(before[3]) / 255.0;
            open += usize::from(part > 0.0 && part < 1.0);
            for c in 0..3 {
                let gain = part * 255.0 * (bottom[c] - top[c]) * down;
                let off = (f32::from(found[c]) - f32::from(before[c]) - gain).abs();
                // Rounded twice, and dithered by half a level.
                assert!(off <= 1.6, "{what}, {i}: {found:?}, {before:?}");
            }
            assert_eq!(found[3], before[3], "{what}: coverage stays");
        }
        assert!(splat == SplatKind::Square || open > 100, "{what}: {open}");
        assert!(found.depth == before.depth, "{what}");
    }
}
