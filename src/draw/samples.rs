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
//! place of a quotient may differ; they get triangles.

use crate::abi::{FrameConstants, Splat, Vertex};
use crate::draw::parts::{self, Sink};
use crate::math::octahedral;
use crate::tree::Model;
use glam::{BVec4A, Vec3, Vec4};
use prefetch_index::prefetch_index;

/// Where the device places corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Screen {
    /// From model to view space: rows, all four lanes alike.
    view: [[Vec4; 4]; 3],
    /// Factors of x and y in clip space; and of z and what is added, for all four components.
    across: [Vec4; 2],
    along: [[Vec4; 2]; 4],
    /// The viewport reaches that far beyond the picture on every side, pixels.
    guard_px: Vec4,
    /// Width and height of the viewport, pixels.
    viewport_px: [Vec4; 2],
    /// The part of the picture that is drawn: left, top, and one past right and bottom, pixels.
    rect_px: [f32; 4],
    /// Triangles whose signed area has this sign are not drawn (clockwise is positive); 0: all are.
    dropped_sign: f32,
}

impl Screen {
    /// That of a frame, whose triangles of `dropped_sign` are not drawn.
    pub fn new(
        frame: &FrameConstants,
        size: (u32, u32),
        guard_px: u32,
        rect_px: [u32; 4],
        dropped_sign: i32,
    ) -> Self {
        let guard_px = guard_px as f32;
        let (view, clip) = (&frame.view_from_model, &frame.clip_from_view);
        let row = |row: usize| [0, 1, 2, 3].map(|column: usize| Vec4::splat(view[column][row]));
        let along = |row: usize| [clip[2][row], clip[3][row]].map(Vec4::splat);
        Self {
            view: [row(0), row(1), row(2)],
            across: [clip[0][0], clip[1][1]].map(Vec4::splat),
            along: [along(0), along(1), along(2), along(3)],
            guard_px: Vec4::splat(guard_px),
            viewport_px: [size.0, size.1].map(|v| Vec4::splat(v as f32 + 2.0 * guard_px)),
            rect_px: rect_px.map(|v| v as f32),
            dropped_sign: dropped_sign as f32,
        }
    }
}

/// Whole numbers, of what is below 2²²: a sum with this number has no places behind the point, and is rounded to even.
#[inline]
fn rounded(v: Vec4) -> Vec4 {
    const WHOLE: f32 = 12_582_912.0;
    v + WHOLE - WHOLE
}

/// A corner of four triangles.
#[derive(Clone, Copy)]
struct Corners {
    /// Window position, steps of 1/256 pixel.
    x: Vec4,
    y: Vec4,
    inverse_w: Vec4,
    /// In the view volume, as far as depth goes.
    is_within: BVec4A,
}

impl Screen {
    #[inline]
    fn corners(&self, positions: [Vec3; 4]) -> Corners {
        let [a, b, c, d] = positions;
        let x = Vec4::new(a.x, b.x, c.x, d.x);
        let y = Vec4::new(a.y, b.y, c.y, d.y);
        let z = Vec4::new(a.z, b.z, c.z, d.z);
        // From the last column to the first, as shaders do it; without the entries that are 0 or 1 in every view.
        let times =
            |[of_x, of_y, of_z, add]: &[Vec4; 4]| ((*add + z * *of_z) + y * *of_y) + x * *of_x;
        let [row_x, row_y, row_z] = &self.view;
        let (x, y, z) = (times(row_x), times(row_y), times(row_z));
        let from_z = |[of_z, add]: &[Vec4; 2]| *add + z * *of_z;
        let [to_x, to_y, to_z, to_w] = &self.along;
        let (x, y) = (
            from_z(to_x) + x * self.across[0],
            from_z(to_y) + y * self.across[1],
        );
        let (z, w) = (from_z(to_z), from_z(to_w));
        let steps = |v: Vec4, size: Vec4| {
            let window = (v / w * 0.5 + 0.5) * size - self.guard_px;
            rounded(window * 256.0)
        };
        Corners {
            x: steps(x, self.viewport_px[0]),
            y: steps(y, self.viewport_px[1]),
            inverse_w: Vec4::ONE / w,
            is_within: w.cmpgt(Vec4::ZERO) & z.cmpge(Vec4::ZERO) & z.cmple(w),
        }
    }
}

/// Triangles whose corners are farther than this many steps apart are left to the device: products of whole numbers stay
/// exact, and it draws large ones faster.
const MOST_STEPS: f32 = 2048.0;
/// So are those that may cover more pixels than this.
const MOST_PIXELS: f32 = 16.0;
/// From a number of steps over 256 to the next whole number, by rounding.
const UP: f32 = 0.5 - 1.0 / 512.0;

/// Four triangles on the grid of steps, from the first corner of each.
struct OnGrid {
    origin: [Vec4; 2],
    /// The other corners.
    b: [Vec4; 2],
    c: [Vec4; 2],
    /// Twice the area, with its sign.
    area: Vec4,
    /// First and last pixels whose centers may be inside.
    first: [Vec4; 2],
    last: [Vec4; 2],
    /// Those that are all there are to ask for; the device decides about others.
    known: BVec4A,
    /// Those that may cover anything.
    some: BVec4A,
}

/// Edge functions of four triangles, clockwise, each opposite of a corner.
struct Edges {
    /// From one end of each edge to the other.
    dx: [Vec4; 3],
    dy: [Vec4; 3],
    /// At the center of the first pixel: proportional to the weights of the corners in the window.
    values: [Vec4; 3],
    /// The least values inside: 1 where a center exactly on the edge belongs to the neighbor.
    least: [Vec4; 3],
}

impl OnGrid {
    #[inline]
    fn new(screen: &Screen, [a, b, c]: &[Corners; 3]) -> Self {
        let origin = [a.x, a.y];
        let (b_off, c_off) = ([b.x - a.x, b.y - a.y], [c.x - a.x, c.y - a.y]);
        let area = b_off[0] * c_off[1] - b_off[1] * c_off[0];
        let [left, top, right, bottom] = screen.rect_px;
        let ends = |i: usize, least: f32, most: f32| {
            let low = b_off[i].min(c_off[i]).min(Vec4::ZERO) + origin[i];
            let high = b_off[i].max(c_off[i]).max(Vec4::ZERO) + origin[i];
            // Pixel i has its center at 256 i + 128.
            let first = rounded((low - 128.0) * (1.0 / 256.0) + UP);
            let last = rounded((high - 128.0) * (1.0 / 256.0) - UP);
            (
                first.max(Vec4::splat(least)),
                last.min(Vec4::splat(most - 1.0)),
            )
        };
        let (first_x, last_x) = ends(0, left, right);
        let (first_y, last_y) = ends(1, top, bottom);
        let [bx, by] = b_off.map(Vec4::abs);
        let [cx, cy] = c_off.map(Vec4::abs);
        let reach = bx.max(by).max(cx.max(cy));
        let pixels = (last_x - first_x + 1.0) * (last_y - first_y + 1.0);
        let is_dropped = (area * screen.dropped_sign).cmpgt(Vec4::ZERO);
        let some =
            last_x.cmpge(first_x) & last_y.cmpge(first_y) & area.cmpne(Vec4::ZERO) & !is_dropped;
        Self {
            origin,
            b: b_off,
            c: c_off,
            area,
            first: [first_x, first_y],
            last: [last_x, last_y],
            known: a.is_within
                & b.is_within
                & c.is_within
                & reach.cmple(Vec4::splat(MOST_STEPS))
                & (!some | pixels.cmple(Vec4::splat(MOST_PIXELS))),
            some,
        }
    }

    #[inline]
    fn edges(&self) -> Edges {
        let at = [0, 1].map(|i| self.first[i] * 256.0 + 128.0 - self.origin[i]);
        let zero = [Vec4::ZERO; 2];
        // The sign turns those that are not clockwise.
        let sign = Vec4::ONE.copysign(self.area);
        let ends = [(&self.b, &self.c), (&self.c, &zero), (&zero, &self.b)];
        let dx = ends.map(|(from, to)| (to[0] - from[0]) * sign);
        let dy = ends.map(|(from, to)| (to[1] - from[1]) * sign);
        let value = |i: usize| dx[i] * (at[1] - ends[i].0[1]) - dy[i] * (at[0] - ends[i].0[0]);
        let least = |i: usize| {
            let is_top_left =
                dy[i].cmplt(Vec4::ZERO) | (dy[i].cmpeq(Vec4::ZERO) & dx[i].cmpgt(Vec4::ZERO));
            Vec4::select(is_top_left, Vec4::ZERO, Vec4::ONE)
        };
        Edges {
            values: [value(0), value(1), value(2)],
            least: [least(0), least(1), least(2)],
            dx,
            dy,
        }
    }
}

impl Edges {
    /// The triangles that cover the first pixel.
    #[inline]
    fn covered(&self) -> u32 {
        let inside = |i: usize| self.values[i].cmpge(self.least[i]);
        (inside(0) & inside(1) & inside(2)).bitmask()
    }

    /// Calls `write` with the edge functions at each pixel that the triangle of a lane covers, of so many columns and rows.
    #[inline]
    fn for_each(
        &self,
        lane: usize,
        (columns, rows): (usize, usize),
        mut write: impl FnMut([f32; 3]),
    ) {
        let of = |list: &[Vec4; 3]| list.map(|v| v[lane]);
        let least = of(&self.least);
        let (to_right, down) = (
            of(&self.dy).map(|d| -256.0 * d),
            of(&self.dx).map(|d| 256.0 * d),
        );
        let mut row = of(&self.values);
        for _ in 0..rows {
            let mut values = row;
            for _ in 0..columns {
                if values[0] >= least[0] && values[1] >= least[1] && values[2] >= least[2] {
                    write(values);
                }
                for (value, step) in values.iter_mut().zip(to_right) {
                    *value += step;
                }
            }
            for (value, step) in row.iter_mut().zip(down) {
                *value += step;
            }
        }
    }
}

/// The surface of a triangle where its corners have these weights, as the square of a pixel.
#[inline]
fn sample(corners: [&Vertex; 3], weights: Vec3) -> Splat {
    let w = weights / (weights.x + weights.y + weights.z);
    let [a, b, c] = corners;
    let center = a.position * w.x + b.position * w.y + c.position * w.z;
    // Three normals at once, as `octahedral::decode` does it.
    let component = |i: usize| {
        let codes = Vec4::new(
            f32::from(a.normal[i]),
            f32::from(b.normal[i]),
            f32::from(c.normal[i]),
            0.0,
        );
        (codes * (1.0 / 32767.0)).max(Vec4::NEG_ONE)
    };
    let (x, y) = (component(0), component(1));
    let z = Vec4::ONE - x.abs() - y.abs();
    let fold = (-z).max(Vec4::ZERO);
    let (x, y) = (x - fold.copysign(x), y - fold.copysign(y));
    // Alpha 0 marks a vertex without normal: it leaves the others to decide.
    let has_normal = |v: &Vertex| f32::from(u8::from(v.color[3] != 0));
    let shares = w * Vec3::new(has_normal(a), has_normal(b), has_normal(c));
    let shares = shares.extend(0.0) / (x * x + y * y + z * z).sqrt();
    let normal = Vec3::new(x.dot(shares), y.dot(shares), z.dot(shares));
    let color = |i: usize| {
        let [a, b, c] = [a, b, c].map(|v| f32::from(v.color[i]));
        (a * w.x + b * w.y + c * w.z + 0.5) as u8
    };
    let alpha = if normal == Vec3::ZERO { 0 } else { 255 };
    Splat {
        center,
        radius: 0.0,
        normal: octahedral::encode(normal),
        color: [color(0), color(1), color(2), alpha],
    }
}

/// Triangles that stay such, part by part.
pub type Rest = Vec<Vec<u32>>;

/// Room for the samples of so many triangles. Where more are found, triangles stay such.
pub fn room(triangles: usize) -> usize {
    let whole = triangles / parts::PART * part_room(parts::PART);
    whole + part_room(triangles % parts::PART)
}

/// One for each triangle, and as many again for those that cover several pixels.
fn part_room(triangles: usize) -> usize {
    2 * triangles + MOST_PIXELS as usize
}

/// Writes samples of the triangles with these ids to the start of `out`, in their order, and the ids of those that stay
/// triangles to `rest`. Returns how many were written.
///
/// # Panics
/// When `out` is shorter than [`room`].
pub fn pack(
    model: &Model,
    ids: &[u32],
    screen: &Screen,
    rest: &mut Rest,
    out: &mut [Splat],
) -> usize {
    rest.resize_with(ids.len().div_ceil(parts::PART), Vec::new);
    let parts = ids.chunks(parts::PART).zip(rest.iter_mut());
    let parts = parts.map(|(ids, rest)| ((ids, rest), part_room(ids.len())));
    let packed = parts::write(parts.collect(), out, |(ids, rest), sink| {
        rest.clear();
        for (index, four) in ids.chunks(4).enumerate() {
            let ahead = 4 * index + 2 * parts::AHEAD;
            for &next in ids.iter().skip(ahead).take(4) {
                for &corner in model.triangles.get(next as usize).into_iter().flatten() {
                    prefetch_index(&model.vertices, corner as usize);
                }
            }
            for &next in ids.iter().skip(ahead + 2 * parts::AHEAD).take(4) {
                prefetch_index(&model.triangles, next as usize);
            }
            self::four(model, four, screen, ids.len() - 4 * index, (rest, sink));
        }
    });
    packed.points
}

/// Up to four triangles; `left` are they and those that come after them.
#[inline]
fn four(
    model: &Model,
    ids: &[u32],
    screen: &Screen,
    left: usize,
    (rest, sink): (&mut Vec<u32>, &mut Sink<'_, Splat>),
) {
    let Some(&first) = ids.first() else { return };
    let lanes = [0, 1, 2, 3].map(|lane| ids.get(lane).copied().unwrap_or(first));
    let [a, b, c, d] = lanes.map(|id| model.triangles[id as usize]);
    let vertices: &[Vertex] = &model.vertices;
    let at = |index: u32| vertices[index as usize].position;
    // One after the other: a loop over corners would go through memory.
    let corners = [
        screen.corners([at(a[0]), at(b[0]), at(c[0]), at(d[0])]),
        screen.corners([at(a[1]), at(b[1]), at(c[1]), at(d[1])]),
        screen.corners([at(a[2]), at(b[2]), at(c[2]), at(d[2])]),
    ];
    let grid = OnGrid::new(screen, &corners);
    let valid = (1u32 << ids.len()) - 1;
    let known = grid.known.bitmask() & valid;
    for lane in set_bits(valid & !known) {
        rest.push(lanes[lane]);
    }
    let asked = known & grid.some.bitmask();
    if asked == 0 {
        return;
    }
    let is_one = grid.last[0].cmpeq(grid.first[0]) & grid.last[1].cmpeq(grid.first[1]);
    let many = asked & !is_one.bitmask();
    let write = |lane: usize, values: [f32; 3], sink: &mut Sink<'_, Splat>| {
        let weight = |i: usize| values[i] * corners[i].inverse_w[lane];
        let weights = Vec3::new(weight(0), weight(1), weight(2));
        let corners = [a, b, c, d][lane].map(|i| &vertices[i as usize]);
        sink.point(sample(corners, weights));
    };
    let edges = grid.edges();
    for lane in set_bits(edges.covered() & asked & !many) {
        write(lane, edges.values.map(|v| v[lane]), sink);
    }
    for lane in set_bits(many) {
        let size = |i: usize| (grid.last[i][lane] - grid.first[i][lane]) as usize + 1;
        let size = (size(0), size(1));
        // One for each of those that are left always has room.
        if sink.room() < size.0 * size.1 + left {
            rest.push(lanes[lane]);
            continue;
        }
        edges.for_each(lane, size, |values| write(lane, values, sink));
    }
}

/// Numbers of the bits of a mask.
#[inline]
fn set_bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (lane < 32).then_some(lane)
    })
}
