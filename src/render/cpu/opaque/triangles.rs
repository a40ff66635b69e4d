//! Opaque triangles of any size: the nearest of each pixel, lit by its interpolated normal, a vector of pixels at a time.
//!
//! Which pixels a triangle covers follows the rule of the rasterizer in whole steps ([`crate::render::cpu::triangles`]), so
//! neighbors neither overlap nor leave a gap. In each row the covered pixels are one span; its ends are found by division and
//! set right by the exact edge functions. Depth and shade are interpolated in single precision, as a device does.

use crate::pack::parallel;
use crate::render::cpu::opaque::bands::BAND_PX;
use crate::render::cpu::opaque::bands::SPLAT_BIT;
use crate::render::cpu::opaque::framebuffer::ShownRectangle;
use crate::render::cpu::opaque::viewport::SplatScreen;
use crate::render::cpu::triangles::{
    CutTriangles, FaceEdge, FaceSurface, FaceTexture, FrameLight, MeshVertices, NumberedFace,
    PictureFace,
};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};
use glam::Vec3;

type Numbers<S> = <S as Simd>::f32s;

/// Most lanes of a vector.
const LANES: usize = 16;

/// Numbers of lanes.
const LANE: [f32; LANES] = [
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
];

/// Coverage in a color: all.
const COVERED: u32 = 0xff << 24;

/// Draws triangles into an empty picture: where none is, it becomes `background` with depth 0. Of equally near ones the first
/// stays.
///
/// # Panics
/// When the picture is smaller than the screen, or the triangles were set up for another part of the picture.
pub fn draw(
    triangles: &CutTriangles,
    meshes: MeshVertices<'_>,
    screen: &SplatScreen,
    background: u32,
    picture: ShownRectangle<'_>,
) {
    let shown = ShownFaces::Colors(meshes);
    draw_by(
        Level::new(),
        (triangles, shown),
        screen,
        background,
        picture,
    );
}

/// Draws as [`draw`] does, but a pixel becomes the number of its triangle in [`CutTriangles::numbered`] with [`SPLAT_BIT`] set.
pub(super) fn draw_numbers(
    triangles: &CutTriangles,
    screen: &SplatScreen,
    background: u32,
    picture: ShownRectangle<'_>,
) {
    let shown = ShownFaces::Numbers;
    draw_by(
        Level::new(),
        (triangles, shown),
        screen,
        background,
        picture,
    );
}

/// What pixels show of their triangle.
#[derive(Clone, Copy)]
enum ShownFaces<'a> {
    /// Color in the headlight, of these meshes.
    Colors(MeshVertices<'a>),
    /// Number of the triangle.
    Numbers,
}

/// The same by vectors of a level.
fn draw_by(
    level: Level,
    (triangles, shown): (&CutTriangles, ShownFaces<'_>),
    screen: &SplatScreen,
    background: u32,
    picture: ShownRectangle<'_>,
) {
    assert!(
        triangles.are_within(screen.rect_px()),
        "they are of another part"
    );
    let width = screen.width();
    if width == 0 {
        return;
    }
    let [left, top, ..] = screen.rect_px();
    // What a triangle costs besides its pixels, and those, in the records of lists that the sharing of work counts in.
    let work = triangles.count() + screen.pixels() / 16;
    let bands = picture.bands(screen).enumerate();
    parallel::share(work, bands, |(number, mut band)| {
        for (colors, depths) in band.rows(width) {
            colors.fill(background);
            depths.fill(0.0);
        }
        let Some(light) = triangles.light() else {
            return;
        };
        let first = top + (number * BAND_PX) as u32;
        let rows = [first, first + (band.depths.len() / width) as u32];
        let mut target = BandTarget {
            picture: &mut band,
            width,
            corner: [left, first],
        };
        match shown {
            ShownFaces::Colors(meshes) => dispatch!(level, simd => {
                for NumberedFace { part, face, .. } in triangles.near(rows) {
                    let surface = || FaceSurface::of(face, part, meshes, light);
                    let ink = LitInk { light, surface: Some(surface), shade: None };
                    target.draw(simd, (face, rows), ink);
                }
            }),
            ShownFaces::Numbers => dispatch!(level, simd => {
                for NumberedFace { face, number, .. } in triangles.near(rows) {
                    target.draw(simd, (face, rows), NumberInk(number | SPLAT_BIT));
                }
            }),
        }
    });
}

/// A band of the picture.
struct BandTarget<'b, 'p> {
    picture: &'b mut ShownRectangle<'p>,
    width: usize,
    /// The pixel of the picture that is the band's first.
    corner: [u32; 2],
}

/// What the pixels of one triangle become.
trait FaceInk<S: Simd> {
    /// Of pixels of a row, whose corners have weights in proportion to these.
    fn words(&mut self, simd: S, perspective: [Numbers<S>; 3], pixels: &PixelRun<S>) -> S::i32s;
}

/// Pixels of a row.
struct PixelRun<S: Simd> {
    /// The first.
    first: [u32; 2],
    /// Numbers of the others from there.
    lanes: Numbers<S>,
    /// A bit of each that is asked for.
    mask: u64,
}

/// Colors in the headlight. Most triangles are hidden: what their surface is like is asked for at the first pixel.
struct LitInk<'a, 'm, S: Simd, F> {
    light: &'a FrameLight,
    surface: Option<F>,
    shade: Option<FaceShade<'m, S>>,
}

impl<'m, S: Simd, F: FnOnce() -> FaceSurface<'m>> FaceInk<S> for LitInk<'_, 'm, S, F> {
    #[inline(always)]
    fn words(&mut self, simd: S, perspective: [Numbers<S>; 3], pixels: &PixelRun<S>) -> S::i32s {
        if let Some(surface) = self.surface.take() {
            self.shade = Some(FaceShade::new(simd, &surface()));
        }
        match &self.shade {
            Some(shade) => shade.words(simd, self.light, perspective, pixels),
            None => S::i32s::splat(simd, 0),
        }
    }
}

/// The same word everywhere.
struct NumberInk(u32);

impl<S: Simd> FaceInk<S> for NumberInk {
    #[inline(always)]
    fn words(&mut self, simd: S, _: [Numbers<S>; 3], _: &PixelRun<S>) -> S::i32s {
        S::i32s::splat(simd, self.0 as i32)
    }
}

/// What is the same in all pixels of a triangle.
struct FaceShade<'m, S: Simd> {
    /// Normals and colors of the corners, one number a corner and axis.
    normals: [[Numbers<S>; 3]; 3],
    colors: [[Numbers<S>; 3]; 3],
    /// What it shows in the place of these.
    texture: Option<FaceTexture<'m>>,
}

impl BandTarget<'_, '_> {
    /// Draws the rows of a triangle that lie in the band.
    #[inline(always)]
    fn draw<S: Simd>(
        &mut self,
        simd: S,
        (face, rows): (&PictureFace, [u32; 2]),
        mut ink: impl FaceInk<S>,
    ) {
        let [left, _, right, _] = face.pixels;
        let (top, bottom) = (face.pixels[1].max(rows[0]), face.pixels[3].min(rows[1]));
        let (area, edges) = face.edges_from([left, top]);
        let span = SpanFinder::new(edges, i64::from(right - left));
        let inverse_area = 1.0 / area;
        let mut starts = edges.map(|edge| edge.first);
        for y in top..bottom {
            let [first, end] = span.of_row(starts);
            if first < end {
                let at_first = [0, 1, 2].map(|i| starts[i] + first * edges[i].right);
                let x = left + first as u32;
                let row = PixelSpan {
                    at: (y - self.corner[1]) as usize * self.picture.pitch
                        + (x - self.corner[0]) as usize,
                    depth_at: (y - self.corner[1]) as usize * self.width
                        + (x - self.corner[0]) as usize,
                    pixel: [x, y],
                    count: (end - first) as usize,
                };
                let weights = RowWeights {
                    at_first,
                    edges: &edges,
                    inverse_area,
                };
                self.row(simd, &row, &weights, face, &mut ink);
            }
            for (start, edge) in starts.iter_mut().zip(&edges) {
                *start += edge.down;
            }
        }
    }

    /// Draws a span of a row.
    #[inline(always)]
    fn row<S: Simd>(
        &mut self,
        simd: S,
        row: &PixelSpan,
        weights: &RowWeights<'_>,
        face: &PictureFace,
        ink: &mut impl FaceInk<S>,
    ) {
        let step = Numbers::<S>::LEN;
        let lanes = Numbers::<S>::from_slice(simd, &LANE[..step]);
        let mut first = 0;
        while first < row.count {
            let count = step.min(row.count - first);
            let [a, b, c] = weights.of(simd, first, lanes);
            let depth = (a * face.depth.x + b * face.depth.y + c * face.depth.z)
                .max(0.0)
                .min(1.0);
            let at = row.depth_at + first;
            let front = load(simd, &self.picture.depths[at..], count);
            let is_nearer = lanes.simd_lt(count as f32) & depth.simd_gt(front);
            if is_nearer.any_true() {
                store(
                    is_nearer.select(depth, front),
                    &mut self.picture.depths[at..],
                    count,
                );
                let perspective = [
                    a * face.inverse_w.x,
                    b * face.inverse_w.y,
                    c * face.inverse_w.z,
                ];
                let pixel = [row.pixel[0] + first as u32, row.pixel[1]];
                let mut mask = is_nearer.to_bitmask();
                let pixels = PixelRun {
                    first: pixel,
                    lanes,
                    mask,
                };
                let words = ink.words(simd, perspective, &pixels);
                let at = row.at + first;
                let colors = &mut self.picture.colors[at..];
                let mut own = [0; LANES];
                words.store_slice(&mut own[..step]);
                while mask != 0 {
                    let lane = mask.trailing_zeros() as usize;
                    mask &= mask - 1;
                    colors[lane] = own[lane] as u32;
                }
            }
            first += step;
        }
    }
}

/// A span of covered pixels.
struct PixelSpan {
    /// Where its first pixel is among colors and among depths of the band.
    at: usize,
    depth_at: usize,
    /// First pixel of the span in the picture.
    pixel: [u32; 2],
    count: usize,
}

/// Weights of the corners along a row.
struct RowWeights<'a> {
    /// Edge functions at the first pixel of the row.
    at_first: [i64; 3],
    edges: &'a [FaceEdge; 3],
    inverse_area: f32,
}

impl RowWeights<'_> {
    /// In the window, of the pixels from one on: exact at the first of the vector.
    #[inline(always)]
    fn of<S: Simd>(&self, simd: S, first: usize, lanes: Numbers<S>) -> [Numbers<S>; 3] {
        let one = |i: usize| {
            let start = self.at_first[i] + first as i64 * self.edges[i].right;
            let step = self.edges[i].right as f32 * self.inverse_area;
            lanes * step + Numbers::<S>::splat(simd, start as f32 * self.inverse_area)
        };
        [one(0), one(1), one(2)]
    }
}

/// Finds which pixels of a row a triangle covers.
struct SpanFinder {
    edges: [FaceEdge; 3],
    /// Of the growth to the right of each edge function.
    inverse: [f64; 3],
    /// Pixels of a row that are asked for.
    width: i64,
}

impl SpanFinder {
    #[inline(always)]
    fn new(edges: [FaceEdge; 3], width: i64) -> Self {
        Self {
            edges,
            inverse: edges.map(|edge| 1.0 / edge.right as f64),
            width,
        }
    }

    /// First pixel of the row and one past the last, where the edge functions are `starts` at pixel 0; the same where there
    /// is none.
    #[inline(always)]
    fn of_row(&self, starts: [i64; 3]) -> [i64; 2] {
        let (mut first, mut end) = (0, self.width);
        for ((edge, inverse), start) in self.edges.iter().zip(&self.inverse).zip(starts) {
            let is_inside = |pixel: i64| start + pixel * edge.right >= edge.least;
            if edge.right > 0 {
                // Inside from some pixel on. A quotient is off by less than one.
                let guess = ((edge.least - start) as f64 * inverse).ceil();
                let mut from = guess.clamp(0.0, self.width as f64) as i64;
                while from > 0 && is_inside(from - 1) {
                    from -= 1;
                }
                while from < self.width && !is_inside(from) {
                    from += 1;
                }
                first = first.max(from);
            } else if edge.right < 0 {
                let guess = ((edge.least - start) as f64 * inverse).floor() + 1.0;
                let mut to = guess.clamp(0.0, self.width as f64) as i64;
                while to < self.width && is_inside(to) {
                    to += 1;
                }
                while to > 0 && !is_inside(to - 1) {
                    to -= 1;
                }
                end = end.min(to);
            } else if !is_inside(0) {
                return [0, 0];
            }
        }
        [first, end.max(first)]
    }
}

impl<'m, S: Simd> FaceShade<'m, S> {
    #[inline(always)]
    fn new(simd: S, surface: &FaceSurface<'m>) -> Self {
        let number = |value: f32| Numbers::<S>::splat(simd, value);
        let of = |corner: Vec3| [number(corner.x), number(corner.y), number(corner.z)];
        let (n, c) = (&surface.normals, &surface.colors);
        Self {
            normals: [of(n.x_axis), of(n.y_axis), of(n.z_axis)],
            colors: [of(c.x_axis), of(c.y_axis), of(c.z_axis)],
            texture: surface.texture,
        }
    }

    /// The colors of pixels whose corners have weights in proportion to these: red in the lowest byte, all covered.
    #[inline(always)]
    fn words(
        &self,
        simd: S,
        light: &FrameLight,
        weights: [Numbers<S>; 3],
        pixels: &PixelRun<S>,
    ) -> S::i32s {
        let ([x, y], lanes) = (pixels.first, pixels.lanes);
        let number = |value: f32| Numbers::<S>::splat(simd, value);
        let [a, b, c] = weights;
        let inverse = number(1.0) / (a + b + c);
        let (a, b, c) = (a * inverse, b * inverse, c * inverse);
        let [na, nb, nc] = &self.normals;
        let nx = na[0] * a + nb[0] * b + nc[0] * c;
        let ny = na[1] * a + nb[1] * b + nc[1] * c;
        let nz = na[2] * a + nb[2] * b + nc[2] * c;
        let squared = nx * nx + ny * ny + nz * nz;
        let facing = if light.is_parallel {
            nz / squared.sqrt()
        } else {
            let scale = light.ray_scale;
            let to_x = -((lanes + (x as f32 + 0.5)) * scale.x + light.ray_offset.x);
            let to_y = -((y as f32 + 0.5) * scale.y + light.ray_offset.y);
            let long = to_x * to_x + (to_y * to_y + 1.0);
            (nx * to_x + ny * to_y + nz) / (squared * long).sqrt()
        };
        let lambert = match light.is_two_sided {
            true => facing.abs(),
            false => facing.max(0.0),
        };
        let one = number(1.0);
        let lambert = squared.simd_gt(0.0).select(lambert.min(one), one);
        let [red, green, blue] = light.albedo.to_array();
        let [ca, cb, cc] = &self.colors;
        let (red, green, blue) = if let Some(texture) = &self.texture {
            let own = texels(simd, texture, weights, pixels.mask);
            (
                byte::<S>(lambert * own[0] * red),
                byte::<S>(lambert * own[1] * green),
                byte::<S>(lambert * own[2] * blue),
            )
        } else if light.has_colors {
            (
                byte::<S>(lambert * (ca[0] * a + cb[0] * b + cc[0] * c) * red),
                byte::<S>(lambert * (ca[1] * a + cb[1] * b + cc[1] * c) * green),
                byte::<S>(lambert * (ca[2] * a + cb[2] * b + cc[2] * c) * blue),
            )
        } else {
            (
                byte::<S>(lambert * red),
                byte::<S>(lambert * green),
                byte::<S>(lambert * blue),
            )
        };
        red | (green << 8) | (blue << 16) | S::i32s::splat(simd, COVERED as i32)
    }
}

// Functions, as what closures do need not be compiled for the vectors of the function that they are in.

/// Red, green and blue of a texture at the pixels of a mask, one after the other: texels lie anywhere.
#[inline(always)]
fn texels<S: Simd>(
    simd: S,
    texture: &FaceTexture<'_>,
    weights: [Numbers<S>; 3],
    mut mask: u64,
) -> [Numbers<S>; 3] {
    let step = Numbers::<S>::LEN;
    let mut corners = [[0.0; LANES]; 3];
    for (row, weights) in corners.iter_mut().zip(weights) {
        weights.store_slice(&mut row[..step]);
    }
    let mut colors = [[0.0; LANES]; 3];
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask - 1;
        let color = texture.color_at(Vec3::from_array(corners.map(|row| row[lane])));
        for (row, value) in colors.iter_mut().zip(color.to_array()) {
            row[lane] = value;
        }
    }
    colors.map(|row| Numbers::<S>::from_slice(simd, &row[..step]))
}

/// A value in 0..=1 as a byte.
#[inline(always)]
fn byte<S: Simd>(value: Numbers<S>) -> S::i32s {
    (value.min(1.0) * 255.0)
        .round_ties_even()
        .to_int::<S::i32s>()
}

/// The first `count` numbers of a list and then zeros, or whatever follows in the list.
#[inline(always)]
fn load<S: Simd>(simd: S, list: &[f32], count: usize) -> Numbers<S> {
    let step = Numbers::<S>::LEN;
    match list.get(..step) {
        Some(all) => Numbers::<S>::from_slice(simd, all),
        None => {
            let mut all = [0.0; LANES];
            all[..count].copy_from_slice(&list[..count]);
            Numbers::<S>::from_slice(simd, &all[..step])
        }
    }
}

/// Stores numbers of which [`load`] gave those beyond `count`.
#[inline(always)]
fn store<S: Simd, V: SimdBase<S, Element = f32>>(numbers: V, list: &mut [f32], count: usize) {
    let step = V::LEN;
    match list.get_mut(..step) {
        Some(all) => numbers.store_slice(all),
        None => {
            let mut all = [0.0; LANES];
            numbers.store_slice(&mut all[..step]);
            list[..count].copy_from_slice(&all[..count]);
        }
    }
}
