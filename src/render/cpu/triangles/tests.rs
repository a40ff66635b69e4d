//! Sheets and planes, whose pixels, depths and shades are known in closed form.
#![allow(clippy::expect_used, reason = "a failing test panics")]

use crate::abi::Vertex;
use crate::abi::constants::{
    FLAG_COLOR_BY_DEPTH, FLAG_COLOR_BY_LEVEL, FLAG_COLOR_BY_NORMAL, FLAG_PHONG,
};
use crate::math::octahedral;
use crate::render::cpu::filtered::{DrawnSplats, draw};
use crate::render::cpu::triangles::*;
use bytemuck::Zeroable;
use std::ops::Range;

const SIZE: u32 = 96;
/// Distance of the near plane, where depth is 1.
const NEAR: f32 = 0.5;

/// An eye in the origin that looks along -z, 90 degrees wide, of pictures with y down.
fn frame(flags: u32) -> FrameConstants {
    let unit = |i: usize| [0, 1, 2, 3].map(|k| f32::from(u8::from(k == i)));
    FrameConstants {
        view_from_model: [unit(0), unit(1), unit(2), unit(3)],
        clip_from_view: [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, -1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, -1.0],
            [0.0, 0.0, NEAR, 0.0],
        ],
        ray_scale: [2.0 / SIZE as f32, -2.0 / SIZE as f32],
        ray_offset: [-1.0, 1.0],
        flags,
        ..FrameConstants::zeroed()
    }
}

fn light(frame: &FrameConstants, rect_px: [u32; 4], dropped_sign: i32) -> FrameLight {
    let screen = CornerScreen::new(frame, (SIZE, SIZE), 0, rect_px, dropped_sign);
    FrameLight::new(frame, screen).expect("a headlight")
}

fn vertex(position: Vec3, normal: Vec3) -> Vertex {
    Vertex {
        position,
        normal: octahedral::encode(normal),
        color: [255, 51, 0, 255],
    }
}

/// A wavy sheet all over the view, of cells of uneven size, in a distance of 3 to 5.
fn sheet(cells: u32) -> Model {
    let at = |i: u32| 1.3 * (2.0 * i as f32 / cells as f32 - 1.0);
    let place = |i: u32, k: u32| {
        let uneven = ((7 * i + 13 * k) % 11) as f32 * 0.25 / cells as f32 / 11.0;
        let z = 4.0 + (0.7 * i as f32).sin() * (0.4 * k as f32).cos();
        Vec3::new((at(i) + uneven) * z, (at(k) - uneven) * z, -z)
    };
    let row = cells + 1;
    let vertices = (0..row * row).map(|n| vertex(place(n % row, n / row), Vec3::Z));
    let cell = |n: u32| {
        let a = n / cells * row + n % cells;
        [[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]
    };
    Model {
        vertices: vertices.collect(),
        triangles: (0..cells * cells).flat_map(cell).collect(),
        ..Model::default()
    }
}

struct Drawn {
    front: Vec<f32>,
    sums: Vec<u64>,
}

fn drawn(triangles: &CutTriangles, model: &Model, canvas: PictureArea) -> Drawn {
    let mut front = vec![7; canvas.pixels()];
    let mut sums = vec![7; canvas.pixels() * canvas.words()];
    let list = DrawnSplats {
        splats: &[],
        meshes: &[SurfaceMesh::of(model)],
        triangles,
    };
    draw(list, canvas, &mut front, &mut sums);
    let front = front.into_iter().map(f32::from_bits).collect();
    Drawn { front, sums }
}

fn all(model: &Model) -> Vec<u32> {
    (0..model.triangles.len() as u32).collect()
}

/// Each pixel belongs to exactly one triangle of a sheet, in all of the picture and in a part of it, whichever triangles
/// are large: a weight of 1, no more and no less.
#[test]
fn neighbors_neither_overlap_nor_leave_a_gap() {
    for (cells, rect_px) in [
        (1, [0, 0, SIZE, SIZE]),
        (9, [0, 0, SIZE, SIZE]),
        (70, [0, 0, SIZE, SIZE]),
        (70, [13, 5, 77, 81]),
        (250, [0, 0, SIZE, SIZE]),
    ] {
        let model = sheet(cells);
        let canvas = PictureArea {
            rect_px,
            is_gray: true,
        };
        let frame = frame(0);
        let mut triangles = CutTriangles::default();
        // Of both sides, and those that are counter-clockwise, which are all.
        for dropped in [0, 1, -1] {
            let light = light(&frame, rect_px, dropped);
            assert!(triangles.set(&model, &all(&model), Some(light)));
            assert_eq!(triangles.count() == 0, dropped == -1, "{cells}, {dropped}");
            let drawn = drawn(&triangles, &model, canvas);
            let weight = if dropped == -1 { 0 } else { in_steps(1.0) };
            for (at, sums) in drawn.sums.chunks_exact(2).enumerate() {
                let what = format!("{cells} cells, {rect_px:?}, {dropped}, place {at}");
                assert_eq!(sums[0] >> 32, weight, "{what}");
                assert_eq!(sums[1], 0, "{what}");
                assert_eq!(drawn.front[at] > 0.0, dropped != -1, "{what}");
            }
        }
    }
}

/// A square whose corners are centers of pixels, of two triangles: what lies on its top or left edge belongs to it, and what
/// lies on the edge between them to one of them.
#[test]
fn a_center_on_an_edge_belongs_to_the_top_and_to_the_left() {
    let rect_px = [0, 0, SIZE, SIZE];
    let canvas = PictureArea {
        rect_px,
        is_gray: true,
    };
    let center = |pixel: u32| 2.0 * (pixel as f32 + 0.5) / SIZE as f32 - 1.0;
    let (low, high) = (20, 52);
    let corner = |x: u32, y: u32| vertex(Vec3::new(center(x), -center(y), -1.0), Vec3::Z);
    let model = Model {
        vertices: vec![
            corner(low, low),
            corner(high, low),
            corner(high, high),
            corner(low, high),
        ],
        triangles: vec![[0, 1, 2], [2, 3, 0]],
        ..Model::default()
    };
    let mut triangles = CutTriangles::default();
    assert!(triangles.set(&model, &[0, 1], Some(light(&frame(0), rect_px, 0))));
    let drawn = drawn(&triangles, &model, canvas);
    for (at, sums) in (0..).zip(drawn.sums.chunks_exact(2)) {
        let (x, y) = (at % SIZE, at / SIZE);
        let is_in = (low..high).contains(&x) && (low..high).contains(&y);
        assert_eq!(sums[0] >> 32, u64::from(is_in) * in_steps(1.0), "{x}, {y}");
    }
}

/// A plane z = -4 + x / 2, whose normal is turned by as much: closed forms of depth and shade at each pixel. In the light of the
/// eye and parallel to the view; with colors and without; in front of it another plane in a part of the picture.
#[test]
fn depth_and_shade_are_those_of_the_plane() {
    let normal = Vec3::new(-0.5, 0.0, 1.0).normalize();
    let corner = |x: f32, y: f32| vertex(Vec3::new(x, y, -4.0 + 0.5 * x), normal);
    let mut model = Model {
        vertices: vec![corner(7.0, -60.0), corner(7.0, 60.0), corner(-200.0, 0.0)],
        triangles: vec![[0, 1, 2]],
        ..Model::default()
    };
    // Behind it everywhere.
    let hidden = model.vertices.clone();
    let far = |v: &Vertex| vertex(v.position * 1.5, Vec3::Y);
    model.vertices.extend(hidden.iter().map(far));
    model.triangles.push([3, 4, 5]);
    let rect_px = [0, 0, SIZE, SIZE];
    for (flags, is_gray) in [
        (0, true),
        (FLAG_PARALLEL_LIGHT, true),
        (FLAG_USE_COLORS, false),
        (FLAG_COLOR_BY_PRIMITIVE | FLAG_USE_COLORS, false),
    ] {
        let frame = frame(flags);
        let mut triangles = CutTriangles::default();
        assert!(triangles.set(&model, &[0, 1], Some(light(&frame, rect_px, 0))));
        let drawn = drawn(&triangles, &model, PictureArea { rect_px, is_gray });
        let albedo = match flags {
            FLAG_USE_COLORS => ALBEDO * Vec3::new(1.0, 0.2, 0.0),
            _ if !is_gray => ALBEDO * TRIANGLE_TINT,
            _ => Vec3::splat(ALBEDO),
        };
        for (at, front) in drawn.front.iter().enumerate() {
            let pixel = |v: usize| 2.0 * (v as f32 + 0.5) / SIZE as f32 - 1.0;
            let ray = Vec3::new(pixel(at % SIZE as usize), -pixel(at / SIZE as usize), -1.0);
            // -t = -4 + t x / 2
            let distance = 4.0 / (1.0 + 0.5 * ray.x);
            let depth = NEAR / distance;
            // Corners lie in steps of 1/256 pixel.
            assert!((front - depth).abs() < 5e-5 * depth, "{front} {depth}");
            let to_light = if flags == FLAG_PARALLEL_LIGHT {
                Vec3::Z
            } else {
                -ray.normalize()
            };
            let shade = albedo * normal.dot(to_light);
            let sums = &drawn.sums[if is_gray { 2 } else { 4 } * at..];
            let low = |word: u64| (word & 0xffff_ffff) as f32 / COARSE_STEPS;
            let found = match is_gray {
                true => Vec3::splat(low(sums[0])),
                false => Vec3::new(low(sums[0]), low(sums[0] >> 32), low(sums[1])),
            };
            // A step of the sums, and what the code of the normal is off.
            let off = (found - shade).abs().max_element();
            assert!(off < 1.0 / COARSE_STEPS + 1e-4, "{found} {shade}");
            assert_eq!(sums[usize::from(!is_gray)] >> 32, in_steps(1.0));
        }
    }
}

/// What is cut by the near plane or lies farther out than whole steps reach is clipped; without a light that this renderer
/// knows there is nothing.
#[test]
fn what_the_near_plane_cuts_is_clipped() {
    let rect_px = [0, 0, SIZE, SIZE];
    let frame = frame(0);
    let light = light(&frame, rect_px, 0);
    let mut model = sheet(80);
    let ids = all(&model);
    let add = |model: &mut Model, z: Range<f32>, y: f32| {
        let first = model.vertices.len() as u32;
        let corners = [(-1.0, z.start), (1.0, z.start), (0.0, z.end)];
        let corners = corners.map(|(x, z)| vertex(Vec3::new(x, y, z), Vec3::Z));
        model.vertices.extend(corners);
        model.triangles.push([first, first + 1, first + 2]);
        model.triangles.len() as u32 - 1
    };
    let whole = add(&mut model, -3.0..-2.0, 0.3);
    let cut = add(&mut model, -3.0..-0.4, 0.3);
    let behind_too = add(&mut model, -3.0..2.0, 0.3);
    let behind = add(&mut model, 2.0..3.0, 0.3);
    let far_out = add(&mut model, -3.0..-2.0, 2000.0);
    let mut triangles = CutTriangles::default();
    let mut alone = |id: u32| {
        assert!(triangles.set(&model, &[id], Some(light)));
        let mut pixels = Vec::new();
        for NumberedFace { part, face, .. } in triangles.near([0, SIZE]) {
            assert_eq!(part.clipped.is_empty(), id == whole, "{id}");
            face.for_each_pixel([0, SIZE], |pixel, _| pixels.push(pixel));
        }
        let own: std::collections::BTreeSet<_> = pixels.iter().collect();
        assert_eq!(own.len(), pixels.len(), "{id}: pieces overlap");
        pixels
    };
    let (whole_px, cut_px, behind_px) = (alone(whole), alone(cut), alone(behind_too));
    assert!(!whole_px.is_empty());
    // Nearer and nearer to the eye, and before it, the triangle reaches farther in the picture.
    assert!(cut_px.len() > whole_px.len());
    assert!(behind_px.len() > cut_px.len());
    for pixel in &whole_px {
        assert!(
            cut_px.contains(pixel) && behind_px.contains(pixel),
            "{pixel:?}"
        );
    }
    assert!(alone(behind).is_empty());
    assert!(alone(far_out).is_empty());
    assert!(triangles.set(&model, &ids, Some(light)));
    assert!(!triangles.set(&model, &ids, None));
    assert!(triangles.set(&model, &ids, Some(light)));
    assert!(triangles.set(&model, &[], None));
    assert_eq!(triangles.count(), 0);
    for flag in [
        FLAG_PHONG,
        FLAG_COLOR_BY_LEVEL,
        FLAG_COLOR_BY_NORMAL,
        FLAG_COLOR_BY_DEPTH,
    ] {
        let frame = crate::render::cpu::triangles::tests::frame(flag | FLAG_USE_COLORS);
        assert!(FrameLight::new(&frame, light.screen).is_none(), "{flag}");
    }
}
