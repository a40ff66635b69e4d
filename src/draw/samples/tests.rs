#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use super::*;
use crate::abi::Vertex;
use crate::generate::{self, Shape, Spec};
use crate::math::octahedral;
use crate::progress::Silent;
use crate::tree::{self, BuildOptions};
use bytemuck::Zeroable;
use glam::{DVec3, Vec3};

/// Every way that this processor has.
fn levels() -> Vec<Level> {
    let mut levels = vec![Level::baseline(), Level::new()];
    #[cfg(target_arch = "x86_64")]
    {
        levels.extend(Level::new().as_sse4_2().map(Level::Sse4_2));
        levels.extend(Level::new().as_avx2().map(Level::Avx2));
    }
    levels
}

/// A view along y from so far away, as the device has it: the near plane, where depth is 1, at a distance of 0.5.
fn screen(distance: f32, size: u32) -> Screen {
    let frame = FrameConstants {
        view_from_model: [
            [0.8, 0.1, 0.6, 0.0],
            [0.6, 0.0, -0.8, 0.0],
            [0.0, 1.0, 0.1, 0.0],
            [0.1, 0.05, -distance, 1.0],
        ],
        clip_from_view: [
            [2.0, 0.0, 0.0, 0.0],
            [0.0, -2.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, -1.0],
            [0.0, 0.0, 0.5, 0.0],
        ],
        ..FrameConstants::zeroed()
    };
    Screen::new(&frame, (size, size), 3, [10, 0, size - 10, size], 1)
}

/// Small triangles, needles, triangles of many pixels and none, more samples than there is room for, and what is behind
/// the near plane.
#[test]
fn every_width_of_vectors_writes_the_same_bytes() {
    let mut numbers = [0; 2];
    for (shape, triangles, size) in [
        (Shape::Statue, 40_000, 300),
        (Shape::Torus, 30_000, 400),
        (Shape::Sphere, 3_000, 500),
        (Shape::Sphere, 3_000, 60),
    ] {
        let spec = Spec::with_triangles(shape, triangles).unwrap();
        let mesh = generate::mesh(&spec);
        let model = tree::build(mesh, &BuildOptions::default(), &Silent).unwrap();
        // Gaps, and a number of triangles that no vector divides.
        let ids: Vec<u32> = (0..model.triangles.len() as u32 - 3)
            .filter(|id| id % 7 != 3)
            .collect();
        for distance in [1.0, 4.0] {
            let screen = screen(distance, size);
            let pack = |level| {
                let mut out = vec![Splat::zeroed(); room(ids.len())];
                let mut rest = Rest::new();
                let count = pack_by(level, &model, &ids, &screen, (&mut rest, &mut out));
                let bytes: Vec<u8> = bytemuck::cast_slice(&out[..count]).to_vec();
                (bytes, rest)
            };
            let (bytes, rest) = pack(Level::baseline());
            let all: Vec<u32> = rest.iter().flatten().copied().collect();
            assert!(all.is_sorted(), "they are drawn page by page");
            numbers[0] += bytes.len() / size_of::<Splat>();
            numbers[1] += all.len();
            for level in levels() {
                let what = format!("{shape:?}, {size}, {distance}, {level:?}");
                assert!(pack(level) == (bytes.clone(), rest.clone()), "{what}");
            }
        }
    }
    assert!(numbers[0] > 10_000 && numbers[1] > 3_000, "{numbers:?}");
}

/// Interpolated in double precision, as the shader of triangles does it.
fn normal(corners: [&Vertex; 3], weights: [f32; 3]) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for (corner, weight) in corners.into_iter().zip(weights) {
        if corner.color[3] != 0 {
            sum += f64::from(weight) * octahedral::decode(corner.normal).as_dvec3();
        }
    }
    sum.normalize_or_zero()
}

/// As `shaders/compute/resolve_splats.frag` reads a normal.
fn decoded(splat: &Splat) -> DVec3 {
    let fine = splat.radius.to_bits() as i32;
    assert!(fine < 0, "marked");
    let left = [fine << 17 >> 17, fine << 2 >> 17].map(|v| f64::from(v) / 16384.0);
    let [x, y] =
        [0, 1].map(|i| ((f64::from(splat.normal[i]) + left[i]) / 32767.0).clamp(-1.0, 1.0));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    DVec3::new(x - fold.copysign(x), y - fold.copysign(y), z).normalize()
}

#[test]
fn a_normal_is_as_exact_as_that_of_a_triangle() {
    let vertex = |i: u32| {
        let angle = |step: f32| (i as f32 * step).sin();
        let direction = Vec3::new(angle(0.7), angle(1.3), angle(2.9));
        Vertex {
            position: Vec3::new(angle(0.1), angle(0.2), angle(0.3)),
            normal: octahedral::encode(direction),
            color: [
                i as u8,
                255 - i as u8,
                7,
                if i.is_multiple_of(11) { 0 } else { 255 },
            ],
        }
    };
    for level in levels() {
        let (mut worst, mut without) = (0.0f64, 0);
        for round in 0..200 {
            let mut queue = Queue::new();
            let vertices: Vec<Vertex> = (round * 40..round * 40 + 39).map(vertex).collect();
            let of = |i: usize| {
                let corners = [&vertices[i], &vertices[i + 1], &vertices[i + 2]];
                (corners, [1.0 + i as f32, 5.0, 0.25 * i as f32])
            };
            for (corners, weights) in (0..37).map(of) {
                queue.push(corners, weights);
            }
            let mut found = Vec::new();
            dispatch!(level, simd => queue.empty(simd, |splat| found.push(splat)));
            assert_eq!((queue.len(), found.len()), (0, 37));
            for (splat, (corners, weights)) in found.iter().zip((0..37).map(of)) {
                let sum: f32 = weights.iter().sum();
                let mean = |of: &dyn Fn(&Vertex) -> f32| -> f32 {
                    let terms = corners.iter().zip(weights).map(|(c, w)| of(c) * w / sum);
                    terms.sum()
                };
                for axis in 0..3 {
                    assert!((splat.center[axis] - mean(&|v| v.position[axis])).abs() < 1e-6);
                    let color = mean(&|v| f32::from(v.color[axis]));
                    assert!((f32::from(splat.color[axis]) - color).abs() < 0.501);
                }
                let wanted = normal(corners, weights);
                assert_eq!(splat.color[3], if wanted == DVec3::ZERO { 0 } else { 255 });
                if wanted == DVec3::ZERO {
                    without += 1;
                } else {
                    let is = decoded(splat);
                    worst = worst.max(is.cross(wanted).length().atan2(is.dot(wanted)));
                }
            }
        }
        // A few roundings of single precision, where 2 x 16 bits alone leave 6e-5 and terms may cancel.
        assert!(worst < 3e-6 && without == 0, "{worst} {without}");
    }
}
