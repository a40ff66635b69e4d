//! Triangles: the polygon rasterization of the Vulkan specification (chapter "Rasterization", "Polygons"),
//! with edge functions (Pineda, "A Parallel Algorithm for Polygon Rasterization", 1988) in integers.

use crate::abi::Vertex;
use crate::pack::ListTextures;
use crate::render::reference::bands::PixelCoverage;
use crate::render::reference::clip::{ClipCorner, clip};
use crate::render::reference::frame::{PlacedVertex, ReferenceFrame, SubpixelGrid};
use crate::render::reference::shade::{SurfaceKind, SurfacePoint, color_of, normal_of};
use crate::textures::{TextureImage, TextureSlope};
use glam::{DVec2, DVec3};
use std::ops::Range;

/// A triangle ready to be rasterized: clockwise as seen in the picture (y down), so that the inside of every
/// edge function is positive.
pub(super) struct RasterTriangle<'a> {
    /// What it shows in the place of the colors of its corners.
    image: Option<&'a TextureImage>,
    corners: [SnappedCorner; 3],
    edges: [EdgeFunction; 3],
    /// Twice the area in snapped units, positive.
    area: f64,
    columns: Range<u32>,
    pub(super) rows: Range<u32>,
}

/// A corner with its window position on the grid of the frame.
#[derive(Clone, Copy)]
struct SnappedCorner {
    x: i64,
    y: i64,
    /// Reversed depth, linear in the window.
    depth: f64,
    inv_w: f64,
    surface: ClipCorner,
}

/// EdgeFunction i lies opposite of corner i; its function at pixel (x, y) is `dx_pixel * x + dy_pixel * y + constant`,
/// positive inside and proportional to the barycentric weight of corner i.
#[derive(Clone, Copy, Default)]
struct EdgeFunction {
    dx_pixel: i64,
    dy_pixel: i64,
    constant: i64,
    /// 0 when a pixel center exactly on the edge belongs to the triangle (top and left edges), else 1: the
    /// least value of the function inside.
    least: i64,
}

impl EdgeFunction {
    fn new(from: &SnappedCorner, to: &SnappedCorner, grid: SubpixelGrid) -> Self {
        let (dx, dy) = (to.x - from.x, to.y - from.y);
        let steps = grid.steps;
        let half = steps / 2;
        // A left edge runs up, a top edge runs right, in a clockwise triangle with y down.
        let is_top_left = dy < 0 || (dy == 0 && dx > 0);
        Self {
            dx_pixel: -dy * steps,
            dy_pixel: dx * steps,
            constant: dx * (half - from.y) - dy * (half - from.x),
            least: i64::from(!is_top_left),
        }
    }

    fn at(&self, x: i64, y: i64) -> i64 {
        self.dx_pixel * x + self.dy_pixel * y + self.constant
    }

    /// Narrows a range of columns to where the function is at least [`EdgeFunction::least`] in row `y`; exact.
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

/// Clips, projects, snaps and culls one triangle of the list, and gives what can cover a pixel center. `place` is the
/// vertex shader: the place of a vertex, `None` when it is not finite.
pub(super) fn set_up<'a>(
    frame: &ReferenceFrame,
    (vertices, textures): (&[Vertex], Option<ListTextures<'a>>),
    corners: [u32; 3],
    place: impl Fn(&Vertex) -> Option<PlacedVertex>,
) -> impl Iterator<Item = RasterTriangle<'a>> {
    let point = |i: u32| textures?.points.get(i as usize).copied();
    let image = point(corners[0]).and_then(|point| textures?.images.get(point.image as usize));
    let image: Option<&'a TextureImage> = image.map(|image| &**image);
    let corner = |i: u32| {
        let vertex = vertices.get(i as usize)?;
        let placed = place(vertex)?;
        Some(ClipCorner {
            clip: placed.clip.as_dvec4(),
            distance: f64::from(placed.distance),
            position: vertex.position.as_dvec3(),
            normal: normal_of(vertex.normal, vertex.color),
            color: color_of(vertex.color),
            place: point(i).map_or(DVec2::ZERO, |point| point.at.as_dvec2()),
        })
    };
    let polygon = match corners.map(corner) {
        [Some(a), Some(b), Some(c)] => clip(frame, [a, b, c]).unwrap_or_default(),
        _ => Vec::new(),
    };
    // A fan around the first corner.
    (2..polygon.len()).filter_map(move |i| {
        let fan = [polygon[0], polygon[i - 1], polygon[i]];
        project(frame, fan.map(|corner| snapped(frame, corner)), image)
    })
}

/// A corner in the window.
fn snapped(frame: &ReferenceFrame, surface: ClipCorner) -> SnappedCorner {
    let clip = surface.clip;
    let [x, y] = frame.window(clip.x / clip.w, clip.y / clip.w);
    SnappedCorner {
        x: frame.grid.snap(x),
        y: frame.grid.snap(y),
        depth: clip.z / clip.w,
        inv_w: 1.0 / clip.w,
        surface,
    }
}

fn project<'a>(
    frame: &ReferenceFrame,
    [a, mut b, mut c]: [SnappedCorner; 3],
    image: Option<&'a TextureImage>,
) -> Option<RasterTriangle<'a>> {
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
    let columns = frame.grid.pixels_between(left, right, frame.view.width);
    let rows = frame.grid.pixels_between(top, bottom, frame.view.height);
    if columns.is_empty() || rows.is_empty() {
        return None;
    }
    Some(RasterTriangle {
        image: image.filter(|_| frame.style.use_colors),
        edges: [[&b, &c], [&c, &a], [&a, &b]]
            .map(|[from, to]| EdgeFunction::new(from, to, frame.grid)),
        corners: [a, b, c],
        area: area as f64,
        columns,
        rows,
    })
}

/// A triangle at a pixel center.
#[derive(Clone, Copy)]
pub(super) struct TriangleSample {
    /// Reversed depth, within 0..=1.
    pub(super) depth: f32,
    /// Barycentric weights in the window, of the snapped corners: never negative, so no value leaves the range of its
    /// corners, however thin the triangle is.
    weights: [f64; 3],
}

impl PixelCoverage for RasterTriangle<'_> {
    type Sample = TriangleSample;

    fn rows(&self) -> Range<u32> {
        self.rows.clone()
    }

    /// The columns whose pixel centers lie in the triangle, exactly.
    fn columns(&self, y: u32) -> Range<u32> {
        let all = i64::from(self.columns.start)..i64::from(self.columns.end);
        let inside = (self.edges.iter()).fold(all.clone(), |columns, edge| {
            edge.narrow(i64::from(y), columns)
        });
        let start = inside.start.clamp(all.start, all.end);
        start as u32..inside.end.clamp(start, all.end) as u32
    }

    fn sample(&self, x: u32, y: u32) -> Option<TriangleSample> {
        let [a, b, c] = &self.corners;
        let at = |edge: EdgeFunction| edge.at(i64::from(x), i64::from(y)) as f64 / self.area;
        let [wa, wb, wc] = self.edges.map(at);
        Some(TriangleSample {
            depth: (wa * a.depth + wb * b.depth + wc * c.depth).clamp(0.0, 1.0) as f32,
            weights: [wa, wb, wc],
        })
    }
}

impl RasterTriangle<'_> {
    /// The color of an image at a place whose corners have weights in proportion to these, before they are divided by their
    /// sum: bilinear, of both nearest levels by the exact slopes of texture coordinates in the picture.
    fn texels(&self, image: &TextureImage, weights: [f64; 3]) -> DVec3 {
        let sum: f64 = weights.iter().sum();
        let mean = |weights: [f64; 3]| -> DVec2 {
            let corners = self.corners.iter().zip(weights);
            corners
                .map(|(corner, weight)| weight * corner.surface.place)
                .sum()
        };
        let place = mean(weights) / sum;
        let slope = |step: fn(&EdgeFunction) -> i64| {
            let steps = [0, 1, 2]
                .map(|i: usize| step(&self.edges[i]) as f64 / self.area * self.corners[i].inv_w);
            let of_sum: f64 = steps.iter().sum();
            (mean(steps) - place * of_sum) / sum
        };
        let slope = TextureSlope {
            right: slope(|edge| edge.dx_pixel).as_vec2(),
            down: slope(|edge| edge.dy_pixel).as_vec2(),
        };
        image
            .sample(place.as_vec2(), image.level_of(slope))
            .as_dvec3()
    }

    /// The surface at a sample.
    pub(super) fn surface(&self, sample: TriangleSample) -> SurfacePoint {
        let [wa, wb, wc] = sample.weights;
        let [a, b, c] = &self.corners;
        let (pa, pb, pc) = (wa * a.inv_w, wb * b.inv_w, wc * c.inv_w);
        let sum = pa + pb + pc;
        let color = self.image.map(|image| self.texels(image, [pa, pb, pc]));
        let (pa, pb, pc) = (pa / sum, pb / sum, pc / sum);
        let (a, b, c) = (&a.surface, &b.surface, &c.surface);
        SurfacePoint {
            kind: SurfaceKind::Triangle,
            position: pa * a.position + pb * b.position + pc * c.position,
            color: color.unwrap_or(pa * a.color + pb * b.color + pc * c.color),
            normal: (pa * a.normal + pb * b.normal + pc * c.normal).normalize_or_zero(),
            light_share: 1.0,
            distance: pa * a.distance + pb * b.distance + pc * c.distance,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec2, DVec3, DVec4};
    use proptest::prelude::*;

    fn corner([x, y]: [i64; 2]) -> SnappedCorner {
        SnappedCorner {
            x,
            y,
            depth: 0.5,
            inv_w: 1.0,
            surface: ClipCorner {
                clip: DVec4::W,
                distance: 1.0,
                position: DVec3::ZERO,
                normal: DVec3::ZERO,
                color: DVec3::ONE,
                place: DVec2::ZERO,
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
            let edge = EdgeFunction::new(&corner(from), &corner(to), SubpixelGrid::new(8));
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
            let scaled = |p: [i64; 2]| corner(p.map(|v| v * 128));
            prop_assume!(from != to);
            let grid = SubpixelGrid::new(8);
            let (a, b) = (scaled(from), scaled(to));
            let (there, back) = (EdgeFunction::new(&a, &b, grid), EdgeFunction::new(&b, &a, grid));
            for y in -6..6 {
                for x in -6..6 {
                    prop_assert_ne!(there.at(x, y) >= there.least, back.at(x, y) >= back.least);
                }
            }
        }
    }
}
