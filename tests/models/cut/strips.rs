//! Rows of splats along needles: they cover what their node contains, and they save work.

use super::leaves_below;
use super::testing::{Random, Strips, chaos, look, look_flat, model, torus};
use glam::DVec3;
use surfel::cut::{
    Cut, CutSettings, MAX_STRIP_COUNT, NodeTester, SizeMetric, select, strip_ball_radius,
    strip_center, strip_centers,
};
use surfel::tree::NodeStrip;

#[test]
fn the_balls_of_a_row_are_small_and_cover_all_triangles_below() {
    let mut random = Random(1);
    let mut needles = chaos(3000, 4);
    for triangle in &mut needles {
        // Long along x, thin across.
        let c = triangle[0];
        *triangle = triangle.map(|p| {
            (c + (p - c) * DVec3::new(1.0, 0.02, 0.03))
                .as_vec3()
                .as_dvec3()
        });
    }
    let mut rows = 0;
    for soup in [torus(900, 10), needles] {
        let model = model(&soup, Strips::Yes);
        assert!(
            model
                .tree
                .nodes
                .iter()
                .any(|n| n.strip != NodeStrip::SPHERE)
        );
        for i in 0..90 {
            let (eye, target) = (
                random.direction() * random.range(0.5, 5.0),
                random.in_ball() * 0.5,
            );
            let view = match i % 5 {
                4 => look_flat(eye, target, random.range(0.5, 3.0), (-3.0, 9.0), 2.0),
                _ => look(eye, target, (0.01, 30.0)),
            };
            let size = [
                SizeMetric::Exact,
                SizeMetric::Center,
                SizeMetric::Nearest,
                SizeMetric::Angle,
                SizeMetric::Area,
            ][i % 5];
            let threshold_px = 10f64.powf(random.range(0.0, 2.0)) as f32;
            let settings = CutSettings {
                threshold_px,
                size,
                ..CutSettings::default()
            };
            let tester = NodeTester::new(&model, &view, &settings);
            let mut cut = Cut::default();
            select(&model, &view, &settings, &mut cut);
            for run in &cut.strips {
                rows += 1;
                let node = model.tree.nodes[run.node as usize];
                let below = leaves_below(&model.tree, run.node);
                assert!(
                    (2..=MAX_STRIP_COUNT).contains(&run.count)
                        && (run.count as usize) < below.len()
                );
                assert!(!tester.is_small(node.center, node.radius));
                let ball = strip_ball_radius(&node, run.count);
                let centers: Vec<_> = strip_centers(&node, run.count).collect();
                assert_eq!(centers[1], strip_center(&node, run.count, 1));
                for &center in &centers {
                    assert!(
                        tester.is_small(center, ball),
                        "a piece is {} px",
                        tester.size_px(center, ball)
                    );
                }
                // Corners, and points between them: the balls together must hold the whole triangle.
                for leaf in below {
                    let [a, b, c] =
                        model.triangles[leaf as usize].map(|i| model.vertices[i as usize].position);
                    for (s, t) in [
                        (0.0, 0.0),
                        (1.0, 0.0),
                        (0.0, 1.0),
                        (0.5, 0.0),
                        (0.25, 0.5),
                        (0.3, 0.3),
                        (0.1, 0.7),
                    ] {
                        let p = a + (b - a) * s + (c - a) * t;
                        let nearest = centers
                            .iter()
                            .map(|&q| q.distance(p))
                            .fold(f32::INFINITY, f32::min);
                        assert!(nearest <= ball * 1.000_01, "{nearest} of {ball}");
                    }
                }
            }
        }
    }
    assert!(rows > 2000, "{rows}");
}

#[test]
fn rows_draw_needles_with_fewer_primitives() {
    let soup = torus(4000, 48);
    let (with, without) = (model(&soup, Strips::Yes), model(&soup, Strips::No));
    let view = look(DVec3::new(0.0, 1.0, 2.6), DVec3::ZERO, (0.1, 10.0));
    let settings = CutSettings {
        threshold_px: 12.0,
        ..CutSettings::default()
    };
    let (mut a, mut b) = (Cut::default(), Cut::default());
    select(&with, &view, &settings, &mut a);
    select(&without, &view, &settings, &mut b);
    let primitives = |cut: &Cut| {
        let rows: usize = cut.strips.iter().map(|s| s.count as usize).sum();
        cut.nodes.len() + rows + cut.leaves.len() + cut.triangles.len()
    };
    assert!(b.strips.is_empty());
    assert!(
        3 * primitives(&a) < 2 * primitives(&b),
        "{} {}",
        primitives(&a),
        primitives(&b)
    );
    assert!(a.stats.visited < b.stats.visited);
}
