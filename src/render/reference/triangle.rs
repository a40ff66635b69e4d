//! Triangles: the polygon rasterization of the Vulkan specification (chapter "Rasterization", "Polygons"),
//! with edge functions (Pineda, "A Parallel Algorithm for Polygon Rasterization", 1988) in integers.

use crate::abi::Vertex;
use crate::render::reference::clip::{Corner, clip};
use crate::render::reference::shade::{Kind, color_of, normal_of};
use crate::render::reference::target::{Band, Fragment};
use crate::render::reference::{Frame, Placed, SUBPIXELS, pixels_between, snap};
use glam::DVec3;
use std::ops::Range;

/// A triangle ready to be rasterized: clockwise as seen in the picture (y down), so that the inside of every
/// edge function is positive.
pub(super) struct Triangle {
    corners: [Snapped; 3],
    edges: [Edge; 3],
    /// Twice the area in snapped units, positive.
    area: f64,
    columns: Range<u32>,
    pub(super) rows: Range<u32>,
}

/// A corner with its window position on the 1/256 pixel grid.
#[derive(Clone, Copy)]
struct Snapped {
    x: i64,
    y: i64,
    /// Reversed depth, linear in the window.
    depth: f64,
    inv_w: f64,
    surface: Corner,
}

/// Edge i lies opposite of corner i; its function at pixel (x, y) is `dx_pixel * x + dy_pixel * y + constant`,
/// positive inside and proportional to the barycentric weight of corner i.
#[derive(Clone, Copy, Default)]
struct Edge {
    dx_pixel: i64,
    dy_pixel: i64,
    constant: i64,
    /// 0 when a pixel center exactly on the edge belongs to the triangle (top and left edges), else 1: the
    /// least value of the function inside.
    least: i64,
}

impl Edge {
    fn new(from: &Snapped, to: &Snapped) -> Self {
        let (dx, dy) = (to.x - from.x, to.y - from.y);
        let half = SUBPIXELS / 2;
        // A left edge runs up, a top edge runs right, in a clockwise triangle with y down.
        let is_top_left = dy < 0 || (dy == 0 && dx > 0);
        Self {
            dx_pixel: -dy * SUBPIXELS,
            dy_pixel: dx * SUBPIXELS,
            constant: dx * (half - from.y) - dy * (half - from.x),
            least: i64::from(!is_top_left),
        }
    }

    fn at(&self, x: i64, y: i64) -> i64 {
        self.dx_pixel * x + self.dy_pixel * y + self.constant
    }

    /// Narrows a range of columns to where the function is at least [`Edge::least`] in row `y`; exact.
    fn narrow(&self, y: i64, columns: Range<i64>) -> Range<i64> {
        // dx_pixel * x >= missing
        let missing = self.least - self.at(0, y);
        match self.dx_pixel.signum() {
            // x >= ceil(missing / d), and ceil(a / b) = -floor(-a / b)
            1 => columns.start.max(-(-missing).div_euclid(self.dx_pixel))..columns.end,
            // |d| x <= -missing
            -1 => columns.start..columns.end.min((-missing).div_euclid(-self.dx_pixel) + 1),
            _ if missing <= 0 => columns,
            _ => 0..0,
        }
    }
}

/// Clips, projects, snaps and culls one triangle of the list; pushes what can cover a pixel center.
pub(super) fn set_up(
    frame: &Frame,
    vertices: &[Vertex],
    corners: [u32; 3],
    out: &mut Vec<Triangle>,
) {
    set_up_placed(
        frame,
        vertices,
        corners,
        |vertex| frame.place(vertex.position),
        out,
    );
}

/// [`set_up`] with a vertex shader of its own: `place` gives the place of a vertex, `None` when it is not
/// finite.
pub(super) fn set_up_placed(
    frame: &Frame,
    vertices: &[Vertex],
    corners: [u32; 3],
    place: impl Fn(&Vertex) -> Option<Placed>,
    out: &mut Vec<Triangle>,
) {
    let corner = |i: u32| {
        let vertex = vertices.get(i as usize)?;
        let placed = place(vertex)?;
        Some(Corner {
            clip: placed.clip.as_dvec4(),
            distance: f64::from(placed.distance),
            position: vertex.position.as_dvec3(),
            normal: normal_of(vertex.normal, vertex.color),
            color: color_of(vertex.color),
        })
    };
    let [Some(a), Some(b), Some(c)] = corners.map(corner) else {
        return;
    };
    let Some(polygon) = clip(frame, [a, b, c]) else {
        return;
    };
    let window = |c: &Corner| {
        let [x, y] = frame.window(c.clip.x / c.clip.w, c.clip.y / c.clip.w);
        Snapped {
            x: snap(x),
            y: snap(y),
            depth: c.clip.z / c.clip.w,
            inv_w: 1.0 / c.clip.w,
            surface: *c,
        }
    };
    let first = window(&polygon[0]);
    for pair in polygon[1..].windows(2) {
        out.extend(project(frame, [first, window(&pair[0]), window(&pair[1])]));
    }
}

fn project(frame: &Frame, [a, mut b, mut c]: [Snapped; 3]) -> Option<Triangle> {
    // Twice the signed area with y down: positive when clockwise in the picture. A front face is
    // counter-clockwise there, unless the view mirrors.
    let mut area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if area == 0 || (frame.style.cull_back_faces && (area > 0) != frame.is_mirrored) {
        return None;
    }
    if area < 0 {
        std::mem::swap(&mut b, &mut c);
        area = -area;
    }
    let range = |v: [i64; 3]| {
        let [p, q, r] = v;
        // The far side is inclusive here; the edge functions decide.
        (p.min(q).min(r), p.max(q).max(r) + 1)
    };
    let (left, right) = range([a.x, b.x, c.x]);
    let (top, bottom) = range([a.y, b.y, c.y]);
    let columns = pixels_between(left, right, frame.view.width);
    let rows = pixels_between(top, bottom, frame.view.height);
    if columns.is_empty() || rows.is_empty() {
        return None;
    }
    Some(Triangle {
        edges: [Edge::new(&b, &c), Edge::new(&c, &a), Edge::new(&a, &b)],
        corners: [a, b, c],
        area: area as f64,
        columns,
        rows,
    })
}

/// What the surface is at a pixel center.
pub(super) struct Surface {
    /// Model space.
    pub(super) position: DVec3,
    /// Unit, or zero where the surface has none.
    pub(super) normal: DVec3,
    /// Value / 255.
    pub(super) color: DVec3,
    /// View-space distance.
    pub(super) distance: f64,
}

impl Triangle {
    /// Calls `visit(x, y, depth, weights)` for every pixel of `rows` whose center the triangle covers: its
    /// reversed depth, and the weights for [`Triangle::surface`].
    #[inline]
    pub(super) fn for_each_pixel(
        &self,
        rows: Range<u32>,
        mut visit: impl FnMut(u32, u32, f32, [f64; 3]),
    ) {
        let [a, b, c] = &self.corners;
        for y in rows {
            let row = i64::from(y);
            let mut columns = i64::from(self.columns.start)..i64::from(self.columns.end);
            for edge in &self.edges {
                columns = edge.narrow(row, columns);
            }
            for x in columns {
                // Barycentric weights in the window, of the snapped corners: never negative, so no value
                // leaves the range of its corners, however thin the triangle is.
                let [wa, wb, wc] = self.edges.map(|edge| edge.at(x, row) as f64 / self.area);
                let depth = (wa * a.depth + wb * b.depth + wc * c.depth).clamp(0.0, 1.0) as f32;
                visit(x as u32, y, depth, [wa, wb, wc]);
            }
        }
    }

    /// The surface where the corners have these weights in the window.
    #[inline]
    pub(super) fn surface(&self, [wa, wb, wc]: [f64; 3]) -> Surface {
        let [a, b, c] = &self.corners;
        let (pa, pb, pc) = (wa * a.inv_w, wb * b.inv_w, wc * c.inv_w);
        let sum = pa + pb + pc;
        let (pa, pb, pc) = (pa / sum, pb / sum, pc / sum);
        let (a, b, c) = (&a.surface, &b.surface, &c.surface);
        Surface {
            position: pa * a.position + pb * b.position + pc * c.position,
            color: pa * a.color + pb * b.color + pc * c.color,
            normal: (pa * a.normal + pb * b.normal + pc * c.normal).normalize_or_zero(),
            distance: pa * a.distance + pb * b.distance + pc * c.distance,
        }
    }
}

/// Draws the rows of a triangle that lie in the band.
pub(super) fn rasterize(frame: &Frame, triangle: &Triangle, band: &mut Band) {
    triangle.for_each_pixel(band.rows(&triangle.rows), |x, y, depth, weights| {
        band.put(x, y, depth, || {
            let surface = triangle.surface(weights);
            Fragment {
                color: frame.shading.color(
                    Kind::Triangle,
                    surface.position,
                    surface.normal,
                    surface.color,
                ),
                normal: surface.normal.as_vec3().to_array(),
                distance: surface.distance as f32,
            }
        });
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec4;
    use proptest::prelude::*;

    fn snapped([x, y]: [i64; 2]) -> Snapped {
        Snapped {
            x,
            y,
            depth: 0.5,
            inv_w: 1.0,
            surface: Corner {
                clip: DVec4::W,
                distance: 1.0,
                position: DVec3::ZERO,
                normal: DVec3::ZERO,
                color: DVec3::ONE,
            },
        }
    }

    proptest! {
        /// The closed form of the columns is the edge function tried at every pixel.
        #[test]
        fn a_row_is_narrowed_to_exactly_the_pixels_inside(
            from in prop::array::uniform2(-3000i64..3000),
            to in prop::array::uniform2(-3000i64..3000),
            y in -4i64..12,
        ) {
            let edge = Edge::new(&snapped(from), &snapped(to));
            let narrowed = edge.narrow(y, -4..12);
            for x in -4..12 {
                prop_assert_eq!(narrowed.contains(&x), edge.at(x, y) >= edge.least, "column {}", x);
            }
        }

        /// Both triangles at an edge: each pixel of the line belongs to exactly one side.
        #[test]
        fn an_edge_and_its_reverse_share_no_pixel_and_lose_none(
            from in prop::array::uniform2(-8i64..8),
            to in prop::array::uniform2(-8i64..8),
        ) {
            // Ends on pixel centers and corners, so that many centers lie exactly on the line.
            let scaled = |p: [i64; 2]| snapped(p.map(|v| v * 128));
            prop_assume!(from != to);
            let (a, b) = (scaled(from), scaled(to));
            let (there, back) = (Edge::new(&a, &b), Edge::new(&b, &a));
            for y in -6..6 {
                for x in -6..6 {
                    prop_assert_ne!(there.at(x, y) >= there.least, back.at(x, y) >= back.least);
                }
            }
        }
    }
}
