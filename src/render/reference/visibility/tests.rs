//! The reconstructions on pictures made by hand, and the order of drawing.
#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use crate::abi::{Splat, SplatRadius};
use crate::math::camera::Camera;
use crate::math::octahedral;
use crate::render::Reconstruction;
use crate::render::reference::visibility::*;
use glam::{DVec3, Vec3};
use proptest::prelude::*;

const ALL: [Reconstruction; 3] = [
    Reconstruction::Gaussian,
    Reconstruction::Density,
    Reconstruction::PullPush,
];

/// Holes of one surface facing the eye.
fn holes(width: usize, height: usize) -> Vec<VisibilityPixel> {
    let hole = VisibilityPixel {
        class: PixelClass::Hole,
        color: [1, 2, 3],
        front: [5.0, 0.1],
    };
    vec![hole; width * height]
}

fn fill(
    size: (usize, usize),
    pixels: &[VisibilityPixel],
    reconstruction: Reconstruction,
    size_px: f32,
) -> Vec<Option<[u8; 3]>> {
    let filling = HoleFilling {
        reconstruction,
        largest_px: size_px,
    };
    let (width, height) = size;
    let finest = PyramidLevel {
        width,
        height,
        pixels: pixels.to_vec(),
    };
    finest.filled(filling, size_px)
}

/// Methods 15.12, at every place and size: one foreground pixel fills all.
#[test]
fn one_color_fills_everything() {
    for (width, height) in [(1, 1), (1, 2), (2, 1), (5, 3), (8, 8), (9, 17), (33, 6)] {
        for at in [0, width * height / 2, width * height - 1] {
            let mut pixels = holes(width, height);
            pixels[at].class = PixelClass::Foreground;
            pixels[at].color = [250, 7, 100];
            let filled = fill(
                (width, height),
                &pixels,
                Reconstruction::PullPush,
                f32::INFINITY,
            );
            for (i, color) in filled.iter().enumerate() {
                let wanted = (i != at).then_some([250, 7, 100]);
                assert_eq!(*color, wanted, "{width} x {height}, from {at}, pixel {i}");
            }
        }
    }
}

#[test]
fn background_and_foreground_are_left_alone_and_nothing_comes_from_nothing() {
    let mut pixels = holes(7, 5);
    for reconstruction in ALL {
        assert!(
            fill((7, 5), &pixels, reconstruction, 3.0)
                .iter()
                .all(Option::is_none)
        );
        assert!(fill((0, 0), &[], reconstruction, 3.0).is_empty());
    }
    pixels[3] = VisibilityPixel::default();
    pixels[9].class = PixelClass::Foreground;
    for reconstruction in ALL {
        let filled = fill((7, 5), &pixels, reconstruction, 30.0);
        for (i, color) in filled.iter().enumerate() {
            assert_eq!(color.is_none(), i == 3 || i == 9, "{reconstruction:?} {i}");
        }
    }
}

/// The Gaussian of methods 9.1: radius of the splat's size, deviation of half of that.
#[test]
fn a_gaussian_weighs_by_distance_and_ends_at_its_radius() {
    let mut pixels = holes(12, 1);
    pixels[0].class = PixelClass::Foreground;
    pixels[0].color = [200, 0, 0];
    pixels[3].class = PixelClass::Foreground;
    pixels[3].color = [0, 200, 0];
    let filled = fill((12, 1), &pixels, Reconstruction::Gaussian, 4.0);
    let weight = |d: f64| (-d * d / (2.0 * 2.0 * 2.0)).exp();
    let (near, far) = (weight(1.0), weight(2.0));
    let wanted = [near, far].map(|w| unorm8(200.0 / 255.0 * w / (near + far)));
    assert_eq!(filled[1], Some([wanted[0], wanted[1], 0]));
    // Column 7 is 4 from the second, column 8 is 5.
    assert_eq!(
        (filled[5], filled[7], filled[8]),
        (Some([0, 200, 0]), Some([0, 200, 0]), None)
    );
}

/// Methods 9.2: on a grid of spacing s the radius is 1.5 s, so that each hole finds centers, and few.
#[test]
fn a_radius_from_density_follows_the_spacing() {
    for spacing in [2usize, 3, 4, 6] {
        let side = 12 * spacing;
        let mut pixels = holes(side, side);
        for (i, pixel) in pixels.iter_mut().enumerate() {
            if (i % side).is_multiple_of(spacing) && (i / side).is_multiple_of(spacing) {
                pixel.class = PixelClass::Foreground;
                // Left half 0, right half 100: where both mix tells the radius.
                pixel.color = [if i % side < side / 2 { 0 } else { 100 }; 3];
            }
        }
        let filled = fill((side, side), &pixels, Reconstruction::Density, 1.0);
        let row = (side / 2 + 1) * side;
        let mixes = (0..side)
            .filter(|x| filled[row + x].is_some_and(|c| c[0] > 0 && c[0] < 100))
            .count();
        assert!(
            mixes >= spacing - 1 && mixes <= 4 * spacing,
            "spacing {spacing}: {mixes} pixels mix"
        );
        assert!(
            (pixels.iter().zip(&filled)).all(|(p, f)| (p.class == PixelClass::Hole) == f.is_some()),
            "spacing {spacing}"
        );
    }
}

/// Bilinear weights of the push: a ramp of pairs of pixels becomes a ramp.
#[test]
fn a_push_is_bilinear() {
    let mut pixels = holes(16, 2);
    for x in (0..16).step_by(4) {
        for i in [x, x + 1, 16 + x, 17 + x] {
            pixels[i].class = PixelClass::Foreground;
            pixels[i].color = [(10 * x) as u8; 3];
        }
    }
    let filled = fill((16, 2), &pixels, Reconstruction::PullPush, 4.0);
    let row: Vec<u8> = (0..16)
        .map(|x| filled[x].map_or(pixels[x].color[0], |c| c[0]))
        .collect();
    assert_eq!(&row[..2], &[0, 0]);
    assert!(row.windows(2).all(|pair| pair[0] <= pair[1]), "{row:?}");
    // Between 0 and 40, of a coarse pixel that is a hole itself and got 3 parts of 0 and 1 of 40: 10; then with
    // its neighbors 3 : 1.
    assert_eq!((row[2], row[3]), (8, 18));
}

/// The guard: a pixel takes color of another only if their distances differ by at most twice the smaller offset.
#[test]
fn steps_are_kept_exactly_at_twice_the_smaller_offset() {
    for (step, offsets, crosses) in [
        (0.19, [0.1, 0.1], true),
        (0.21, [0.1, 0.1], false),
        (0.21, [0.1, 5.0], false),
        (0.21, [5.0, 0.1], false),
        (0.21, [5.0, 5.0], true),
        (0.0, [0.0, 0.0], true),
        (1e-6, [0.0, 0.0], false),
    ] {
        for reconstruction in ALL {
            for from in [5.0, 5.0 + step] {
                let to = 10.0 + step - from;
                let mut pixels = holes(4, 4);
                for (i, pixel) in pixels.iter_mut().enumerate() {
                    pixel.front = if i % 4 < 2 {
                        pixel.class = PixelClass::Foreground;
                        [from, offsets[0]]
                    } else {
                        [to, offsets[1]]
                    };
                }
                let filled = fill((4, 4), &pixels, reconstruction, 6.0);
                for (i, color) in filled.iter().enumerate().filter(|(i, _)| i % 4 >= 2) {
                    assert_eq!(
                        color.is_some(),
                        crosses,
                        "{reconstruction:?}: {step} {offsets:?} from {from}, pixel {i}"
                    );
                }
            }
        }
    }
}

fn view() -> View {
    Camera::orbit((60, 50), DVec3::ZERO, 1.5, 0.3, 0.2, 1.0)
        .view(DVec3::ZERO)
        .unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// The order of drawing decides nothing where no two splats are equally far.
    #[test]
    fn order_does_not_matter(
        seeds in prop::collection::vec((-1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0, any::<[u8; 3]>()), 1..80),
        turn in 0usize..80,
        size in 1.0f32..12.0,
    ) {
        let splats: Vec<Splat> = seeds
            .iter()
            .map(|&(x, y, z, [r, g, b])| Splat {
                center: Vec3::new(x, y, z),
                radius: SplatRadius::own(if r < 128 { 0.0 } else { 0.05 }),
                normal: octahedral::encode(Vec3::new(y, z, x + 1.5).normalize()),
                color: [r, g, b, 255],
            })
            .collect();
        let mut other = splats.clone();
        other.reverse();
        other.rotate_left(turn % splats.len());
        let style = PrimitiveStyle { splat_size_px: size, depth_offset: 1.0, ..PrimitiveStyle::default() };
        let outputs = PictureOutputs { depth: true, normal: true, values: false };
        for reconstruction in ALL {
            let filling = HoleFilling { reconstruction, largest_px: f32::INFINITY };
            let [a, b] = [&splats, &other].map(|splats| {
                let list = DrawList { splats, ..DrawList::default() };
                render_visibility(&view(), &list, &style, filling, outputs)
            });
            prop_assert_eq!(&a.pixels, &b.pixels);
            prop_assert_eq!(&a.image, &b.image);
        }
    }
}

#[test]
fn degenerate_splats_draw_nothing() {
    let bad = |center: Vec3, radius: f32| Splat {
        center,
        radius: SplatRadius::own(radius),
        normal: [0; 2],
        color: [255; 4],
    };
    let splats = [
        bad(Vec3::NAN, 0.0),
        bad(Vec3::INFINITY, 0.0),
        bad(Vec3::ZERO, f32::NAN),
        bad(Vec3::new(0.0, 0.0, 900.0), 0.0),
    ];
    let triangles = [[0, 1, 2], [7, 8, 9]];
    let list = DrawList {
        splats: &splats,
        triangles: &triangles,
        ..DrawList::default()
    };
    for reconstruction in ALL {
        let filling = HoleFilling {
            reconstruction,
            largest_px: 1.0,
        };
        let outputs = PictureOutputs::default();
        let drawn = render_visibility(&view(), &list, &PrimitiveStyle::default(), filling, outputs);
        assert_eq!(drawn.image.covered_pixels(), 0);
        assert!(
            drawn
                .pixels
                .iter()
                .all(|p| p.class == PixelClass::Background)
        );
    }
}
