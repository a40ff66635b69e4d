//! Closed forms of samples and means.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use super::*;
use proptest::prelude::*;

const REPEAT: [WrapMode; 2] = [WrapMode::Repeat; 2];

fn image(width: u32, height: u32, of: impl Fn(u32, u32) -> u8) -> TextureImage {
    image_of([width, height], REPEAT, of)
}

fn image_of(
    [width, height]: [u32; 2],
    wrap: [WrapMode; 2],
    of: impl Fn(u32, u32) -> u8,
) -> TextureImage {
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let texels = places
        .map(|(x, y)| [of(x, y), 255 - of(x, y), 7, 255])
        .collect();
    let level = TextureLevel::new(width, height, texels).unwrap();
    TextureImage::new("test", [width, height], wrap, level)
}

fn red(color: Vec3) -> f32 {
    color.x * 255.0
}

#[test]
fn centers_of_texels_show_them_and_between_is_between() {
    let image = image(4, 2, |x, y| (10 * x + 100 * y) as u8);
    let at = |x: f32, y: f32| Vec2::new(x / 4.0, y / 2.0);
    assert!((red(image.sample(at(2.5, 1.5), 0.0)) - 120.0).abs() < 1e-3);
    assert!((red(image.sample(at(2.0, 1.5), 0.0)) - 115.0).abs() < 1e-3);
    assert!((red(image.sample(at(1.5, 1.0), 0.0)) - 60.0).abs() < 1e-3);
    // Halfway over the border is the mean of both ends.
    assert!((red(image.sample(at(0.0, 0.5), 0.0)) - 15.0).abs() < 1e-3);
    assert!((red(image.sample(at(-4.0 + 2.5, 2.0 + 1.5), 0.0)) - 120.0).abs() < 1e-3);
    let half = image.sample(at(0.5, 0.5), 0.5).x;
    let ends = [0.0, 1.0].map(|level| image.sample(at(0.5, 0.5), level).x);
    assert!((half - 0.5 * (ends[0] + ends[1])).abs() < 1e-6);
}

#[test]
fn borders_repeat_mirror_or_stay() {
    let of = |x: u32, _: u32| (10 * x) as u8;
    let value = |wrap: WrapMode, x: f32| {
        let image = image_of([4, 1], [wrap, WrapMode::Clamp], of);
        red(image.sample(Vec2::new(x / 4.0, 0.5), 0.0)).round()
    };
    use WrapMode::{Clamp, Mirror, Repeat};
    assert_eq!(
        [value(Repeat, 4.5), value(Mirror, 4.5), value(Clamp, 4.5)],
        [0.0, 30.0, 30.0]
    );
    assert_eq!(
        [value(Repeat, -0.5), value(Mirror, -0.5), value(Clamp, -0.5)],
        [30.0, 0.0, 0.0]
    );
    assert_eq!(
        [value(Repeat, 6.5), value(Mirror, 6.5), value(Clamp, 6.5)],
        [20.0, 10.0, 30.0]
    );
    assert_eq!(
        [value(Repeat, 0.0), value(Mirror, 0.0), value(Clamp, 0.0)],
        [15.0, 0.0, 0.0]
    );
}

/// Halving any size keeps the mean, up to rounding that leans to no side.
#[test]
fn smaller_sizes_keep_the_mean() {
    let noise = |x: u32, y: u32| {
        let mixed =
            (x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77)).wrapping_mul(0xc2b2_ae3d);
        (mixed >> 24) as u8
    };
    for size in [[64, 64], [63, 64], [65, 33], [100, 37], [1, 7], [200, 3]] {
        let image = image_of(size, REPEAT, noise);
        let mean = |level: &TextureLevel| {
            let sum: u64 = level.texels().iter().map(|texel| u64::from(texel[0])).sum();
            sum as f64 / level.texels().len() as f64
        };
        let first = mean(&image.levels()[0]);
        for level in image.levels() {
            assert!(
                (mean(level) - first).abs() < 1.0,
                "{size:?}: {level:?}: {} of {first}",
                mean(level)
            );
        }
        let last = image.levels().last().unwrap();
        assert_eq!([last.width(), last.height()], [1, 1]);
        let wanted = size[0].max(size[1]).ilog2() as usize + 1;
        assert_eq!(image.levels().len(), wanted, "{size:?}");
    }
}

/// The mean over two triangles is that of the square that they make, of a checker and of a ramp.
#[test]
fn means_over_triangles_are_means_of_texels() {
    let checker = image(
        256,
        256,
        |x, y| if (x / 3 + y / 5) % 2 == 0 { 255 } else { 0 },
    );
    let ramp = image_of([256, 256], [WrapMode::Clamp; 2], |x, _| x as u8);
    let square = |low: f32, high: f32| {
        let at = |x: f32, y: f32| Vec2::new(x, y);
        [
            [at(low, low), at(high, low), at(high, high)],
            [at(low, low), at(high, high), at(low, high)],
        ]
    };
    let mean = |image: &TextureImage, low: f32, high: f32| {
        let [a, b] = square(low, high).map(|corners| red(image.mean(corners)));
        0.5 * (a + b)
    };
    assert!(
        (mean(&checker, 0.0, 1.0) - 127.5).abs() < 2.0,
        "{}",
        mean(&checker, 0.0, 1.0)
    );
    assert!(
        (mean(&checker, 0.1, 0.7) - 127.5).abs() < 4.0,
        "{}",
        mean(&checker, 0.1, 0.7)
    );
    // The ramp has 255 (u - 1/2 texel).
    assert!(
        (mean(&ramp, 0.25, 0.75) - 127.5).abs() < 1.0,
        "{}",
        mean(&ramp, 0.25, 0.75)
    );
    // Smaller than a texel: that texel.
    assert!((mean(&ramp, 0.5 + 0.4 / 256.0, 0.5 + 0.6 / 256.0) - 128.0).abs() < 0.2);
}

#[test]
fn levels_follow_the_longer_step() {
    let image = image(256, 64, |_, _| 0);
    let slope = |right: Vec2, down: Vec2| image.level_of(TextureSlope { right, down });
    assert_eq!(
        slope(Vec2::new(4.0 / 256.0, 0.0), Vec2::new(0.0, 2.0 / 64.0)),
        2.0
    );
    assert_eq!(slope(Vec2::new(0.5 / 256.0, 0.0), Vec2::ZERO), -1.0);
    assert!(slope(Vec2::ZERO, Vec2::ZERO) < -60.0);
}

proptest! {
    /// Whatever the coordinates and levels are, colors are colors.
    #[test]
    fn nothing_panics(
        size in prop::array::uniform2(1_u32..9),
        bits in prop::array::uniform6(any::<u32>()),
        level in any::<u32>(),
        wrap in 0_usize..9,
    ) {
        let modes = [WrapMode::Repeat, WrapMode::Mirror, WrapMode::Clamp];
        let image = image_of(size, [modes[wrap % 3], modes[wrap / 3]], |x, y| (40 * x + 3 * y) as u8);
        let [a, b, c, d, e, f] = bits.map(f32::from_bits);
        let corners = [Vec2::new(a, b), Vec2::new(c, d), Vec2::new(e, f)];
        let seen = [image.sample(corners[0], f32::from_bits(level)), image.mean(corners)];
        for color in seen {
            prop_assert!(color.cmpge(Vec3::splat(-1e-3)).all() && color.cmple(Vec3::splat(1.001)).all(), "{color}");
        }
    }
}

#[test]
fn whole_numbers_below_are_those_of_floor() {
    let mut numbers = vec![
        0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 1e-30, -1e-30, 3e9, -3e9, 1e30,
    ];
    numbers.extend([
        8_388_607.0,
        8_388_607.5,
        -8_388_607.5,
        8_388_608.0,
        16_777_217.0,
    ]);
    numbers.extend((0..4000).map(|i| (i - 2000) as f32 * 0.37));
    for number in numbers {
        assert_eq!(whole_below(number), number.floor(), "{number}");
    }
}
