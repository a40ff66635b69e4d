use crate::abi::Vertex;
use crate::abi::constants::{FILTERED_AROUND_PX, FILTERED_JUMP};
use crate::math::camera::{Camera, HeadlightSource};
use crate::math::octahedral;
use crate::pack::filtered::FilteredPatch;
use crate::render::reference::filtered::*;
use glam::{DMat4, DVec3, DVec4, Vec3};

mod between;
mod nothing;
mod rim;
mod triangles;

/// A repeatable stream of numbers in 0..1 (the splitmix64 generator of Steele et al., 2014).
struct Numbers(u64);

impl Numbers {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f32 {
        (low + (high - low) * self.unit()) as f32
    }
}

const SIZE: (u32, u32) = (48, 40);
const FAR: f64 = 256.0;

/// Orthographic, one unit a pixel, the model's x right and y down from the top left of the picture and z into
/// it; depth is 1 - z / 256, exact for small dyadic z.
fn flat_camera() -> Camera {
    let (w, h) = (f64::from(SIZE.0), f64::from(SIZE.1));
    Camera {
        width: SIZE.0,
        height: SIZE.1,
        view: DMat4::from_cols(
            DVec4::X,
            -DVec4::Y,
            -DVec4::Z,
            DVec4::new(-w / 2.0, h / 2.0, 0.0, 1.0),
        ),
        proj: DMat4::from_cols(
            DVec4::new(2.0 / w, 0.0, 0.0, 0.0),
            DVec4::new(0.0, 2.0 / h, 0.0, 0.0),
            DVec4::new(0.0, 0.0, -1.0 / FAR, 0.0),
            DVec4::W,
        ),
        y_down: false,
        light: HeadlightSource::Point,
        other: serde_json::Map::new(),
    }
}

fn flat() -> View {
    flat_camera().view(DVec3::ZERO).unwrap()
}

/// Perspective from the origin along -z, y up.
fn perspective() -> View {
    Camera::look_at(SIZE, DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.2, [1.0, 100.0])
        .view(DVec3::ZERO)
        .unwrap()
}

fn splat(center: [f32; 3], color: [f32; 3], area_px: f32) -> FilteredPatch {
    FilteredPatch {
        center: Vec3::from_array(center),
        offset: 0.5,
        color,
        area_px,
        extent_px: [1.0; 2],
        side_px: 1.0,
    }
}

/// The same over a square of `side` pixels.
fn wide(side: f32, splat: FilteredPatch) -> FilteredPatch {
    FilteredPatch {
        extent_px: [side; 2],
        side_px: side,
        ..splat
    }
}

fn style(splat_size_px: f32) -> PrimitiveStyle {
    PrimitiveStyle {
        splat_size_px,
        depth_offset: 1.0,
        ..PrimitiveStyle::default()
    }
}

/// Those of a list that are between the near and the far plane.
fn placed(view: &View, splats: &[FilteredPatch]) -> Vec<FilteredSplat> {
    splats
        .iter()
        .filter_map(|splat| splat.place(view))
        .collect()
}

fn draw_splats(view: &View, splats: &[FilteredPatch], style: &PrimitiveStyle) -> FilteredRendering {
    let list = FilteredList {
        splats: &placed(view, splats),
        ..FilteredList::default()
    };
    render_filtered(view, &list, style, PictureOutputs::default())
}

fn at(x: usize, y: usize) -> usize {
    y * SIZE.0 as usize + x
}

fn vertex(position: Vec3, normal: Vec3, color: [u8; 3]) -> Vertex {
    let [r, g, b] = color;
    Vertex {
        position,
        normal: octahedral::encode(normal),
        color: [r, g, b, 255],
    }
}

/// A triangle of one normal in the picture of [`flat`], at a constant distance.
fn wall(z: f32, normal: Vec3) -> Vec<Vertex> {
    [[0.0, 0.0], [0.0, 40.2], [40.3, 0.0]]
        .map(|[x, y]| vertex(Vec3::new(x, y, z), normal, [255; 3]))
        .to_vec()
}

#[track_caller]
fn assert_near(a: f32, b: f32, tolerance: f32) {
    assert!((a - b).abs() <= tolerance, "{a} is not {b}");
}

const RED: [f32; 3] = [1.0, 0.0, 0.0];
const GREEN: [f32; 3] = [0.0, 1.0, 0.0];

#[test]
fn a_splat_deposits_its_area_where_its_rectangle_overlaps_pixels() {
    for (width, height, side, center) in [
        (3.0, 3.0, 3.0, [10.5, 10.5]),
        (4.0, 2.0, 4.0, [10.0, 10.0]),
        (1.0, 1.0, 1.0, [10.25, 12.75]),
        (0.25, 3.5, 1.0, [20.125, 17.875]),
        (6.5, 0.5, 2.0, [20.0, 17.5]),
    ] {
        let area = 0.5;
        let one = FilteredPatch {
            extent_px: [width, height],
            side_px: side,
            ..splat([center[0], center[1], 8.0], [0.25, 0.5, 1.0], area)
        };
        let got = draw_splats(&flat(), &[one], &style(1.0));
        let overlap = |pixel: usize, center: f32, extent: f32| {
            let (low, high) = (center - extent / 2.0, center + extent / 2.0);
            (high.min(pixel as f32 + 1.0) - low.max(pixel as f32)).max(0.0)
        };
        for y in 0..40 {
            for x in 0..48 {
                let part = overlap(x, center[0], width) * overlap(y, center[1], height);
                let weight = area / (width * height) * part;
                let sum = got.sums[at(x, y)];
                for (got, expected) in sum.iter().zip([0.25, 0.5, 1.0, 1.0]) {
                    assert_near(*got, expected * weight, 1e-6);
                }
                // The depth is that of a square of its own side.
                let is_in = |p: usize, c: f32| (p as f32 + 0.5 - c).abs() < side / 2.0;
                let on_edge = |p: usize, c: f32| (p as f32 + 0.5 - c).abs() == side / 2.0;
                if !on_edge(x, center[0]) && !on_edge(y, center[1]) {
                    let inside = is_in(x, center[0]) && is_in(y, center[1]);
                    let front = if inside { 1.0 - 8.5 / 256.0 } else { 0.0 };
                    assert_eq!(got.front[at(x, y)], front, "{x} {y}");
                }
            }
        }
        let total: f32 = got.sums.iter().map(|s| s[3]).sum();
        assert_near(total, area, 1e-5);
    }
}

#[test]
fn the_rim_shows_the_weight_and_the_interior_is_opaque() {
    let style = PrimitiveStyle {
        background: [0.0, 1.0, 0.0],
        ..style(1.0)
    };
    let one = wide(3.0, splat([10.5, 10.5, 8.0], [0.2, 0.4, 1.0], 4.4));
    let got = draw_splats(&flat(), &[one], &style);
    assert_eq!(got.image.color[at(10, 10)], [51, 102, 255, 255]);
    for (x, y) in [(9, 9), (10, 9), (11, 10), (9, 11)] {
        assert_eq!(got.image.color[at(x, y)], [25, 180, 125, 125], "{x} {y}");
    }
    assert_eq!(got.image.color[at(8, 9)], [0, 255, 0, 0]);
    // What is spread beyond the square of the first pass is rim, whatever its neighbors are.
    let spread = FilteredPatch {
        extent_px: [5.0, 5.0],
        side_px: 3.0,
        area_px: 12.222_22,
        ..one
    };
    let got = draw_splats(&flat(), &[spread], &style);
    assert_eq!(got.image.color[at(8, 10)], [25, 180, 125, 125]);
    assert_eq!(got.front[at(8, 10)], 0.0);
    // A rim pixel with more weight than a pixel has area is covered, not brighter.
    let twice = FilteredPatch {
        area_px: 18.0,
        ..one
    };
    let got = draw_splats(&flat(), &[twice], &style);
    assert_eq!(got.image.color[at(9, 9)], [51, 102, 255, 255]);
    // More than half a level is a level at least; less is nothing at a rim.
    for (weight, expected) in [(0.003, [0, 255, 1, 1]), (0.001, [0, 255, 0, 0])] {
        let faint = FilteredPatch {
            area_px: 9.0 * weight,
            ..one
        };
        let got = draw_splats(&flat(), &[faint], &style);
        assert_eq!(got.image.color[at(9, 9)], expected);
        assert_eq!(got.image.color[at(10, 10)], [51, 102, 255, 255]);
    }
    // No area is nothing anywhere, whatever the depth says.
    let none = FilteredPatch {
        area_px: 0.0,
        ..one
    };
    let got = draw_splats(&flat(), &[none], &style);
    assert_eq!(got.image.color[at(10, 10)], [0, 255, 0, 0]);
    assert!(got.front[at(10, 10)] > 0.0);
    // The edge of the picture is no rim.
    let got = draw_splats(
        &flat(),
        &[wide(3.0, splat([0.5, 0.5, 8.0], RED, 4.5))],
        &style,
    );
    assert_eq!(got.image.color[at(0, 0)][3], 255);
    assert_eq!(got.image.color[at(1, 1)][3], 128);
}

#[test]
fn between_narrow_rectangles_the_square_says_what_is_there() {
    // Rectangles of two pixels, eight apart, in squares that overlap: no pixel inside is without color.
    let splats: Vec<_> = (0..16)
        .map(|i| FilteredPatch {
            extent_px: [2.0, 2.0],
            side_px: 9.0,
            ..splat(
                [8.0 + 8.0 * (i % 4) as f32, 8.0 + 8.0 * (i / 4) as f32, 8.0],
                if i % 4 < 2 { RED } else { GREEN },
                50.0,
            )
        })
        .collect();
    let got = draw_splats(&flat(), &splats, &style(9.0)).image;
    for y in 5..35 {
        for x in 5..35 {
            let [r, g, b, a] = got.color[at(x, y)];
            assert_eq!((a, b), (255, 0), "{x} {y}");
            assert!((254..=256).contains(&(u16::from(r) + u16::from(g))));
        }
    }
    // In a rectangle its own color alone counts; alone, a square beyond the rectangle ends in nothing.
    assert_eq!(got.color[at(15, 15)], [255, 0, 0, 255]);
    let alone = draw_splats(&flat(), &splats[..1], &style(9.0)).image;
    assert_eq!(alone.color[at(3, 3)], [0, 0, 0, 0]);
}

#[test]
fn layers_blend_by_area_up_to_the_offset_of_the_nearer_and_no_farther() {
    let near = wide(2.0, splat([10.0, 10.0, 8.0], RED, 1.0));
    let shown = |z: f32, offset: f32| {
        let far = FilteredPatch {
            offset,
            ..wide(2.0, splat([10.0, 10.0, z], GREEN, 3.0))
        };
        let there = draw_splats(&flat(), &[near, far], &style(2.0));
        let back = draw_splats(&flat(), &[far, near], &style(2.0));
        assert!(there == back, "the order matters");
        there.sums[at(9, 9)]
    };
    let (alone, both) = ([0.25, 0.0, 0.0, 0.25], [0.25, 0.75, 0.0, 1.0]);
    let shown = |z, offset| shown(z, offset).map(|sum: f32| (sum * 1000.0).round() / 1000.0);
    assert_eq!(shown(8.25, 0.5), both);
    // The limit itself belongs to the blend. The smallest step of depth in 0.5..1 is 2^-24, here 2^-16 units.
    assert_eq!(shown(8.5, 0.5), both);
    assert_eq!(shown(8.5 + 1.0 / 4096.0, 0.5), alone);
    assert_eq!(shown(20.0, 0.5), alone);
    // The offset of the farther one matters only where it is nearer once pushed.
    assert_eq!(shown(8.5, 100.0), both);
    assert_eq!(shown(8.25, 0.0), [0.25, 0.75, 0.0, 1.0]);
    assert_eq!(shown(8.5 + 1.0 / 4096.0, 100.0), alone);
    // The mean is by area: (1 red + 3 green) / 4.
    let far = wide(2.0, splat([10.0, 10.0, 8.25], GREEN, 3.0));
    let picture = draw_splats(&flat(), &[near, far], &style(2.0)).image;
    assert_eq!(picture.color[at(9, 9)], [64, 191, 0, 255]);
}

#[test]
fn a_perspective_pushes_along_the_ray_by_model_units() {
    // A model of twice the size of its view space.
    let camera = Camera {
        view: DMat4::from_scale(DVec3::splat(2.0)),
        ..Camera::look_at(SIZE, DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.2, [1.0, 100.0])
    };
    let scaled = camera.view(DVec3::ZERO).unwrap();
    assert_eq!(scaled.model_scale, 2.0);
    for (view, scale) in [(perspective(), 1.0), (scaled, 2.0)] {
        // Toward a corner of the picture, where the ray is much longer than the distance.
        let ray = Vec3::new(0.75, 0.625, -1.0);
        let center = ray * 10.0 / scale;
        let offset = 0.5;
        let near = FilteredPatch {
            center,
            offset,
            // As good as a point, in one pixel.
            extent_px: [1e-3, 1e-3],
            ..splat([0.0; 3], RED, 1.0)
        };
        let (x, y, _) = view.project(center);
        let i = at(x as usize, y as usize);
        let limit = center * (center.length() + offset) / center.length();
        let front = draw_splats(&view, &[near], &style(1.0)).front[i];
        assert_near(view.distance_of_depth(front), view.distance(limit), 2e-5);
        for (factor, blends) in [(0.999, true), (1.001, false)] {
            let far = FilteredPatch {
                center: limit * factor,
                color: GREEN,
                ..near
            };
            let got = draw_splats(&view, &[near, far], &style(1.0)).sums[i];
            let expected = if blends {
                [1.0, 1.0, 0.0, 2.0]
            } else {
                [1.0, 0.0, 0.0, 1.0]
            };
            for (got, expected) in got.iter().zip(expected) {
                assert_near(*got, expected, 1e-4);
            }
        }
    }
}

#[test]
fn an_offset_of_zero_draws_the_nearest_splat_everywhere() {
    let mut numbers = Numbers(3);
    let view = perspective();
    for _ in 0..2000 {
        let z = numbers.between(1.5, 90.0);
        let one = FilteredPatch {
            center: Vec3::new(
                numbers.between(-0.6, 0.6) * z,
                numbers.between(-0.5, 0.5) * z,
                -z,
            ),
            offset: 0.0,
            ..splat([0.0; 3], RED, 1.0)
        };
        let got = draw_splats(&view, &[one], &style(1.0));
        assert_near(got.sums.iter().map(|s| s[3]).sum::<f32>(), 1.0, 3e-5);
    }
}

#[test]
fn the_far_plane_drops_centers_and_forgives_pushes() {
    let splat_at = |z: f32, offset: f32, color| FilteredPatch {
        offset,
        ..splat([10.5, 10.5, z], color, 1.0)
    };
    let i = at(10, 10);
    for z in [-1.0, 256.5, f32::NAN] {
        let got = draw_splats(&flat(), &[splat_at(z, 0.5, RED)], &style(1.0));
        assert!(got.front.iter().all(|&d| d == 0.0), "{z}");
        assert!(got.sums.iter().all(|s| *s == [0.0; 4]), "{z}");
    }
    // Not even by a push is a splat behind the eye, or before the near plane, drawn.
    let got = draw_splats(&flat(), &[splat_at(-0.25, 8.0, RED)], &style(1.0));
    assert_eq!((got.front[i], got.sums[i][3]), (0.0, 0.0));
    for offset in [1.0, 2.0, 1e30, f32::INFINITY] {
        let near = splat_at(255.0, offset, RED);
        let far = splat_at(255.75, 0.5, GREEN);
        let got = draw_splats(&flat(), &[near], &style(1.0));
        let sums = |got: &FilteredRendering| got.sums[i].map(|sum| (sum * 1000.0).round() / 1000.0);
        assert_eq!(
            (got.front[i], sums(&got)),
            (0.0, [1.0, 0.0, 0.0, 1.0]),
            "{offset}"
        );
        let both = draw_splats(&flat(), &[near, far], &style(1.0));
        assert_eq!(sums(&both), [1.0, 1.0, 0.0, 2.0], "{offset}");
    }
}

fn cloud(view: &View, count: usize, side: f32) -> Vec<FilteredPatch> {
    let mut numbers = Numbers(11);
    (0..count)
        .map(|_| {
            let (x, y) = (numbers.between(-0.9, 0.9), numbers.between(-0.9, 0.9));
            let z = numbers.between(4.0, 9.0);
            let center = if view.is_perspective {
                Vec3::new(x * z / view.scale[0], y * z / view.scale[1], -z)
            } else {
                Vec3::new(24.0 + 23.0 * x, 20.0 + 19.0 * y, z)
            };
            FilteredPatch {
                center,
                offset: numbers.between(0.0, 1.0),
                color: [
                    numbers.between(0.0, 1.0),
                    numbers.between(0.0, 1.0),
                    numbers.between(0.0, 1.0),
                ],
                area_px: numbers.between(0.01, 2.0),
                ..wide(side, splat([0.0; 3], RED, 1.0))
            }
        })
        .collect()
}

#[test]
fn the_order_of_splats_matters_to_rounding_only() {
    for view in [flat(), perspective()] {
        let mut splats = cloud(&view, 4000, 2.5);
        let first = draw_splats(&view, &splats, &style(2.5));
        assert!(first.sums.iter().filter(|s| s[3] > 0.0).count() > 1000);
        let mut numbers = Numbers(5);
        for i in (1..splats.len()).rev() {
            splats.swap(i, (numbers.unit() * (i + 1) as f64) as usize);
        }
        let second = draw_splats(&view, &splats, &style(2.5));
        assert!(first.front == second.front);
        assert!(first.sums != second.sums);
        for (a, b) in first.sums.iter().zip(&second.sums) {
            for (a, b) in a.iter().zip(b) {
                assert_near(*a, *b, 1e-5 * (1.0 + a.abs()));
            }
        }
    }
}

/// Written apart from the passes: for each pixel, everything that covers it, sorted.
#[test]
fn the_sums_are_those_of_a_list_of_fragments_at_each_pixel() {
    for view in [flat(), perspective()] {
        let splats = cloud(&view, 600, 3.0);
        let got = draw_splats(&view, &splats, &style(3.0));
        let mut rejected = 0;
        for y in 0..40 {
            for x in 0..48 {
                let away = |s: &FilteredPatch| {
                    let (px, py, _) = view.project(s.center);
                    [(px - (x as f32 + 0.5)).abs(), (py - (y as f32 + 0.5)).abs()]
                };
                // (distance, distance once pushed, part of the pixel, whether the square hides it)
                let fragments: Vec<(f64, f64, f64, bool)> = splats
                    .iter()
                    .map(|s| {
                        let z = f64::from(view.distance(s.center));
                        let stretch = if view.is_perspective {
                            z / s.center.as_dvec3().length()
                        } else {
                            1.0
                        };
                        let [dx, dy] = away(s);
                        let part = |d: f32| (2.0 - d).clamp(0.0, 1.0);
                        let weight = s.area_px / 9.0 * part(dx) * part(dy);
                        let hides = dx < 1.5 && dy < 1.5;
                        (
                            z,
                            z + f64::from(s.offset) * stretch,
                            f64::from(weight),
                            hides,
                        )
                    })
                    .collect();
                let hiding = fragments.iter().filter(|f| f.3);
                let front = hiding.map(|f| f.1).fold(f64::INFINITY, f64::min);
                // Pixel centers close to the side of a square, or splats close to the limit, may fall either way.
                let is_doubtful = fragments.iter().any(|f| (f.0 - front).abs() < 1e-4)
                    || splats
                        .iter()
                        .any(|s| away(s).iter().any(|d| (d - 1.5).abs() < 0.005));
                if is_doubtful {
                    continue;
                }
                let sum: f64 = fragments.iter().filter(|f| f.0 <= front).map(|f| f.2).sum();
                rejected += fragments
                    .iter()
                    .filter(|f| f.0 > front && f.2 > 0.0)
                    .count();
                // Centers are snapped to 1/256 pixel: so much of several parts.
                assert_near(got.sums[at(x, y)][3], sum as f32, 3e-3);
            }
        }
        assert!(rejected > 100, "{rejected}");
    }
}

#[test]
fn a_constant_color_stays_constant() {
    let color = [0.3, 0.6, 0.9];
    for view in [flat(), perspective()] {
        let splats: Vec<FilteredPatch> = cloud(&view, 3000, 1.7)
            .into_iter()
            .map(|s| FilteredPatch { color, ..s })
            .collect();
        for background in [[0.0; 3], color] {
            let style = PrimitiveStyle {
                background,
                ..style(1.7)
            };
            let got = draw_splats(&view, &splats, &style);
            let (mut inside, mut rim) = (0, 0);
            for (pixel, sum) in got.image.color.iter().zip(&got.sums) {
                if sum[3] <= 1e-6 {
                    assert_eq!(pixel[3], 0);
                    continue;
                }
                let alpha = f64::from(pixel[3]) / 255.0;
                *(if pixel[3] == 255 {
                    &mut inside
                } else {
                    &mut rim
                }) += 1;
                for c in 0..3 {
                    let (own, behind) = (f64::from(color[c]), f64::from(background[c]));
                    let expected = 255.0 * (own * alpha + behind * (1.0 - alpha));
                    assert!(
                        (f64::from(pixel[c]) - expected).abs() <= 1.0,
                        "{pixel:?} {expected}"
                    );
                    assert_near(sum[c] / sum[3], color[c], 1.0 / 255.0);
                }
            }
            assert!(inside > 800 && rim > 50, "{inside} {rim}");
        }
    }
}

#[test]
fn depth_is_that_of_the_surface_where_covered() {
    let outputs = PictureOutputs {
        depth: true,
        normal: true,
        values: false,
    };
    let splats = [
        splat([10.5, 10.5, 8.0], RED, 1.0),
        splat([20.5, 10.5, 8.0], RED, 0.0),
        FilteredPatch {
            offset: 9.0,
            ..splat([30.5, 10.5, 250.0], RED, 1.0)
        },
    ];
    let list = FilteredList {
        splats: &placed(&flat(), &splats),
        ..FilteredList::default()
    };
    let image = render_filtered(&flat(), &list, &style(1.0), outputs).image;
    for (i, &distance) in image.depth.iter().enumerate() {
        // Not where they are pushed to: 8.5, and beyond the far plane.
        let wanted = match i {
            _ if i == at(10, 10) => 8.0,
            _ if i == at(30, 10) => 250.0,
            _ => f32::INFINITY,
        };
        let is_near = (distance - wanted).abs() < 1e-3;
        assert!(distance == wanted || is_near, "{i}: {distance}, {wanted}");
    }
    assert!(image.normal == vec![[0.0; 3]; image.color.len()]);
    assert_eq!(image.color[at(30, 10)][3], 255);
}
