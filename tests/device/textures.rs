//! Surfaces with images: what is drawn of them near and far, by the reference and by the processor's renderer.

use crate::common::{Device, orbit, pictures};
use glam::{Vec2, Vec3};
use std::sync::Arc;
use surfel::image::FloatImage;
use surfel::math::camera::View;
use surfel::mesh::Mesh;
use surfel::mesh::attributes::PointAttributes;
use surfel::patches::{ErrorTolerances, PatchRules};
use surfel::progress::SilentProgress;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{ListOf, Method, Path, PictureOutputs, Settings, SplatKind};
use surfel::textures::{MeshTextures, NO_IMAGE, TextureImage, TextureLevel, WrapMode};
use surfel::tree::{self, BuildOptions, Model};

const SIZE: (u32, u32) = (240, 200);

fn image_of(side: u32, of: impl Fn(u32, u32) -> [u8; 3]) -> Arc<TextureImage> {
    let places = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
    let texels = places.map(|(x, y)| {
        let [red, green, blue] = of(x, y);
        [red, green, blue, 255]
    });
    let level = TextureLevel::new(side, side, texels.collect()).unwrap();
    Arc::new(TextureImage::new(
        "test",
        [side; 2],
        [WrapMode::Clamp; 2],
        level,
    ))
}

/// Squares of three texels, white and dark blue.
fn checker() -> Arc<TextureImage> {
    checker_of(3)
}

/// Squares of so many texels, white and dark blue.
fn checker_of(side: u32) -> Arc<TextureImage> {
    image_of(512, |x, y| match (x / side + y / side) % 2 {
        0 => [255, 255, 255],
        _ => [0, 10, 60],
    })
}

/// As photographs are: slow changes, edges and noise.
fn photograph() -> Arc<TextureImage> {
    image_of(512, |x, y| {
        let (u, v) = (x as f32 / 512.0, y as f32 / 512.0);
        let slow = 90.0 + 60.0 * (7.0 * u + 3.0 * v).sin() + 40.0 * (11.0 * v - 5.0 * u).cos();
        let edge = if (u - 0.5).hypot(v - 0.4) < 0.2 {
            60.0
        } else {
            0.0
        };
        let mixed =
            (x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77)).wrapping_mul(0xc2b2_ae3d);
        let noise = (mixed >> 24) as f32 / 255.0 * 50.0 - 25.0;
        let byte = |value: f32| value.clamp(0.0, 255.0) as u8;
        [
            byte(slow + edge + noise),
            byte(0.7 * slow + noise),
            byte(200.0 - slow + 0.5 * edge),
        ]
    })
}

/// A wavy sheet of `cells` by `cells` squares, facing +z, that shows an image upright.
fn sheet(cells: u32, image: &Arc<TextureImage>, height: f32) -> Mesh {
    let at = |x: u32, y: u32| {
        let (u, v) = (x as f32 / cells as f32, y as f32 / cells as f32);
        Vec3::new(
            u - 0.5,
            v - 0.5,
            height * ((9.0 * u).sin() + (7.0 * v).cos()),
        )
    };
    let corner = |x: u32, y: u32| y * (cells + 1) + x;
    let all = |count: u32| (0..count).flat_map(move |y| (0..count).map(move |x| (x, y)));
    let positions: Vec<Vec3> = all(cells + 1).map(|(x, y)| at(x, y)).collect();
    let triangles: Vec<[u32; 3]> = all(cells)
        .flat_map(|(x, y)| {
            let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| corner(x + i, y + j));
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let place = |corner: u32| {
        let point = positions[corner as usize];
        Vec2::new(point.x + 0.5, 0.5 - point.y)
    };
    Mesh {
        textures: Some(MeshTextures {
            images: vec![image.clone()],
            corners: triangles.iter().map(|corners| corners.map(place)).collect(),
            image_of: vec![0; triangles.len()],
        }),
        positions,
        triangles,
        ..Mesh::default()
    }
}

fn built(mesh: Mesh) -> Model {
    tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap()
}

fn settings(method: Method, splat: SplatKind) -> Settings {
    Settings {
        method,
        splat,
        threshold_px: 1.0,
        ..Settings::default()
    }
}

fn picture(
    backend: &Backend,
    model: &Model,
    view: &View,
    settings: &Settings,
    k: u32,
) -> FloatImage {
    let outputs = Default::default();
    let mut engine = Engine::new(backend, model, SIZE, outputs).unwrap();
    engine.supersample(view, settings, k).unwrap()
}

/// Mean color of what is covered, levels of 255.
fn mean_color(picture: &FloatImage) -> Vec3 {
    let (mut sum, mut covered) = (Vec3::ZERO, 0.0);
    for &[red, green, blue, alpha] in &picture.color {
        sum += Vec3::new(red, green, blue);
        covered += alpha;
    }
    255.0 * sum / covered
}

/// Largest and mean difference of two pictures, levels of 255.
fn differences(one: &FloatImage, other: &FloatImage) -> [f32; 2] {
    let mut largest = 0.0_f32;
    let mut sum = 0.0;
    for (a, b) in one.color.iter().zip(&other.color) {
        for channel in 0..3 {
            let difference = 255.0 * (a[channel] - b[channel]).abs();
            largest = largest.max(difference);
            sum += difference;
        }
    }
    [largest, sum / (3 * one.color.len()) as f32]
}

/// Far away, splats have the mean color of the exact textured picture.
#[test]
fn far_views_have_the_colors_of_the_texture() {
    for (name, image) in [("checker", checker()), ("photograph", photograph())] {
        for cells in [6, 90] {
            let model = built(sheet(cells, &image, 0.05));
            assert!(model.has_colors);
            for fill in [0.125, 0.5] {
                let view = orbit(&model, SIZE, 30.0, 20.0, fill);
                let exact = settings(Method::Triangles, SplatKind::Square);
                let wanted = mean_color(&picture(&Backend::Reference, &model, &view, &exact, 8));
                for (splat, k) in [(SplatKind::Square, 4), (SplatKind::Filtered, 1)] {
                    let own = settings(Method::Pop, splat);
                    let found = mean_color(&picture(&Backend::Cpu, &model, &view, &own, k));
                    let off = (found - wanted).abs().max_element();
                    println!("{name}, {cells} cells, fill {fill}, {splat:?}: {found} of {wanted}");
                    assert!(
                        off < 2.0,
                        "{name}, {cells}, {fill}, {splat:?}: {found} of {wanted}"
                    );
                }
            }
        }
    }
}

/// The processor's renderer shows what the reference does, of triangles of any size, clipped ones too.
#[test]
fn the_processor_draws_what_the_reference_does() {
    let image = photograph();
    for (cells, height) in [(2, 0.1), (40, 0.05)] {
        let model = built(sheet(cells, &image, height));
        for (azimuth, fill) in [(20.0, 1.0), (75.0, 2.5), (85.0, 9.0)] {
            let view = orbit(&model, SIZE, azimuth, 15.0, fill);
            for splat in [SplatKind::Square, SplatKind::Filtered] {
                for method in [Method::Triangles, Method::Pop] {
                    let own = settings(method, splat);
                    let wanted = picture(&Backend::Reference, &model, &view, &own, 1);
                    let found = picture(&Backend::Cpu, &model, &view, &own, 1);
                    let [largest, mean] = differences(&found, &wanted);
                    assert!(
                        mean < 0.2 && largest < 60.0,
                        "{cells}, {azimuth}, {splat:?}, {method:?}: {largest}, {mean}"
                    );
                }
            }
        }
    }
}

/// A device shows what the reference does, whatever lies beyond the borders of an image and however many there are.
#[test]
fn a_device_draws_what_the_reference_does() {
    let Some(device) = Device::open() else {
        return;
    };
    let image = photograph();
    let level = image.levels()[0].clone();
    let wrap = [WrapMode::Repeat, WrapMode::Mirror];
    let wrapped = Arc::new(TextureImage::new("wrapped", [512; 2], wrap, level));
    for (cells, height) in [(3, 0.1), (40, 0.05)] {
        let mut mesh = sheet(cells, &image, height);
        let textures = mesh.textures.as_mut().unwrap();
        textures.images.push(wrapped.clone());
        let count = textures.image_of.len();
        textures.image_of[count / 2..].fill(1);
        textures.image_of[count - 5..].fill(NO_IMAGE);
        for corner in textures.corners[count / 2..].iter_mut().flatten() {
            *corner = *corner * 2.3 - Vec2::splat(0.7);
        }
        let model = built(mesh);
        let backend = Backend::Vulkan(device.gpu().clone());
        for (azimuth, fill) in [(20.0, 1.0), (75.0, 2.5)] {
            let view = orbit(&model, SIZE, azimuth, 15.0, fill);
            for splat in [SplatKind::Square, SplatKind::Filtered] {
                for method in [Method::Triangles, Method::Pop] {
                    for &path in device.paths() {
                        if method == Method::Triangles && path != Path::Raster {
                            continue;
                        }
                        let own = Settings {
                            path,
                            ..settings(method, splat)
                        };
                        let wanted = picture(&Backend::Reference, &model, &view, &own, 1);
                        let found = picture(&backend, &model, &view, &own, 1);
                        let [largest, mean] = differences(&found, &wanted);
                        let what = format!(
                            "{cells}, {azimuth}, {splat:?}, {method:?}, {path:?}: {largest}, {mean}"
                        );
                        println!("{what}");
                        // Slopes of the device are differences of neighbors.
                        assert!(mean < 0.4, "{what}");
                    }
                }
            }
        }
    }
}

/// Patches of a cut by error, of a tenth of a pixel.
fn patches(path: Path) -> Settings {
    let tolerances = ErrorTolerances {
        rim_px: 0.1,
        inside_px: 0.1,
        shade_levels: 4.0,
    };
    Settings {
        path,
        patches: Some(PatchRules {
            tolerances,
            is_strict: false,
            tiny_polygons: false,
            covers_rims: true,
        }),
        ..settings(Method::Pop, SplatKind::Square)
    }
}

/// Picture of patches, and how many there are.
fn patch_picture(
    backend: &Backend,
    model: &Model,
    view: &View,
    settings: &Settings,
) -> (FloatImage, u64) {
    let mut engine = Engine::new(backend, model, SIZE, Default::default()).unwrap();
    let counts = engine.draw(view, settings).unwrap().counts;
    let picture = engine.supersample(view, settings, 1).unwrap();
    (picture, counts.patches.patches())
}

/// A photograph, and one that is repeated.
fn two_images() -> [Arc<TextureImage>; 2] {
    let image = photograph();
    let level = image.levels()[0].clone();
    let wrap = [WrapMode::Repeat, WrapMode::Mirror];
    let wrapped = Arc::new(TextureImage::new("wrapped", [512; 2], wrap, level));
    [image, wrapped]
}

/// A sheet that shows one image with a seam in it, another, and in its last eighth none.
fn sheet_of_two(cells: u32, images: [&Arc<TextureImage>; 2], height: f32) -> Mesh {
    let mut mesh = sheet(cells, images[0], height);
    let textures = mesh.textures.as_mut().unwrap();
    textures.images.push(images[1].clone());
    let count = textures.image_of.len();
    textures.image_of[count / 2..].fill(1);
    textures.image_of[count - count / 8..].fill(NO_IMAGE);
    for corner in textures.corners[count / 2..].iter_mut().flatten() {
        *corner = *corner * 1.3 - Vec2::splat(0.7);
    }
    for (index, corners) in textures.corners[..count / 2].iter_mut().enumerate() {
        if index / 2 % (cells as usize) < 20 {
            corners
                .iter_mut()
                .for_each(|corner| corner.y = 1.0 - corner.y);
        }
    }
    mesh
}

/// Patches show what triangles show, across seams, borders and beside other images, by every backend.
#[test]
fn patches_show_images() {
    let device = Device::open();
    let [image, wrapped] = two_images();
    for (cells, height) in [(64, 0.0), (90, 0.05)] {
        let model = built(sheet_of_two(cells, [&image, &wrapped], height));
        for (azimuth, fill) in [(20.0, 1.0), (75.0, 2.5)] {
            let view = orbit(&model, SIZE, azimuth, 15.0, fill);
            let what = format!("{cells} cells, azimuth {azimuth}");
            let own = patches(Path::Auto);
            let (wanted, count) = patch_picture(&Backend::Reference, &model, &view, &own);
            assert!(count > 20, "{what}: {count}");
            let triangles = settings(Method::Triangles, SplatKind::Square);
            let exact = picture(&Backend::Reference, &model, &view, &triangles, 1);
            let [_, mean] = differences(&wanted, &exact);
            println!("{what}: {count} patches, {mean} levels from triangles");
            assert!(mean < 1.0, "{what}: {mean}");
            let mut backends = vec![(Backend::Cpu, Path::Auto)];
            if let Some(device) = &device {
                let vulkan = Backend::Vulkan(device.gpu().clone());
                let paths = device.paths().iter();
                backends.extend(paths.map(|&path| (vulkan.clone(), path)));
            }
            for (backend, path) in backends {
                let (found, own) = patch_picture(&backend, &model, &view, &patches(path));
                let [_, mean] = differences(&found, &wanted);
                println!("{what}, {path:?}: {mean}");
                // Where two patches are equally near the last bit of a depth decides.
                assert!(mean < 0.3 && own == count, "{what}, {path:?}: {mean}");
            }
        }
    }
}

/// The device copies places in images of the patches that a list names: the same pictures, for an eighth of the bytes.
#[test]
fn numbers_draw_patches_with_images() {
    let Some(device) = Device::open() else { return };
    let [image, wrapped] = two_images();
    let model = built(sheet_of_two(90, [&image, &wrapped], 0.05));
    let backend = Backend::Vulkan(device.gpu().clone());
    for (azimuth, fill) in [(20.0, 1.0), (75.0, 2.5)] {
        let view = orbit(&model, SIZE, azimuth, 15.0, fill);
        for &path in device.paths() {
            let drawn = [ListOf::Records, ListOf::Ids].map(|list_of| {
                let own = Settings {
                    list_of,
                    ..patches(path)
                };
                let mut engine =
                    Engine::new(&backend, &model, SIZE, PictureOutputs::default()).unwrap();
                let times = engine.draw(&view, &own).unwrap();
                let makes = |name: &str| times.passes.iter().any(|pass| pass.name == name);
                assert_eq!(makes("lists.places"), list_of == ListOf::Ids, "{path:?}");
                (engine.render(&view, &own).unwrap(), times.counts)
            });
            let [(records, of_records), (ids, of_ids)] = &drawn;
            let what = format!("{azimuth}, {path:?}");
            let oracle = match device.gpu().info().is_cpu() {
                true => pictures::SAME_BITS,
                false => pictures::IDS_ROUNDED,
            };
            oracle.assert_same(records, ids, &what);
            let patches = of_records.patches.patches();
            assert!(patches > 20 && of_records.patches == of_ids.patches);
            // 4 bytes of 152 and 32.
            let spared = of_records.draw_list_bytes - of_ids.draw_list_bytes;
            assert!(spared >= 180 * patches, "{what}: {spared} of {patches}");
        }
    }
}

/// Patches of several models show each the images of its own, beside a model without any.
#[test]
fn several_models_show_their_images_by_patches() {
    let device = Device::open();
    let [image, wrapped] = two_images();
    let beside = |mut mesh: Mesh, x: f32| {
        mesh.positions.iter_mut().for_each(|at| at.x += x);
        built(mesh)
    };
    let mut plain = sheet(40, &image, 0.0);
    plain.textures = None;
    let models = [
        beside(sheet(50, &checker_of(48), 0.02), -0.6),
        beside(plain, 0.0),
        beside(sheet_of_two(60, [&image, &wrapped], 0.02), 0.6),
    ];
    let origin = models[1].origin;
    let moved = models.map(|model| {
        let mut nothing = PointAttributes::default();
        (model.moved_to(origin, &mut nothing, &SilentProgress)).unwrap()
    });
    let all: Vec<&Model> = moved.iter().collect();
    let view = orbit(all[1], SIZE, 15.0, 20.0, 0.6);
    let draw = |backend: &Backend, own: &Settings| {
        let mut engine = Engine::of_models(backend, &all, SIZE, Default::default()).unwrap();
        let picture = engine.supersample(&view, own, 1).unwrap();
        (picture, engine.draw(&view, own).unwrap().counts)
    };
    let triangles = settings(Method::Triangles, SplatKind::Square);
    let (exact, _) = draw(&Backend::Reference, &triangles);
    let (wanted, counts) = draw(&Backend::Reference, &patches(Path::Auto));
    let [_, mean] = differences(&wanted, &exact);
    assert!(mean < 1.0, "{mean}");
    assert!(counts.patches.patches() > 60, "{counts:?}");
    let mut backends = vec![(Backend::Cpu, Path::Auto)];
    if let Some(device) = &device {
        let vulkan = Backend::Vulkan(device.gpu().clone());
        backends.extend(device.paths().iter().map(|&path| (vulkan.clone(), path)));
    }
    for (backend, path) in backends {
        let (found, own) = draw(&backend, &patches(path));
        let [_, mean] = differences(&found, &wanted);
        println!("{path:?}: {mean}");
        assert!(mean < 0.3, "{path:?}: {mean}");
        assert_eq!(own.patches, counts.patches, "{path:?}");
    }
}

/// The image is upright, on its own triangles, and others keep their colors.
#[test]
fn images_are_upright_and_on_their_triangles_only() {
    let quarters = image_of(64, |x, y| match (x < 32, y < 32) {
        (true, true) => [255, 0, 0],
        (false, true) => [0, 255, 0],
        (true, false) => [0, 0, 255],
        (false, false) => [255, 255, 0],
    });
    let mut mesh = sheet(8, &quarters, 0.0);
    // The last rows, at the top, have no image and gray vertices.
    let textures = mesh.textures.as_mut().unwrap();
    let first = 2 * 8 * 6;
    textures.image_of[first..].fill(NO_IMAGE);
    mesh.colors = vec![[100, 100, 100, 255]; mesh.positions.len()];
    let model = built(mesh);
    let view = orbit(&model, SIZE, 0.0, 0.0, 1.0);
    let by_size = [Method::Triangles, Method::Pop].map(|m| settings(m, SplatKind::Square));
    for backend in [Backend::Reference, Backend::Cpu] {
        for own in [by_size[0], by_size[1], patches(Path::Auto)] {
            let method = own.method;
            let picture = picture(&backend, &model, &view, &own, 1);
            let (width, height) = SIZE;
            // The sheet is as large as the sphere around it, over the root of two.
            let side = height as f32 / 2.0_f32.sqrt();
            let at = |x: f32, y: f32| {
                let x = (0.5 * width as f32 + x * side) as usize;
                let y = (0.5 * height as f32 - y * side) as usize;
                let [red, green, blue, _] = picture.color[y * width as usize + x];
                [red, green, blue].map(|value| (255.0 * value).round() as i32)
            };
            let is = |found: [i32; 3], wanted: [i32; 3]| {
                let close = |(a, b): (i32, &i32)| (a - b).abs() <= 14;
                assert!(
                    found.into_iter().zip(&wanted).all(close),
                    "{method:?}: {found:?} for {wanted:?}"
                );
            };
            // 0.8 of the color, and a little less beside the middle.
            is(at(-0.25, 0.1), [200, 0, 0]);
            is(at(0.25, 0.1), [0, 200, 0]);
            is(at(-0.25, -0.25), [0, 0, 200]);
            is(at(0.25, -0.25), [200, 200, 0]);
            is(at(-0.25, 0.4), [78, 78, 78]);
        }
    }
}

/// What a model moved to another origin shows is the same.
#[test]
fn moved_models_keep_their_textures() {
    let model = built(sheet(4, &checker(), 0.02));
    let textures = model.textures.clone().unwrap();
    let moved = model
        .moved_to(
            glam::DVec3::new(10.0, -3.0, 5.0),
            &mut PointAttributes::default(),
            &SilentProgress,
        )
        .unwrap();
    let own = moved.textures.clone().unwrap();
    assert_eq!(own.images.len(), 1);
    assert_eq!(own.points.len(), moved.vertices.len());
    let mut colors = [textures.leaf_colors.clone(), own.leaf_colors.clone()];
    colors.iter_mut().for_each(|colors| colors.sort_unstable());
    assert_eq!(colors[0], colors[1]);
}
