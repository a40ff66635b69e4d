//! Samples beside triangles as they are, and the same bytes whatever the width of vectors.
#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use crate::abi::Vertex;
use crate::generate::{self, GeneratedShape, ShapeSpec};
use crate::math::octahedral;
use crate::pack::for_tests::levels;
use crate::pack::small_triangles::coverage::LANES;
use crate::pack::small_triangles::*;
use crate::progress::SilentProgress;
use crate::textures::{TextureImage, TextureLevel, WeightSteps, WrapMode};
use crate::tree::{self, BuildOptions};
use bytemuck::Zeroable;
use glam::{DVec3, Vec2};

/// A view along y from so far away, as the device has it: the near plane, where depth is 1, at a distance of 0.5.
fn screen(distance: f32, size: u32) -> CornerScreen {
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
    CornerScreen::new(&frame, (size, size), 3, [10, 0, size - 10, size], 1)
}

/// Small triangles, needles, triangles of many pixels and none, more samples than there is room for, and what is behind
/// the near plane.
#[test]
fn every_width_of_vectors_writes_the_same_bytes() {
    let mut numbers = [0; 2];
    for (shape, triangles, size) in [
        (GeneratedShape::Statue, 40_000, 300),
        (GeneratedShape::Torus, 30_000, 400),
        (GeneratedShape::Sphere, 3_000, 500),
        (GeneratedShape::Sphere, 3_000, 60),
    ] {
        let spec = ShapeSpec::with_triangles(shape, triangles).unwrap();
        let mesh = generate::mesh(&spec);
        let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
        // Gaps, and a number of triangles that no vector divides.
        let ids: Vec<u32> = (0..model.triangles.len() as u32 - 3)
            .filter(|id| id % 7 != 3)
            .collect();
        for distance in [1.0, 4.0] {
            let screen = screen(distance, size);
            let pack = |level| {
                let mut out = vec![Splat::zeroed(); room(ids.len(), &screen)];
                let mut rest = LargeTriangles::new();
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

/// Of a surface seen from the front triangles cover more pixels than in the mean: they have room while there are pixels for it,
/// and not beyond.
#[test]
fn there_is_room_where_a_surface_is_seen_from_the_front() {
    let mesh = generate::mesh(&ShapeSpec::with_triangles(GeneratedShape::Sphere, 30_000).unwrap());
    let model = tree::build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
    let ids: Vec<u32> = (0..model.triangles.len() as u32).collect();
    let found = |size| {
        let screen = screen(4.0, size);
        let room = room(ids.len(), &screen);
        let mut out = vec![Splat::zeroed(); room];
        let mut rest = LargeTriangles::new();
        let samples = pack(&model, &ids, &screen, &mut rest, &mut out);
        (samples, rest.iter().flatten().count(), room)
    };
    // Nearly four samples of each triangle that is in front, and five in the middle; few may cover more than a word has bits.
    for (size, least, most_left) in [(400, 34_000, 0), (500, 53_000, 100)] {
        let (samples, left, room) = found(size);
        assert!(samples >= least && left <= most_left, "{samples} {left}");
        let parts = ids.len().div_ceil(parallel::PART);
        let pixels = (size * (size - 20)) as usize;
        let most = 2 * ids.len() + 3 * pixels / 2 + parts * MOST_PIXELS as usize;
        assert!(room <= most, "{room} {most}");
    }
    // No pixels are drawn: two of each triangle are enough.
    let parts = ids.len().div_ceil(parallel::PART);
    let most = 2 * ids.len() + parts * MOST_PIXELS as usize;
    assert!(room(ids.len(), &screen(4.0, 20)) <= most);
}

/// Numbers in 0..1, the same in every run.
fn random(mut state: u64) -> impl FnMut() -> f64 {
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        f64::from((state >> 40) as u32) / f64::from(1 << 24)
    }
}

/// Triangles of some 40 to 250 steps, thick enough: a step is a hundredth of them.
#[test]
fn weights_are_those_of_triangles_as_they_are() {
    let screen = screen(2.0, 400);
    let mut next = random(7);
    let in_window = |p: &[f64; 3]| {
        let times = |row: &[f32; 4]| {
            (0..3).map(|i| f64::from(row[i]) * p[i]).sum::<f64>() + f64::from(row[3])
        };
        let [x, y, z] = [0, 1, 2].map(|i| times(&screen.view[i]));
        let along = |i: usize| f64::from(screen.along[i][0]) * z + f64::from(screen.along[i][1]);
        let w = along(3);
        let place = |v: f64, i: usize| {
            let clip = v * f64::from(screen.across[i]) + along(i);
            (clip / w * 0.5 + 0.5) * f64::from(screen.viewport_px[i]) - f64::from(screen.guard_px)
        };
        ([place(x, 0), place(y, 1)], 1.0 / w)
    };
    let mut compared = 0;
    for _ in 0..3000 {
        let mut positions = CornerPositions([[[0.0; BLOCK]; 3]; 3]);
        let mut corners = [[[0.0; 3]; 3]; LANES];
        for (lane, corners) in corners.iter_mut().enumerate() {
            let middle = [0, 1, 2].map(|_| 0.6 * next() - 0.3);
            for (corner, rows) in corners.iter_mut().zip(&mut positions.0) {
                for axis in 0..3 {
                    let at = (middle[axis] + 0.004 * (next() - 0.5)) as f32;
                    rows[axis][lane] = at;
                    corner[axis] = f64::from(at);
                }
            }
        }
        for level in levels() {
            let mut covered = CoveredCenters::NOTHING;
            dispatch!(level, simd => covered.ask(simd, &screen, &positions, 0));
            for lane in set_bits(covered.some & covered.known) {
                let [a, b, c] = corners[lane].map(|corner| in_window(&corner));
                let cross = |[ax, ay]: [f64; 2], [bx, by]: [f64; 2], [cx, cy]: [f64; 2]| {
                    (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
                };
                let area = cross(a.0, b.0, c.0);
                let longest =
                    [(a, b), (b, c), (c, a)].map(|(p, q)| (p.0[0] - q.0[0]).hypot(p.0[1] - q.0[1]));
                if area.abs() < 0.15 * longest.into_iter().fold(0.0, f64::max) {
                    continue;
                }
                // The first of its pixels is covered or not; its weights are known in any case.
                let first = |of: usize| {
                    let low = [a, b, c]
                        .map(|p| p.0[of])
                        .into_iter()
                        .fold(f64::MAX, f64::min);
                    (low - 0.5 - 1e-6).ceil() + 0.5
                };
                let near = [a, b, c].iter().flat_map(|p| p.0).any(|v| {
                    let from_center = (v - 0.5).abs().fract();
                    !(0.01..=0.99).contains(&from_center)
                });
                if near {
                    continue;
                }
                let at = [first(0), first(1)];
                if at[0] < 11.0 || at[1] < 1.0 {
                    // It may begin beside what is drawn.
                    continue;
                }
                let wanted = [
                    cross(b.0, c.0, at) / area * a.1,
                    cross(c.0, a.0, at) / area * b.1,
                    cross(a.0, b.0, at) / area * c.1,
                ];
                let is = [0, 1, 2].map(|i| {
                    f64::from(covered.values[i][lane]) * f64::from(covered.inverse_w[i][lane])
                });
                let (all, sum) = (wanted.iter().sum::<f64>(), is.iter().sum::<f64>());
                for (wanted, is) in wanted.into_iter().zip(is) {
                    let off = (wanted / all - is / sum).abs();
                    assert!(off < 3e-3, "{off} {wanted} {is} {area}");
                }
                compared += 1;
            }
        }
    }
    assert!(compared > 1000, "{compared}");
}

/// Needles in every direction, of which corners are moved by more than they are thick: what stands for a pixel lies at its
/// center, by the steps that corners are moved by, and no pixel is left out.
#[test]
fn what_stands_for_a_pixel_is_at_its_center() {
    let screen = screen(2.0, 400);
    let mut next = random(11);
    let mut mesh = Model::default();
    for _ in 0..60_000 {
        let middle = [0, 1, 2].map(|_| 0.8 * next() - 0.4);
        let along = [0, 1, 2].map(|_| 0.03 * (next() - 0.5));
        let first = mesh.vertices.len() as u32;
        for part in [-1.0, next() - 0.5, 1.0] {
            let at = |axis: usize| {
                let thin = 2e-4 * (next() - 0.5);
                (middle[axis] + part * along[axis] + thin) as f32
            };
            let [x, y, z] = [0, 1, 2].map(at);
            mesh.vertices.push(Vertex {
                position: Vec3::new(x, y, z),
                normal: [0, 0],
                color: [255; 4],
            });
        }
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    let ids: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
    let mut out = vec![Splat::zeroed(); room(ids.len(), &screen)];
    let count = pack(&mesh, &ids, &screen, &mut LargeTriangles::new(), &mut out);
    assert!(count > 500, "{count}");
    for splat in &out[..count] {
        let placed = screen.place(splat.center).unwrap();
        for step in placed.steps {
            let off = (step - 128.0).rem_euclid(256.0);
            // Half a step by rounding, and what single precision adds.
            assert!(off.min(256.0 - off) < 0.75, "{off} {splat:?}");
        }
    }
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

/// Color of a splat with its rest, as `shaders/compute/resolve_splats.frag` reads it; 0 to 255.
fn color_of(splat: &Splat) -> [f32; 3] {
    let fine = splat.radius.rest();
    let left = [7, 4, 1].map(|up: u32| (fine << up >> 29) as f32 / 8.0);
    [0, 1, 2].map(|i| f32::from(splat.color[i]) + left[i])
}

/// Normal of a splat with its rest, as that shader reads it.
fn decoded(splat: &Splat) -> DVec3 {
    let fine = splat.radius.rest();
    assert!(fine < 0, "marked");
    let left = [fine << 21 >> 21, fine << 10 >> 21].map(|v| f64::from(v) / 1024.0);
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
    let texels = (0..4096_u32).map(|i| [i as u8, (i / 16) as u8, (i * 7) as u8, 255]);
    let texels = TextureLevel::new(64, 64, texels.collect()).unwrap();
    let image = TextureImage::new("a", [64; 2], [WrapMode::Repeat; 2], texels);
    for level in levels() {
        let (mut worst, mut without) = (0.0f64, 0);
        for round in 0..200 {
            let mut queue = ShadingQueue::new();
            let vertices: Vec<Vertex> = (round * 40..round * 40 + 39).map(vertex).collect();
            let of = |i: usize| {
                let corners = [&vertices[i], &vertices[i + 1], &vertices[i + 2]];
                (corners, [1.0 + i as f32, 5.0, 0.25 * i as f32])
            };
            // Every other one shows an image.
            let texture_of = |[a, b, c]: [f32; 3]| {
                let places = [
                    Vec2::new(0.1, a.sin()),
                    Vec2::new(0.4, 0.3),
                    Vec2::new(0.2, 0.7),
                ];
                let steps = WeightSteps {
                    right: Vec3::new(b, -a, 0.3 * c) * 0.02,
                    down: Vec3::new(0.2, -0.1, c * 0.05),
                };
                (a as u32).is_multiple_of(2).then_some((places, steps))
            };
            let own = |weights: [f32; 3]| {
                let (places, steps) = texture_of(weights)?;
                Some(image.seen(&places, weights.into(), steps) * 255.0)
            };
            for (corners, weights) in (0..37).map(of) {
                if let Some((places, steps)) = texture_of(weights) {
                    queue.push_texture(&image, places, steps);
                }
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
                    let of_corners = mean(&|v| f32::from(v.color[axis]));
                    let color = own(weights).map_or(of_corners, |own| own[axis]);
                    assert!((f32::from(splat.color[axis]) - color).abs() < 0.563);
                    assert!(
                        (color_of(splat)[axis] - color).abs() < 0.063,
                        "three bits more"
                    );
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
