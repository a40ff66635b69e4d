//! The mirror of fuzzy splats on lists of a few splats: sums, offsets, order.

use glam::{DVec3, Vec3};
use surfel::abi::{Splat, SplatRadius, WeightedSplat};
use surfel::math::camera::{Camera, View};
use surfel::math::octahedral;
use surfel::pack::{Footprint, FuzzyList, PrimitiveStyle};
use surfel::render::PictureOutputs;
use surfel::render::reference::{BlendPasses, FuzzyRendering, render_fuzzy};

fn view() -> View {
    Camera::look_at(
        (64, 64),
        DVec3::ZERO,
        DVec3::NEG_Z,
        DVec3::Y,
        1.0,
        [0.5, 50.0],
    )
    .view(DVec3::ZERO)
    .unwrap()
}

fn splat(center: Vec3, radius: f32, normal: Vec3, color: [u8; 3]) -> WeightedSplat {
    let [r, g, b] = color;
    WeightedSplat {
        splat: Splat {
            center,
            radius: SplatRadius::own(radius),
            normal: octahedral::encode(normal),
            color: [r, g, b, 255],
        },
        area: -1.0,
    }
}

fn gauss() -> PrimitiveStyle {
    PrimitiveStyle {
        footprint: Footprint::Oriented,
        is_gauss: true,
        depth_offset: 1.0,
        ..PrimitiveStyle::default()
    }
}

fn render(splats: &[WeightedSplat], style: &PrimitiveStyle, passes: BlendPasses) -> FuzzyRendering {
    let list = FuzzyList {
        splats,
        ..FuzzyList::default()
    };
    let outputs = PictureOutputs {
        depth: true,
        normal: false,
        values: false,
    };
    render_fuzzy(&view(), &list, style, passes, outputs)
}

/// Intermediate results in closed form: a facing disc at distance 10 of radius 1 is pushed by 1, and has the weight
/// exp(-2 rho^2) at each pixel.
#[test]
fn depth_and_sums_are_those_of_the_formula() {
    let done = render(
        &[splat(Vec3::new(0.0, 0.0, -10.0), 1.0, Vec3::Z, [255; 3])],
        &gauss(),
        BlendPasses::Two,
    );
    let view = view();
    let f = f64::from(view.focal_px());
    for y in 0..64u32 {
        for x in 0..64u32 {
            let i = (y * 64 + x) as usize;
            let offset = [f64::from(x) + 0.5 - 32.0, f64::from(y) + 0.5 - 32.0];
            let squared = (offset[0].powi(2) + offset[1].powi(2)) * (10.0 / f).powi(2);
            let weight = f64::from(done.sums[i][3]);
            if squared > 1.0 {
                assert_eq!(weight, 0.0, "{x} {y}");
                continue;
            }
            assert!((weight - (-2.0 * squared).exp()).abs() < 1e-6, "{x} {y}");
            assert!((view.distance_of_depth(done.front[i]) - 11.0).abs() < 1e-3);
            let color = done.image.color[i];
            assert!(
                (color[0].abs_diff(204) <= 1) && color[3] == 255,
                "{color:?}"
            );
        }
    }
}

/// A known area: the weights add up to the pixels that the patch covers, widened or not.
#[test]
fn weights_of_areas_add_up_to_the_area() {
    let view = view();
    let f = f64::from(view.focal_px());
    for (normal, low_pass_px) in [
        (Vec3::Z, 0.0),
        (Vec3::Z, 0.5),
        (Vec3::new(0.6, 0.0, 0.8), 0.3),
    ] {
        let mut one = splat(Vec3::new(0.3, 0.2, -20.0), 4.0, normal, [255; 3]);
        one.area = 30.0;
        let style = PrimitiveStyle {
            low_pass_px,
            ..gauss()
        };
        let done = render(&[one], &style, BlendPasses::Two);
        let sum: f64 = done.sums.iter().map(|s| f64::from(s[3])).sum();
        let expected = 30.0 * f64::from(normal.z) * (f / 20.0).powi(2);
        // The perspective across the patch, and pixels along the cut at exp(-2).
        assert!((sum - expected).abs() < 0.05 * expected, "{sum} {expected}");
    }
}

/// methods.md 15.5: a layer at a distance of less than the offset is mixed in, one farther is not.
#[test]
fn a_second_layer_is_seen_exactly_within_the_offset() {
    let layer = |z: f32, color| {
        let at = |i: i32| (i as f32 - 10.0) * 0.5;
        (0..21 * 21).map(move |i| splat(Vec3::new(at(i % 21), at(i / 21), z), 0.5, Vec3::Z, color))
    };
    for (gap, is_mixed) in [(0.2f32, true), (0.45, true), (0.55, false), (3.0, false)] {
        let splats: Vec<_> = layer(-10.0, [255, 0, 0])
            .chain(layer(-10.0 - gap, [0, 255, 0]))
            .collect();
        let done = render(&splats, &gauss(), BlendPasses::Two);
        // The middle of the picture, where rays are almost parallel to the normals.
        let [r, g, _, _] = done.sums[32 * 64 + 32];
        let share = g / (r + g);
        if is_mixed {
            assert!((share - 0.5).abs() < 0.1, "{gap}: {share}");
        } else {
            assert_eq!(share, 0.0, "{gap}");
        }
    }
}

/// A shuffle that is the same every time (a linear congruential generator).
fn shuffled(splats: &[WeightedSplat], seed: u64) -> Vec<WeightedSplat> {
    let mut state = seed;
    let mut out = splats.to_vec();
    for i in (1..out.len()).rev() {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        out.swap(i, (state >> 33) as usize % (i + 1));
    }
    out
}

/// Largest difference of a channel over 100 orders, in levels.
fn order_sensitivity(splats: &[WeightedSplat], passes: BlendPasses) -> u8 {
    let first = render(splats, &gauss(), passes).image.color;
    (1..100)
        .map(|seed| {
            let other = render(&shuffled(splats, seed), &gauss(), passes)
                .image
                .color;
            let pairs = first.iter().flatten().zip(other.iter().flatten());
            pairs.map(|(a, b)| a.abs_diff(*b)).max().unwrap()
        })
        .max()
        .unwrap()
}

/// methods.md 8.4 and F15: two passes do not depend on the order, one pass does; ranges chain.
#[test]
fn order_matters_in_one_pass_only() {
    // Layers of red, green and blue at 0, 0.9 and 1.8 offsets.
    let mut splats = Vec::new();
    for (i, color) in [[255, 0, 0], [0, 255, 0], [0, 0, 255]]
        .into_iter()
        .enumerate()
    {
        for j in 0..9 {
            let at = Vec3::new(
                (j % 3) as f32 - 1.0,
                (j / 3) as f32 - 1.0,
                -10.0 - 0.9 * i as f32,
            );
            splats.push(splat(at, 1.0, Vec3::Z, color));
        }
    }
    let two = order_sensitivity(&splats, BlendPasses::Two);
    let threshold = order_sensitivity(&splats, BlendPasses::DepthThreshold);
    println!("largest difference over 100 orders: two passes {two}, threshold {threshold} levels");
    assert!(two <= 1);
    assert!(threshold > 50, "{threshold}");
}

/// Discs one behind the other, seen at a flat angle: each range overlaps the next, so they become one.
#[test]
fn ranges_of_depth_chain() {
    let normal = Vec3::new(0.0, 0.95, 0.312);
    let row: Vec<_> = (0..8)
        .map(|i| {
            splat(
                Vec3::new(0.0, 0.0, -10.0 - 1.5 * i as f32),
                1.0,
                normal,
                [255, 30 * i as u8, 0],
            )
        })
        .collect();
    let done = render(&row, &gauss(), BlendPasses::DepthRange);
    let view = view();
    let i = 32 * 64 + 32;
    let chain =
        (view.distance_of_depth(done.back[i]) - view.distance_of_depth(done.front[i])) / 2.0;
    println!("a chain of {chain:.2} diameters");
    assert!(chain > 4.0, "{chain}");
    // Two passes stop at the offset of the first: 1 / 0.312.
    let two = render(&row, &gauss(), BlendPasses::Two);
    assert!(two.sums[i][3] < done.sums[i][3]);
}

#[test]
fn what_is_no_place_draws_nothing() {
    let nan = f32::NAN;
    let splats = [
        splat(Vec3::new(nan, 0.0, -10.0), 1.0, Vec3::Z, [255; 3]),
        splat(Vec3::new(0.0, 0.0, 10.0), 1.0, Vec3::Z, [255; 3]),
        splat(Vec3::new(0.0, 0.0, -90.0), 1.0, Vec3::Z, [255; 3]),
        splat(Vec3::new(0.0, 0.0, -10.0), nan, Vec3::Z, [255; 3]),
    ];
    for passes in [
        BlendPasses::Two,
        BlendPasses::DepthThreshold,
        BlendPasses::DepthRange,
    ] {
        let done = render(&splats, &gauss(), passes);
        assert!(done.image.color.iter().all(|c| *c == [0; 4]));
        assert!(done.sums.iter().flatten().all(|s| *s == 0.0));
    }
}
