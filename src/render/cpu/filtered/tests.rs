//! Lists that no cut would make, against plain loops over all pixels.

use crate::abi::constants::LARGEST_SMALL_BLENDED_PX;
use crate::abi::constants::{COARSE_STEPS, FINE_STEPS, LEAST_COARSE, MOST_WEIGHT};
use crate::pack::for_tests::levels;
use crate::render::cpu::filtered::*;

/// What should be there after `splats`, by the rules of the shaders: front and sums.
fn expected(splats: &[FilteredSplat], canvas: PictureArea) -> (Vec<u32>, Vec<u64>) {
    let [left, top, right, bottom] = canvas.rect_px;
    let pixels: Vec<[u32; 2]> = (top..bottom)
        .flat_map(|y| (left..right).map(move |x| [x, y]))
        .collect();
    let is_small = |s: &&FilteredSplat| s.side_px <= LARGEST_SMALL_BLENDED_PX;
    let mut front = vec![0; pixels.len()];
    for splat in splats.iter().filter(is_small) {
        if !(splat.pushed_depth > 0.0 && splat.window_px.iter().all(|p| p.abs() < 1e6)) {
            continue;
        }
        // A pixel belongs to the square that contains its center, in steps of 1/256 pixel.
        let steps = (256.0 * splat.side_px.max(1.0)).round_ties_even() as i64;
        let low = splat
            .window_px
            .map(|p| (256.0 * p).round_ties_even() as i64 - steps / 2);
        for (front, pixel) in front.iter_mut().zip(&pixels) {
            let is_in = |i: usize| {
                let center = 256 * i64::from(pixel[i]) + 128;
                low[i] <= center && center < low[i] + steps
            };
            if is_in(0) && is_in(1) {
                *front = splat.pushed_depth.to_bits().max(*front);
            }
        }
    }
    let mut sums = vec![0; pixels.len() * canvas.words()];
    for splat in splats.iter().filter(is_small) {
        // What is no number lies nowhere.
        if splat
            .window_px
            .iter()
            .chain(&splat.extent_px)
            .any(|v| v.is_nan())
        {
            continue;
        }
        let extent = splat.extent_px;
        let density = splat.area_px / (extent[0] * extent[1]);
        let center = splat
            .window_px
            .map(|p| (p * 256.0).round_ties_even() / 256.0);
        for (index, pixel) in pixels.iter().enumerate() {
            let overlap = |i: usize| {
                let distance = (pixel[i] as f32 + 0.5 - center[i]).abs();
                (0.5 * (extent[i] + 1.0) - distance)
                    .min(extent[i].min(1.0))
                    .max(0.0)
            };
            let weight = density * (overlap(0) * overlap(1));
            if !(weight > 0.0 && front[index] <= splat.depth.to_bits()) {
                continue;
            }
            let weight = weight.min(MOST_WEIGHT);
            let is_fine = weight < LEAST_COARSE;
            let steps = weight * if is_fine { FINE_STEPS } else { COARSE_STEPS };
            let word = |low: f32, high: f32| {
                u64::from((low + 0.5) as u32) | u64::from((high + 0.5) as u32) << 32
            };
            let [r, g, b] = splat.color.map(|c| c * steps);
            let at = index * canvas.words();
            if canvas.is_gray {
                sums[at + usize::from(is_fine)] += word(r, steps);
            } else {
                let at = at + 2 * usize::from(is_fine);
                sums[at] += word(r, g);
                sums[at + 1] += word(b, steps);
            }
        }
    }
    (front, sums)
}

/// Numbers in 0..1, the same in every run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        let mixed = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = mixed.wrapping_add(1);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// A crowd around a canvas of splats of up to `largest` pixels; one in eight is odd.
fn crowd(count: usize, largest: f32, seed: u64) -> Vec<FilteredSplat> {
    let mut n = Numbers(seed);
    (0..count)
        .map(|i| {
            let side = 0.3 + (largest - 0.3) * n.next() * n.next();
            let depth = 0.2 + 0.1 * n.next();
            let mut splat = FilteredSplat {
                window_px: [90.0 * n.next() - 10.0, 70.0 * n.next() - 10.0],
                pushed_depth: depth - 0.05 * n.next(),
                side_px: side,
                depth,
                area_px: side * side * n.next() * n.next(),
                extent_px: [0.07 + side * n.next(), 0.07 + side * n.next()],
                color: [n.next(), n.next(), n.next()],
                unused: 0,
            };
            // On edges and in corners of pixels, too.
            if i % 3 == 0 {
                splat.window_px = splat.window_px.map(|p| (2.0 * p).round() / 2.0);
            }
            match i % 64 {
                0 => splat.window_px[i / 64 % 2] = f32::NAN,
                8 => splat.window_px[i / 64 % 2] = 1e9,
                4 => splat.pushed_depth = depth,
                16 => splat.pushed_depth = 0.0,
                24 => splat.area_px = [0.0, 1e9, f32::NAN, f32::INFINITY][i / 64 % 4],
                32 => splat.extent_px[i / 64 % 2] = [0.0, f32::NAN][i / 128 % 2],
                40 => splat.side_px = f32::NAN,
                48 => splat.area_px *= 1e-3,
                56 => splat.window_px[i / 64 % 2] = -1e9,
                _ => {}
            }
            splat
        })
        .collect()
}

/// Front and sums, by what the processor has or by the least that all have.
type Drawn = (Vec<u32>, Vec<u64>);

fn drawn(level: Level, splats: &[FilteredSplat], canvas: PictureArea) -> Drawn {
    // What was there before must not show, and what lies behind must stay.
    let mut front = vec![7; canvas.pixels() + 9];
    let mut sums = vec![7; canvas.pixels() * canvas.words() + 9];
    // In two parts with a gap between them.
    let (first, second) = splats.split_at(splats.len() / 3);
    let gap = [FilteredSplat {
        window_px: [20.0; 2],
        pushed_depth: 1.0,
        side_px: 9.0,
        depth: 1.0,
        area_px: 9.0,
        extent_px: [9.0; 2],
        color: [1.0; 3],
        unused: 0,
    }];
    let list = [first, &gap, second].concat();
    let mut groups = ScreenGroups::of(first);
    let mut others = ScreenGroups::default();
    others.add(first.len() + 1, second);
    groups.append(others);
    let storage = (&mut front[..], &mut sums[..]);
    let list = DrawnSplats {
        splats: &[GroupedSplats {
            splats: &list,
            groups: &groups,
        }],
        meshes: &[],
        triangles: &CutTriangles::default(),
    };
    draw_by(level, list, canvas, storage);
    assert_eq!(front.split_off(canvas.pixels()), [7; 9]);
    assert_eq!(sums.split_off(canvas.pixels() * canvas.words()), [7; 9]);
    (front, sums)
}

/// All of a picture of 70 x 50 pixels, parts of it, one and three columns, and a pixel.
const RECTS: [[u32; 4]; 6] = [
    [0, 0, 70, 50],
    [5, 3, 61, 47],
    [16, 16, 48, 32],
    [13, 0, 14, 50],
    [20, 7, 23, 50],
    [31, 29, 32, 30],
];

#[test]
fn front_and_sums_are_those_of_the_rules() {
    for (count, largest) in [(0, 1.0), (1, 3.0), (997, 3.0), (3000, 6.0), (1500, 16.0)] {
        let mut splats = crowd(count, largest, count as u64 + 5);
        // Neighbors together, so that most bands pass most groups by.
        splats.sort_by(|a, b| a.window_px[1].total_cmp(&b.window_px[1]));
        for rect_px in RECTS {
            for is_gray in [true, false] {
                let canvas = PictureArea { rect_px, is_gray };
                let (front, sums) = expected(&splats, canvas);
                let what = format!("{count} of {largest} px in {rect_px:?}, gray {is_gray}");
                assert!(
                    count < 900 || canvas.pixels() == 1 || front.iter().any(|&bits| bits > 0),
                    "{what}"
                );
                for level in levels() {
                    let (own_front, own_sums) = drawn(level, &splats, canvas);
                    let what = format!("{what}, {level:?}");
                    assert!(own_front == front, "{what}: front");
                    assert!(own_sums == sums, "{what}: sums");
                }
            }
        }
    }
}

#[test]
fn neither_order_nor_threads_show() {
    // So many are drawn by several threads.
    let mut splats = crowd(20_000, 4.0, 3);
    for is_gray in [true, false] {
        let canvas = PictureArea {
            rect_px: [0, 0, 70, 50],
            is_gray,
        };
        let first = drawn(Level::new(), &splats, canvas);
        let (front, sums) = expected(&splats, canvas);
        assert!(first.0 == front && first.1 == sums);
        let mut n = Numbers(11);
        for i in (1..splats.len()).rev() {
            splats.swap(i, (n.next() * i as f32) as usize);
        }
        assert!(first == drawn(Level::new(), &splats, canvas), "shuffled");
    }
}

#[test]
fn large_splats_are_told() {
    let mut splats = crowd(5000, 3.0, 1);
    assert!(ScreenGroups::of(&splats).are_small());
    splats[4321].side_px = LARGEST_SMALL_BLENDED_PX.next_up();
    let mut groups = ScreenGroups::of(&splats[..100]);
    assert!(groups.are_small());
    groups.append(ScreenGroups::of(&splats));
    assert!(!groups.are_small());
}

#[test]
fn splats_reach_into_the_next_band() {
    let canvas = PictureArea {
        rect_px: [0, 0, 24, BAND_PX + 8],
        is_gray: true,
    };
    for eighths in 8 * (BAND_PX - 2)..8 * (BAND_PX + 2) {
        for (side_px, high) in [(1.0, 3.0), (3.0, 0.5), (2.0, 2.0), (1.0, 1.0)] {
            let splats = [FilteredSplat {
                window_px: [11.3, eighths as f32 / 8.0],
                pushed_depth: 0.5,
                side_px,
                depth: 0.5,
                area_px: 1.0,
                extent_px: [1.0, high],
                color: [0.5; 3],
                unused: 0,
            }];
            let (front, sums) = drawn(Level::new(), &splats, canvas);
            let what = format!("{side_px} and {high} px at {eighths} eighths");
            assert!((front, sums) == expected(&splats, canvas), "{what}");
        }
    }
}
