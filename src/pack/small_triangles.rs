//! Triangles that cover one pixel, as the splat of that pixel; and those that cover none, as nothing.
//!
//! Of a surface whose triangles are smaller than pixels four in five lie between their centers, and most of the others
//! contain one. On a software device it takes longer to hand such a triangle over, to set it up and to shade its pixel from
//! three vertices than to do so here, where lists are written anyway: what is handed over is a square of a pixel, of the
//! surface at the pixel's center. What covers more pixels stays a triangle.
//!
//! **The same pixels.** Which pixels a triangle covers follows the rule of the rasterizer (Vulkan, "Basic Polygon
//! Rasterization") in the very steps of `shaders/common/vertex_record.glsl`: single precision, products and sums in the order
//! of a matrix times a vector, positions in steps of 1/256 pixel, edges in whole numbers. A software device does the same
//! operations, so neighbors of which one is drawn here and one there neither overlap nor leave a gap. On others the last
//! place of a quotient may differ; they get triangles. What is seen at a pixel's center is that of the triangle as it is, without
//! steps, unless the center lies beside that by what corners are moved by.

mod coverage;
mod shading;
mod texels;

use crate::abi::{FrameConstants, Splat};
use crate::pack::parallel;
use crate::pack::parallel::RecordSink;
use crate::pack::small_triangles::coverage::CoveredCenters;
use crate::pack::small_triangles::shading::ShadingQueue;
use crate::tree::Model;
use fearless_simd::{Level, Simd, SimdBase, dispatch};
use glam::{Vec3, Vec4};
use prefetch_index::prefetch_index;

/// Where the device places corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerScreen {
    /// From model to view space: rows.
    view: [[f32; 4]; 3],
    /// Factors of x and y in clip space; and of z and what is added, for all four components.
    across: [f32; 2],
    along: [[f32; 2]; 4],
    /// The viewport reaches that far beyond the picture on every side, pixels.
    guard_px: f32,
    /// Width and height of the viewport, pixels.
    viewport_px: [f32; 2],
    /// The part of the picture that is drawn: left, top, and one past right and bottom, pixels.
    rect_px: [f32; 4],
    /// Triangles whose signed area has this sign are not drawn (clockwise is positive); 0: all are.
    dropped_sign: f32,
}

impl CornerScreen {
    /// Screen of a frame, whose triangles of `dropped_sign` are not drawn.
    pub fn new(
        frame: &FrameConstants,
        size: (u32, u32),
        guard_px: u32,
        rect_px: [u32; 4],
        dropped_sign: i32,
    ) -> Self {
        let guard_px = guard_px as f32;
        let (view, clip) = (&frame.view_from_model, &frame.clip_from_view);
        let row = |row: usize| [0, 1, 2, 3].map(|column: usize| view[column][row]);
        let along = |row: usize| [clip[2][row], clip[3][row]];
        Self {
            view: [row(0), row(1), row(2)],
            across: [clip[0][0], clip[1][1]],
            along: [along(0), along(1), along(2), along(3)],
            guard_px,
            viewport_px: [size.0, size.1].map(|v| v as f32 + 2.0 * guard_px),
            rect_px: rect_px.map(|v| v as f32),
            dropped_sign: dropped_sign as f32,
        }
    }

    /// Where a corner is, in the steps of [`CoveredCenters::ask`]; none before the near or behind the far plane.
    #[inline]
    pub(crate) fn place(&self, position: Vec3) -> Option<PlacedCorner> {
        self.place_clip(self.clip(position))
    }

    /// A position in the clip space of the viewport: x, y, z (reversed depth times w) and w.
    #[inline]
    pub(crate) fn clip(&self, position: Vec3) -> Vec4 {
        self.clip_of_view(self.in_view(position))
    }

    /// A position in view space.
    #[inline]
    pub(crate) fn in_view(&self, Vec3 { x, y, z }: Vec3) -> Vec3 {
        Vec3::from_array((self.view).map(|row| x * row[0] + (y * row[1] + (z * row[2] + row[3]))))
    }

    /// Clip position of one in view space, see [`CornerScreen::clip`].
    #[inline]
    pub(crate) fn clip_of_view(&self, Vec3 { x, y, z }: Vec3) -> Vec4 {
        let [to_x, to_y, to_z, to_w] = self.along.map(|row| z * row[0] + row[1]);
        Vec4::new(
            x * self.across[0] + to_x,
            y * self.across[1] + to_y,
            to_z,
            to_w,
        )
    }

    /// As [`CornerScreen::place`], of a position in clip space.
    #[inline]
    pub(crate) fn place_clip(&self, clip: Vec4) -> Option<PlacedCorner> {
        let [x, y, z, w] = clip.to_array();
        let step = |v: f32, axis: usize| {
            ((v / w * 0.5 + 0.5) * self.viewport_px[axis] - self.guard_px) * 256.0
        };
        (w > 0.0 && z >= 0.0 && z <= w).then(|| PlacedCorner {
            steps: [step(x, 0), step(y, 1)],
            depth: z / w,
            inverse_w: 1.0 / w,
        })
    }

    /// Width and height of the viewport, pixels.
    pub(crate) fn viewport_px(&self) -> [f32; 2] {
        self.viewport_px
    }

    /// The part of the picture that is drawn: left, top, and one past right and bottom, pixels.
    pub(crate) fn rect_px(&self) -> [u32; 4] {
        self.rect_px.map(|edge| edge as u32)
    }

    /// Tells whether triangles whose signed area (clockwise is positive) has this sign are not drawn.
    pub(crate) fn is_dropped(&self, sign: i64) -> bool {
        sign as f32 == self.dropped_sign
    }
}

/// Where the device places a corner.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlacedCorner {
    /// Window position, steps of 1/256 pixel, before it is rounded to whole ones.
    pub(crate) steps: [f32; 2],
    /// Reversed depth.
    pub(crate) depth: f32,
    pub(crate) inverse_w: f32,
}

/// Triangles whose corners are farther than this many steps apart are left to the device: products of whole numbers stay
/// exact, and it draws large ones faster.
const MOST_STEPS: f32 = 2048.0;
/// So are those that may cover more pixels than this: bits of a word.
const MOST_PIXELS: f32 = 32.0;

/// Samples of a surface that covers the picture, over its pixels: where it is seen from the front its triangles cover more of
/// them than in the mean, and each part of a list has room of its own.
const FRONT: f64 = 1.5;

/// Triangles that stay such, part by part.
pub type LargeTriangles = Vec<Vec<u32>>;

/// Room for the samples of so many triangles on a screen. Where more are found, triangles stay such.
pub fn room(triangles: usize, screen: &CornerScreen) -> usize {
    let of_one = room_of_one(triangles, screen);
    let whole = triangles / parallel::PART * part_room(parallel::PART, of_one);
    whole + part_room(triangles % parallel::PART, of_one)
}

/// Samples that there is room for of each of so many triangles: one, another for those that cover several pixels, and beyond that
/// a share of [`FRONT`] times the pixels that are drawn.
fn room_of_one(triangles: usize, screen: &CornerScreen) -> f64 {
    let [left, top, right, bottom] = screen.rect_px;
    let pixels = f64::from((right - left) * (bottom - top));
    let share = FRONT * pixels / triangles.max(1) as f64;
    2.0 + share.clamp(0.0, f64::from(MOST_PIXELS) - 2.0)
}

/// Room of a part, of whose triangles the last may cover as many as one can.
fn part_room(triangles: usize, of_one: f64) -> usize {
    (triangles as f64 * of_one) as usize + MOST_PIXELS as usize
}

/// Writes samples of the triangles with these ids to the start of `out`, in their order, and the ids of those that stay
/// triangles to `rest`. Returns how many were written.
///
/// # Panics
/// When `out` is shorter than [`room`].
pub fn pack(
    model: &Model,
    ids: &[u32],
    screen: &CornerScreen,
    rest: &mut LargeTriangles,
    out: &mut [Splat],
) -> usize {
    pack_by(Level::new(), model, ids, screen, (rest, out))
}

fn pack_by(
    level: Level,
    model: &Model,
    ids: &[u32],
    screen: &CornerScreen,
    (rest, out): (&mut LargeTriangles, &mut [Splat]),
) -> usize {
    rest.resize_with(ids.len().div_ceil(parallel::PART), Vec::new);
    let of_one = room_of_one(ids.len(), screen);
    let parts = ids.chunks(parallel::PART).zip(rest.iter_mut());
    let parts = parts.map(|(ids, rest)| ((ids, rest), part_room(ids.len(), of_one)));
    let packed = parallel::write(parts.collect(), out, |(ids, rest), sink| {
        rest.clear();
        dispatch!(level, simd => part(simd, model, ids, screen, (rest, sink)));
    });
    packed.points
}

/// Triangles that are looked at together.
const BLOCK: usize = 64;

/// Numbers of one kind of a block.
type SampleRow = [f32; BLOCK];

/// Where the corners of a block are, axis by axis: written long before they are read as vectors, for which the processor
/// would wait otherwise.
struct CornerPositions([[SampleRow; 3]; 3]);

impl CornerPositions {
    /// Gathers the corners of up to a block of triangles. What was there before stays after them.
    #[inline(always)]
    fn gather(&mut self, model: &Model, ids: &[u32]) {
        for (i, &id) in ids.iter().enumerate() {
            for (rows, corner) in self.0.iter_mut().zip(model.triangles[id as usize]) {
                let position = model.vertices[corner as usize].position;
                rows[0][i] = position.x;
                rows[1][i] = position.y;
                rows[2][i] = position.z;
            }
        }
    }
}

#[inline(always)]
fn part<S: Simd>(
    simd: S,
    model: &Model,
    ids: &[u32],
    screen: &CornerScreen,
    (rest, sink): (&mut Vec<u32>, &mut RecordSink<'_, Splat>),
) {
    let width = <S::f32s as SimdBase<S>>::LEN;
    let mut positions = CornerPositions([[[0.0; BLOCK]; 3]; 3]);
    let mut covered = CoveredCenters::NOTHING;
    let mut queue = ShadingQueue::new();
    for (number, block) in ids.chunks(BLOCK).enumerate() {
        positions.gather(model, block);
        for at in (0..block.len()).step_by(width) {
            if queue.is_full() {
                queue.empty(simd, |splat| sink.point(splat));
            }
            let before = number * BLOCK + at;
            let ahead = before + 2 * BLOCK;
            if let Some(next) = ids.get(ahead..ahead + width) {
                for &next in next {
                    let [a, b, c] = model.triangles[next as usize];
                    prefetch_index(&model.vertices, a as usize);
                    prefetch_index(&model.vertices, b as usize);
                    prefetch_index(&model.vertices, c as usize);
                    if let Some(textures) = &model.textures {
                        prefetch_index(&textures.points, a as usize);
                        prefetch_index(&textures.points, b as usize);
                        prefetch_index(&textures.points, c as usize);
                    }
                }
            }
            if let Some(next) = ids.get(ahead + BLOCK..ahead + BLOCK + width) {
                for &next in next {
                    prefetch_index(&model.triangles, next as usize);
                }
            }
            covered.ask(simd, screen, &positions, at);
            let count = width.min(block.len() - at);
            let valid = (1u64 << count) - 1;
            for lane in set_bits((covered.some | !covered.known) & valid) {
                let id = block[at + lane];
                let pixels = covered.pixels[lane];
                // One for each of those that are left always has room.
                let left = ids.len() - before - lane - 1;
                let room = sink.room() - queue.len();
                if covered.known >> lane & 1 == 0 || room < pixels.count_ones() as usize + left {
                    rest.push(id);
                    continue;
                }
                let [a, b, c] = model.triangles[id as usize];
                let textures = model.textures.as_deref();
                let texture = textures.and_then(|textures| textures.of_triangle([a, b, c]));
                let vertices = &model.vertices;
                let corners = [
                    &vertices[a as usize],
                    &vertices[b as usize],
                    &vertices[c as usize],
                ];
                for pixel in set_bits(pixels.into()) {
                    let columns = covered.columns[lane];
                    let row = (pixel as f32 / columns) as u32 as f32;
                    let column = pixel as f32 - row * columns;
                    let weight = |i: usize| {
                        let value = covered.values[i][lane]
                            + column * covered.to_right[i][lane]
                            + row * covered.down[i][lane];
                        value * covered.inverse_w[i][lane]
                    };
                    let mut weights = [weight(0), weight(1), weight(2)];
                    if weights[0].min(weights[1]).min(weights[2]) < 0.0 {
                        let positions = corners.map(|corner| corner.position);
                        weights = coverage::in_steps(screen, positions, [column, row]);
                    }
                    if let Some((image, places)) = texture {
                        queue.push_texture(image, places, covered.weight_steps(lane));
                    }
                    queue.push(corners, weights);
                }
            }
        }
    }
    queue.empty(simd, |splat| sink.point(splat));
}

/// Numbers of the bits of a mask.
#[inline(always)]
fn set_bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (lane < 64).then_some(lane)
    })
}

#[cfg(test)]
mod tests;
