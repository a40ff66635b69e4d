use crate::cut::CutSettings;
use crate::cut::occlusion::filter_lists::retain;
use crate::cut::occlusion::*;
use crate::cut::siblings;
use crate::cut::siblings::SphereLanes;
use crate::math::camera::Camera;
use crate::simd::WideLanes;
use crate::tree::Model;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};
use glam::{DVec3, Vec3};

/// Numbers from 0 to 1 that are the same every time.
fn numbers() -> impl FnMut() -> f32 {
    let mut state = 0x9e37_79b9_u32;
    move || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state as f32 / u32::MAX as f32
    }
}

/// Squares of triangles that hide one another.
fn squares(side_px: f32) -> SplatFootprints {
    SplatFootprints {
        side_px,
        hides: true,
        are_discs: false,
        large_leaves: false,
        is_cloud: false,
    }
}

/// Views of the unit ball, which an empty model counts as.
fn views() -> Vec<View> {
    let mut views: Vec<View> = [1.0, 3.0]
        .map(|fill| Camera::orbit((40, 30), DVec3::ZERO, 1.0, 0.7, 0.3, fill))
        .iter()
        .map(|camera| camera.view(DVec3::ZERO).expect("a usable camera"))
        .collect();
    let mut parallel = views[0];
    parallel.is_perspective = false;
    parallel.scale = [0.8; 2];
    parallel.offset = [0.05, -0.1];
    views.push(parallel);
    views
}

/// Where a point is seen, double precision: pixels and distance.
fn seen_at(view: &View, point: Vec3) -> [f64; 3] {
    let p = view
        .view_from_model
        .as_dmat4()
        .transform_point3(DVec3::from(point));
    let [sx, sy] = view.scale.map(f64::from);
    let [ox, oy] = view.offset.map(f64::from);
    let (x, y) = if view.is_perspective {
        (sx * p.x / -p.z - ox, sy * p.y / -p.z - oy)
    } else {
        (sx * p.x + ox, sy * p.y + oy)
    };
    [
        (x + 1.0) / 2.0 * f64::from(view.width),
        (1.0 - y) / 2.0 * f64::from(view.height),
        -p.z,
    ]
}

fn place<S: Simd>(
    simd: S,
    hiding: &OcclusionTest<'_>,
    chunk: &mut SplatChunk,
    (splats, lanes): (&[Vec<f32>; 4], (u32, u32)),
) {
    let first = |list: &Vec<f32>| WideLanes::load(simd, &list[..WideLanes::<S>::LANES]);
    hiding.place(simd, chunk, 0, splats.each_ref().map(first), lanes);
}

/// Which of four nodes are not hidden so far; each leaves a mark.
fn keep_nodes(
    hiding: &OcclusionTest<'_>,
    balls: &SphereLanes,
    first: u32,
    marks: &mut Vec<DepthMark>,
) -> u64 {
    let mut chunk = SplatChunk::default();
    let [x, y] = hiding.centers.along(balls.center);
    // Where splats are samples, balls that contain any center: what is left out is as for squares.
    let radius = if hiding.is_exact() {
        f32::INFINITY
    } else {
        0.0
    };
    // The four again and again, of which the first are asked for.
    let [x, y, z] = [x, y, balls.depth].map(|v| [v.to_array(); 4].concat());
    let lanes = (15, u32::from(hiding.undrawn_nodes(first)));
    let splats = [x, y, z, vec![radius; 16]];
    dispatch!(Level::new(), simd => place(simd, hiding, &mut chunk, (&splats, lanes)));
    dispatch!(Level::new(), simd => hiding.ask(simd, &mut chunk, marks)).words()[0]
}

/// Brute force over random splats: what is dropped is covered in each of its pixels, and in those that it would have half a
/// step of window positions farther on, by a nearer one that is half a step smaller and was kept.
#[test]
fn what_is_dropped_is_covered() {
    let model = Model::default();
    let mut number = numbers();
    for (view, (side_px, bits)) in views().into_iter().flat_map(|view| {
        [(0.4, 8), (0.9, 4), (1.0, 4), (1.0, 8), (1.5, 4), (3.2, 8)].map(|side| (view, side))
    }) {
        let half_step = 0.5 / f64::from(1 << bits);
        let tester = NodeTester::new(&model, &view, &CutSettings::default());
        let mut nearest = SoftwareDepthBuffer::default();
        assert!(nearest.clear(view.width, view.height));
        let undrawn = ZeroAreaSet::default();
        let footprints = squares(side_px);
        let hiding = OcclusionTest::new(&nearest, &tester, &view, (footprints, &undrawn), bits);
        // Four layers within the picture, and a little beside it.
        let points: Vec<Vec3> = (0..6000)
            .map(|_| Vec3::new(number(), number(), number()) * 2.0 - 1.0)
            .collect();
        let mut marks = Vec::new();
        let mut found = Vec::new();
        for (index, four) in points.as_chunks::<4>().0.iter().enumerate() {
            let balls = tester.balls(siblings::columns(four.map(|p| p.extend(0.0))));
            let kept = keep_nodes(&hiding, &balls, 0, &mut marks);
            found.extend((0..4).filter(|i| kept >> i & 1 != 0).map(|i| 4 * index + i));
        }
        assert_eq!(found.len(), marks.len());
        let mut is_kept = vec![false; points.len()];
        for (&index, &mark) in found.iter().zip(&marks) {
            is_kept[index] = !hiding.is_hidden(mark);
        }
        let places: Vec<[f64; 3]> = points.iter().map(|&p| seen_at(&view, p)).collect();
        let covers = |place: &[f64; 3], pixel: [f64; 2], more: f64| {
            let half = f64::from(side_px) / 2.0 + more;
            (pixel[0] - place[0]).abs() <= half && (pixel[1] - place[1]).abs() <= half
        };
        let is_in = |z: f64| z > f64::from(view.near) && z < f64::from(view.far);
        let mut dropped = 0;
        for (place, _) in places.iter().zip(&is_kept).filter(|(_, kept)| !**kept) {
            dropped += 1;
            for y in 0..view.height {
                for x in 0..view.width {
                    let pixel = [f64::from(x) + 0.5, f64::from(y) + 0.5];
                    let is_covered = || {
                        places.iter().zip(&is_kept).any(|(other, &kept)| {
                            kept && other[2] < place[2]
                                && is_in(other[2])
                                && covers(other, pixel, -half_step)
                        })
                    };
                    assert!(
                        !covers(place, pixel, half_step) || is_covered(),
                        "{place:?} of side {side_px} at {x} {y}"
                    );
                }
            }
        }
        let kept = points.len() - dropped;
        assert!(
            dropped > 1000 && kept > 500,
            "{dropped} of {}",
            points.len()
        );
    }
}

fn are_behind<S: Simd>(simd: S, hiding: &OcclusionTest<'_>, balls: &SphereLanes) -> u32 {
    // The four again and again.
    let lane =
        |v: Vec4| WideLanes::load(simd, &[v.to_array(); 4].concat()[..WideLanes::<S>::LANES]);
    let [x, y, z] = balls.center.map(lane);
    let balls = SphereLanes {
        center: [x, y, z],
        radius: lane(balls.radius),
        depth: lane(balls.depth),
    };
    hiding.are_behind(&balls, 15)
}

/// Brute force over random balls of some pixels behind and among random splats: of those that are dropped every splat of a pixel
/// that lies in the ball has only pixels that hold something nearer, though a device may place it half a step of window
/// positions elsewhere.
#[test]
fn all_in_a_node_that_is_dropped_is_hidden() {
    let model = Model::default();
    let mut number = numbers();
    for mut view in views() {
        // Of balls that are large as angles nothing is known.
        (view.width, view.height) = (400, 300);
        let tester = NodeTester::new(&model, &view, &CutSettings::default());
        let mut nearest = SoftwareDepthBuffer::default();
        assert!(nearest.clear(view.width, view.height));
        let undrawn = ZeroAreaSet::default();
        let footprints = squares(1.0);
        let hiding = OcclusionTest::new(&nearest, &tester, &view, (footprints, &undrawn), 8);
        let half_step = 0.5 / 256.0;
        // A rough front, with holes beside it.
        let mut marks = Vec::new();
        for _ in 0..20_000 {
            let four = [0; 4].map(|_| {
                let [x, y, z] = [number(), number(), number()].map(|v| 2.0 * v - 1.0);
                let across = view.backward.any_orthonormal_pair();
                view.backward * (0.3 + 0.02 * z) + (across.0 * x + across.1 * y) * 0.15
            });
            let balls = tester.balls(siblings::columns(four.map(|p| p.extend(0.0))));
            keep_nodes(&hiding, &balls, 0, &mut marks);
        }
        let depth_of = |x: f64, y: f64| {
            let pixel = y as usize * view.width as usize + x as usize;
            f32::from_bits(nearest.pixels[pixel].load(Ordering::Relaxed))
        };
        let pixel = 1.0 / view.focal_px();
        let [mut dropped, mut kept, mut looked_at] = [0; 3];
        for _ in 0..4000 {
            let balls: [Vec4; 4] = std::array::from_fn(|_| {
                let center = (Vec3::new(number(), number(), number()) * 2.0 - 1.0) * 0.25;
                center.extend(pixel * (3.0 + 12.0 * number() * number()))
            });
            let there = tester.balls(siblings::columns(balls));
            let behind = dispatch!(Level::new(), simd => are_behind(simd, &hiding, &there));
            for (lane, ball) in balls.into_iter().enumerate() {
                if behind >> lane & 1 == 0 {
                    kept += 1;
                    continue;
                }
                dropped += 1;
                for _ in 0..200 {
                    let way = Vec3::new(number() - 0.5, number() - 0.5, number() - 0.5);
                    let point = ball.truncate() + way.normalize_or_zero() * ball.w;
                    let [x, y, z] = seen_at(&view, point);
                    let distance = (z - f64::from(view.near)) / f64::from(view.model_scale);
                    let more = 0.5 + half_step;
                    let columns = (x - more - 0.5).ceil()..=(x + more - 0.5).floor();
                    let rows = (y - more - 0.5).ceil()..=(y + more - 0.5).floor();
                    let within = |v: f64, size: u32| v >= 0.0 && v < f64::from(size);
                    for (i, j) in [
                        (*columns.start(), *rows.start()),
                        (*columns.start(), *rows.end()),
                        (*columns.end(), *rows.start()),
                        (*columns.end(), *rows.end()),
                    ] {
                        if within(i, view.width) && within(j, view.height) {
                            looked_at += 1;
                            let nearer = f64::from(depth_of(i, j) / tester.unit);
                            assert!(nearer < distance, "{ball:?} at {i} {j}: {nearer}");
                        }
                    }
                }
            }
        }
        assert!(
            dropped > 100 && kept > 1000 && looked_at > 10_000,
            "{dropped}, {kept}, {looked_at}"
        );
    }
}

/// What another thread has stored over is there again before anything is asked for the last time.
#[test]
fn depths_that_were_stored_over_come_back() {
    let model = Model::default();
    let view = views()[0];
    let tester = NodeTester::new(&model, &view, &CutSettings::default());
    let undrawn = ZeroAreaSet::default();
    let footprints = squares(1.0);
    let mut nearest = SoftwareDepthBuffer::default();
    assert!(nearest.clear(view.width, view.height));
    let hiding = OcclusionTest::new(&nearest, &tester, &view, (footprints, &undrawn), 8);
    let mut number = numbers();
    let mut marks = DepthMarks::default();
    for round in 0..1000 {
        let four = [0; 4].map(|_| Vec3::new(number(), number(), number()) * 2.0 - 1.0);
        let balls = tester.balls(siblings::columns(four.map(|p| p.extend(0.0))));
        let list = [&mut marks.nodes, &mut marks.strips, &mut marks.leaves];
        for (index, list) in list.into_iter().enumerate() {
            if index == round % 3 {
                keep_nodes(&hiding, &balls, 0, list);
            }
        }
    }
    let depths = || -> Vec<u32> {
        let pixels = nearest.pixels.iter();
        pixels.map(|pixel| pixel.load(Ordering::Relaxed)).collect()
    };
    let expected = depths();
    let lost = |&&depth: &&u32| depth != NOTHING;
    assert!(expected.iter().filter(lost).count() > 300);
    for pixel in &nearest.pixels {
        pixel.store(NOTHING, Ordering::Relaxed);
    }
    hiding.repair(&marks);
    assert_eq!(depths(), expected);
}

/// Brute force over random balls, at the corners of the picture too: of those that are dropped no point is seen at the center
/// of a pixel, and of those that count as one none but at that of their middle's pixel, though a device may place it half a
/// step of window positions elsewhere.
#[test]
fn balls_contain_no_other_centers_than_is_said() {
    let model = Model::default();
    let mut number = numbers();
    for view in views() {
        let tester = NodeTester::new(&model, &view, &CutSettings::default());
        let mut nearest = SoftwareDepthBuffer::default();
        assert!(nearest.clear(view.width, view.height));
        let undrawn = ZeroAreaSet::default();
        let footprints = squares(1.0);
        let hiding = OcclusionTest::new(&nearest, &tester, &view, (footprints, &undrawn), 4);
        let pixel = 1.0 / view.focal_px();
        let [mut dropped, mut kept, mut ones] = [0; 3];
        for _ in 0..1500 {
            let balls: [Vec4; 4] = std::array::from_fn(|_| {
                let center = (Vec3::new(number(), number(), number()) * 2.0 - 1.0) * 0.7;
                center.extend(2.0 * pixel * number())
            });
            let balls_there = tester.balls(siblings::columns(balls));
            let stays = !hiding.centers.none(&balls_there);
            let (none, one) = hiding.centers.of(&balls_there);
            assert_eq!(none, !stays);
            ones += one.count_ones();
            for (lane, ball) in balls.into_iter().enumerate() {
                // What is beside the picture may be said to contain anything.
                let middle = seen_at(&view, ball.truncate());
                let sides = [view.width, view.height].map(f64::from);
                if (0..2).any(|i| middle[i] < 0.0 || middle[i] > sides[i]) {
                    continue;
                }
                let is_kept = stays >> lane & 1 != 0;
                if is_kept {
                    kept += 1;
                } else {
                    dropped += 1;
                }
                if is_kept && one >> lane & 1 == 0 {
                    continue;
                }
                // Its rim as the eye sees it.
                let (center, radius) = (ball.truncate(), ball.w);
                let backward = match view.is_perspective {
                    true => (view.eye - center).normalize(),
                    false => view.backward,
                };
                let across = backward.any_orthonormal_pair();
                let reach = (0..64)
                    .map(|i| {
                        let (sine, cosine) = (i as f32 * 0.1).sin_cos();
                        let at = center + (across.0 * cosine + across.1 * sine) * radius;
                        let at = seen_at(&view, at);
                        (at[0] - middle[0]).hypot(at[1] - middle[1])
                    })
                    .fold(0.0, f64::max);
                let off = |v: f64| (v - v.floor() - 0.5).abs();
                let [x, y] = [off(middle[0]), off(middle[1])];
                let next = match is_kept {
                    true => (1.0 - x.max(y)).hypot(x.min(y)),
                    false => x.hypot(y),
                };
                assert!(next > reach + 1.0 / 32.0, "{ball:?}: {next} of {reach}");
                assert!(!is_kept || x.max(y) < 0.5 - 1.0 / 32.0, "{ball:?}");
            }
        }
        assert!(
            dropped > 500 && kept > 500 && ones > 300,
            "{dropped}, {kept}, {ones}"
        );
    }
}

/// Ends of levels move along with what is left of a list.
#[test]
fn ends_move_along_and_huge_pictures_are_refused() {
    assert!(!SoftwareDepthBuffer::default().clear(1 << 16, 1));
    let mut list: Vec<u32> = (0..10).collect();
    let mut ends = [0, 3, 3, 7, 10];
    retain(&mut list, |_, item| *item % 3 == 0, ends.iter_mut());
    assert_eq!(list, [0, 3, 6, 9]);
    assert_eq!(ends, [0, 1, 1, 3, 4]);
}

#[test]
fn nothing_is_dropped_where_nothing_is_covered() {
    let model = Model::default();
    let view = views()[0];
    let tester = NodeTester::new(&model, &view, &CutSettings::default());
    let undrawn = ZeroAreaSet {
        nodes: vec![u64::MAX],
        leaves: Vec::new(),
    };
    let footprints = squares(2.0);
    let mut nearest = SoftwareDepthBuffer::default();
    assert!(nearest.clear(view.width, view.height));
    let hiding = OcclusionTest::new(&nearest, &tester, &view, (footprints, &undrawn), 4);
    let mut marks = Vec::new();
    let middle = tester.balls(siblings::columns(
        [0.3, 0.0, -0.3, f32::NAN].map(|t| (view.backward * t).extend(0.0)),
    ));
    // Without area: all stay. Then the nearest hides two of them, and not what is no number.
    for _ in 0..2 {
        assert_eq!(keep_nodes(&hiding, &middle, 0, &mut marks), 15);
    }
    assert_eq!(keep_nodes(&hiding, &middle, 64, &mut marks) & 9, 9);
    assert_eq!(keep_nodes(&hiding, &middle, 64, &mut marks), 9);
}
