//! Lists of splats that no cut would make, by the rasterizer, by compute and by the mirror.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use crate::abi::FilteredSplat;
use crate::gpu::Gpu;
use crate::gpu::buffer::{ReadbackBuffer, UploadBuffer};
use crate::gpu::for_tests::{close_in_silence, device};
use crate::gpu::frame::FrameRing;
use crate::image::{Image, unorm8};
use crate::math::camera::{Camera, View};
use crate::pack::FilteredList;
use crate::pack::filtered::FilteredPatch;
use crate::pack::filtered::ScreenGroups;
use crate::pack::splats::PackedSplats;
use crate::render::PictureOutputs;
use crate::render::cost::choose::ComputeShare;
use crate::render::cpu::filtered;
use crate::render::cpu::filtered::PictureArea;
use crate::render::cpu::filtered::normalize::{NormalizeParams, NormalizedPicture, normalize};
use crate::render::engine::style;
use crate::render::frame_constants::frame_constants;
use crate::render::reference::render_filtered;
use crate::render::vulkan::COLOR;
use crate::render::vulkan::blended::compute::ComputeInput;
use crate::render::vulkan::blended::filtered::{FilteredLists, FilteredPasses, FilteredVariant};
use crate::render::vulkan::raster_pass::{RasterList, RasterSplats, RasterTriangles, SplatRecords};
use crate::render::vulkan::scene::DeviceScene;
use crate::render::vulkan::storage_ranges::TriangleRanges;
use crate::render::vulkan::targets::{Context, FrameTargets};
use crate::render::{Settings, SplatKind};
use crate::tree::Model;
use glam::{DVec3, Vec3};
use std::sync::Arc;

const SIZE: (u32, u32) = (64, 48);

fn view() -> View {
    Camera::look_at(SIZE, DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.2, [1.0, 100.0])
        .view(DVec3::ZERO)
        .unwrap()
}

fn settings() -> Settings {
    Settings {
        splat: SplatKind::Filtered,
        background: [0.0, 0.25, 0.5],
        ..Settings::default()
    }
}

/// Those of a list that the view has.
fn placed(splats: &[FilteredPatch], view: &View) -> Vec<FilteredSplat> {
    splats
        .iter()
        .filter_map(|splat| splat.place(view))
        .collect()
}

/// What draws.
#[derive(Clone, Copy)]
enum Way {
    Raster,
    /// Shaders, of grays or of colors.
    Compute(bool),
}

/// The picture's bytes.
fn drawn(gpu: &Arc<Gpu>, splats: &[FilteredPatch], way: Way) -> Vec<[u8; 4]> {
    let (width, height) = SIZE;
    picture(
        gpu,
        &view(),
        &placed(splats, &view()),
        [0, 0, width, height],
        way,
    )
}

/// The bytes of a part of the picture, background elsewhere.
fn picture(
    gpu: &Arc<Gpu>,
    view: &View,
    splats: &[FilteredSplat],
    rect_px: [u32; 4],
    way: Way,
) -> Vec<[u8; 4]> {
    let (width, height) = SIZE;
    let by_compute = match way {
        Way::Raster => None,
        Way::Compute(is_gray) => Some(is_gray),
    };
    let variant = FilteredVariant {
        has_lamp: false,
        color: COLOR,
        by_compute,
        has_textures: false,
    };
    let filtered = FilteredPasses::new(gpu, SIZE, variant).unwrap();
    let targets = FrameTargets::new(gpu, width, height, (COLOR, false)).unwrap();
    let scene = DeviceScene::new(gpu, &Model::default()).unwrap();
    let bytes: &[u8] = bytemuck::cast_slice(splats);
    let mut list = UploadBuffer::new(gpu, "splats", bytes.len() as u64).unwrap();
    list.bytes_mut()[..bytes.len()].copy_from_slice(bytes);
    list.flush(0..bytes.len() as u64);
    let indices = UploadBuffer::new(gpu, "indices", 4).unwrap();
    let context = context(rect_px);
    let mut frames = FrameRing::new(gpu, 1, false).unwrap();
    let mut frame = frames.begin().unwrap();
    let constants = frame
        .uniform(&frame_constants(view, &settings(), &context))
        .unwrap();
    let packed = PackedSplats {
        points: splats.len(),
        quads: 0,
    };
    let what = FilteredLists {
        raster: RasterList {
            scene: &scene,
            triangles: RasterTriangles::Nothing,
            splats: RasterSplats::Records(SplatRecords::packed(&list, packed, splats.len())),
        },
        small: Some(ComputeInput {
            splats: &list,
            splat_count: splats.len() as u32,
            triangles: TriangleRanges {
                scene: &scene,
                corners: &indices,
                runs: &[],
            },
        }),
    };
    filtered
        .record(
            &mut frame,
            &targets,
            what,
            ComputeShare::Small,
            &context,
            constants,
        )
        .unwrap();
    let mut color = ReadbackBuffer::new(gpu, "color", targets.color().bytes()).unwrap();
    frame.read_back("color", targets.color(), &color);
    let ticket = frame.submit().unwrap();
    frames.finish(ticket).unwrap();
    bytemuck::pod_collect_to_vec(ReadbackBuffer::bytes(&mut color))
}

/// What the passes of a frame share that draws in a part of the picture.
fn context(rect_px: [u32; 4]) -> Context {
    Context {
        depth_range: [0.0, 1.0],
        occlusion_slack: 0.0,
        reads_depth: true,
        width: SIZE.0,
        height: SIZE.1,
        guard_px: 40,
        rect_px,
        background: settings().background,
        cull_back: false,
        is_mirrored: false,
        light: settings().light,
    }
}

/// The same bytes by the processor.
fn picture_by_cpu(
    view: &View,
    splats: &[FilteredSplat],
    rect_px: [u32; 4],
    is_gray: bool,
) -> Vec<[u8; 4]> {
    let canvas = PictureArea { rect_px, is_gray };
    let list = filtered::DrawnSplats {
        splats: &[filtered::GroupedSplats {
            splats,
            groups: &ScreenGroups::of(splats),
        }],
        meshes: &[],
        triangles: &filtered::CutTriangles::default(),
    };
    let mut front = vec![0; canvas.pixels()];
    let mut sums = vec![0; canvas.pixels() * canvas.words()];
    filtered::draw(list, canvas, &mut front, &mut sums);
    let (pitch, [left, top, ..]) = (SIZE.0 as usize, rect_px.map(|v| v as usize));
    let background = settings().background.map(|c| unorm8(f64::from(c)));
    let background = u32::from_le_bytes([background[0], background[1], background[2], 0]);
    let mut words = vec![background; pitch * SIZE.1 as usize];
    let mut depths = vec![0.0; canvas.pixels()];
    let params = NormalizeParams::new(&frame_constants(view, &settings(), &context(rect_px)));
    let picture = NormalizedPicture {
        colors: &mut words[top * pitch + left..],
        pitch,
        depths: &mut depths,
    };
    normalize(canvas, &params, &front, &sums, picture);
    words.into_iter().map(u32::to_le_bytes).collect()
}

fn mirrored(splats: &[FilteredPatch]) -> Image {
    let list = FilteredList {
        splats: &placed(splats, &view()),
        ..FilteredList::default()
    };
    let style = style(&settings(), &Model::default());
    render_filtered(&view(), &list, &style, PictureOutputs::default()).image
}

/// The most that a channel differs by, and how many pixels differ by more than one level.
fn difference(a: &[[u8; 4]], b: &[[u8; 4]]) -> (u8, usize) {
    assert_eq!(a.len(), b.len());
    let of = |a: &[u8; 4], b: &[u8; 4]| (0..4).map(|i| a[i].abs_diff(b[i])).max().unwrap_or(0);
    let all = || a.iter().zip(b).map(|(a, b)| of(a, b));
    (all().max().unwrap(), all().filter(|&d| d > 1).count())
}

/// Numbers in 0..1, the same in every run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// A crowd of splats of up to `largest` pixels, some of them beside the picture or behind the eye.
fn crowd(count: usize, largest: f32, is_gray: bool) -> Vec<FilteredPatch> {
    let mut n = Numbers(7);
    (0..count)
        .map(|_| {
            let z = 2.0 + 8.0 * n.next() * n.next() - 0.3;
            let (x, y) = (2.4 * n.next() - 1.2, 1.8 * n.next() - 0.9);
            let side = 1.0 + (largest - 1.0) * n.next() * n.next();
            let gray = n.next();
            let color = [n.next(), n.next(), n.next()];
            let extent_px = [(side * n.next()).max(0.07), (side * n.next()).max(0.07)];
            FilteredPatch {
                center: Vec3::new(x * z, y * z, if n.next() < 0.02 { z } else { -z }),
                offset: 0.5 * n.next(),
                side_px: side,
                area_px: extent_px[0] * extent_px[1] * n.next(),
                extent_px,
                color: if is_gray { [gray; 3] } else { color },
            }
        })
        .collect()
}

#[test]
fn crowds_are_the_same_by_rasterizer_compute_and_mirror() {
    let Some(gpu) = device() else { return };
    // The largest are left to the rasterizer on either path.
    for (largest, is_gray) in [(1.0, true), (3.0, false), (30.0, true), (30.0, false)] {
        let splats = crowd(4000, largest, is_gray);
        let raster = drawn(&gpu, &splats, Way::Raster);
        let compute = drawn(&gpu, &splats, Way::Compute(is_gray));
        let mirror = mirrored(&splats).color;
        let what = format!("up to {largest} px, gray {is_gray}");
        // A splat whose depth ties with a front is seen or not by the last bit of its depth.
        for (other, name) in [(&raster, "raster"), (&mirror, "mirror")] {
            let (_, past) = difference(&compute, other);
            // Sizes of points are in steps on a graphics card, and so borders of fronts lie elsewhere.
            let most = if gpu.info().is_cpu() {
                3
            } else {
                compute.len() / 8
            };
            assert!(past <= most, "{what}: {past} pixels differ from the {name}");
        }
        assert!(
            compute.iter().filter(|p| p[3] == 0).count() < compute.len() / 2,
            "{what}"
        );
    }
    close_in_silence(gpu);
}

/// To the bit: the same maxima and sums, and the same last pass over fewer pixels. In perspective and without, in all of the
/// picture and in parts that end within tiles; some splats lie beside it, behind the eye or nowhere.
#[test]
fn the_processor_draws_the_picture_of_the_shaders() {
    let Some(gpu) = device() else { return };
    let (width, height) = SIZE;
    let mut camera = Camera::look_at(SIZE, DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.2, [1.0, 100.0]);
    let perspective = camera.view(DVec3::ZERO).unwrap();
    camera.proj = glam::DMat4::from_cols(
        glam::DVec4::X * 0.09,
        glam::DVec4::Y * 0.12,
        glam::DVec4::Z / (1.0 - 100.0),
        glam::DVec4::new(0.0, 0.0, 1.0 / (1.0 - 100.0), 1.0),
    );
    let orthographic = camera.view(DVec3::ZERO).unwrap();
    assert!(!orthographic.is_perspective);
    for (name, view) in [("perspective", perspective), ("orthographic", orthographic)] {
        for (count, largest, is_gray) in [
            (0, 1.0, true),
            (3, 9.0, false),
            (4000, 3.0, true),
            (900, 15.0, false),
        ] {
            let mut splats = placed(&crowd(count, largest, is_gray), &view);
            for (i, splat) in splats.iter_mut().enumerate() {
                match i % 50 {
                    7 => splat.window_px[i / 50 % 2] = f32::NAN,
                    27 => splat.area_px = f32::NAN,
                    37 => splat.pushed_depth = 0.0,
                    _ => {}
                }
            }
            for rect_px in [[0, 0, width, height], [5, 3, 41, 31], [63, 0, 64, 48]] {
                let what = format!("{name}, {count} up to {largest} px in {rect_px:?}");
                let way = Way::Compute(is_gray);
                let shaders = picture(&gpu, &view, &splats, rect_px, way);
                let processor = picture_by_cpu(&view, &splats, rect_px, is_gray);
                if gpu.info().is_cpu() {
                    assert!(processor == shaders, "{what}");
                } else {
                    // A graphics card rounds the middle between two levels, quotients and roots otherwise.
                    let (_, past) = difference(&processor, &shaders);
                    assert!(past <= shaders.len() / 100, "{what}: {past} pixels differ");
                }
                let seen = shaders.iter().filter(|p| p[3] > 0).count();
                let is_column = rect_px[2] - rect_px[0] == 1;
                assert!(
                    count < 900 || is_column || seen > 20,
                    "{what}: {seen} pixels"
                );
            }
        }
    }
    close_in_silence(gpu);
}

#[test]
fn the_order_of_a_list_does_not_show() {
    let Some(gpu) = device() else { return };
    for is_gray in [true, false] {
        let mut splats = crowd(3000, 5.0, is_gray);
        let first = drawn(&gpu, &splats, Way::Compute(is_gray));
        assert_eq!(
            first,
            drawn(&gpu, &splats, Way::Compute(is_gray)),
            "drawn again"
        );
        let mut n = Numbers(11);
        for i in (1..splats.len()).rev() {
            splats.swap(i, (n.next() * i as f32) as usize);
        }
        assert_eq!(
            first,
            drawn(&gpu, &splats, Way::Compute(is_gray)),
            "shuffled"
        );
    }
    close_in_silence(gpu);
}

#[test]
fn hundreds_of_splats_over_one_pixel_fit_their_sums() {
    let Some(gpu) = device() else { return };
    // Each covers the pixel whole; half of them are of one color, half of another. The sums of weights are 500, and near
    // the most that fits: 65,536 of weights above a 64th, 64 of those below.
    for (count, weight) in [
        (500, 1.0),
        (500, 0.001),
        (20_000, 3.0),
        (500, 1.0 / 63.0),
        (4000, 1.0 / 65.0),
    ] {
        let splats: Vec<FilteredPatch> = (0..count)
            .map(|i| FilteredPatch {
                center: Vec3::new(0.0, 0.0, -5.0),
                offset: 0.1,
                side_px: 3.0,
                area_px: 9.0 * weight,
                extent_px: [3.0; 2],
                color: if i % 2 == 0 {
                    [1.0, 0.8, 0.0]
                } else {
                    [0.0, 0.4, 1.0]
                },
            })
            .collect();
        let picture = drawn(&gpu, &splats, Way::Compute(false));
        // Its neighbors are covered by the squares as well, so it is no rim.
        let at = (SIZE.0 * (SIZE.1 / 2 - 1) + SIZE.0 / 2 - 1) as usize;
        let mirror = mirrored(&splats).color;
        assert!(
            difference(&picture, &mirror).0 <= 1,
            "{count} of {weight}: {:?} is not {:?}",
            picture[at],
            mirror[at]
        );
        let [r, g, b, a] = picture[at];
        assert!(r.abs_diff(128) <= 1 && g.abs_diff(153) <= 1 && b.abs_diff(128) <= 1 && a == 255);
    }
    close_in_silence(gpu);
}
