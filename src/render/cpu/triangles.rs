//! Triangles beside the splats, of any size: what passes filtered.depth and filtered.blend make of them, by compute
//! (`shaders/compute/depth_triangles.comp`, `shaders/compute/blend_triangles.comp`) and by the rasterizer.
//!
//! Which pixels a triangle covers, and at which depth, is found by the same operations as in
//! `shaders/common/vertex_record.glsl`, so the front is the same to the bit. Of its shade the last places may be others: a
//! shader's root need not be exact.

mod surface;

pub(super) use self::surface::{FaceSurface, FaceTexture, SurfaceMesh};

use crate::abi::constants::{
    COARSE_STEPS, FLAG_COLOR_BY_PRIMITIVE, FLAG_PARALLEL_LIGHT, FLAG_TWO_SIDED, FLAG_USE_COLORS,
};
use crate::abi::{FrameConstants, Vertex};
use crate::math::octahedral;
use crate::pack::small_triangles::{CornerScreen, PlacedCorner};
use crate::pack::{ALBEDO, parallel};
use crate::render::cpu::clip;
use crate::render::cpu::corner_push::CornerPush;
use crate::render::cpu::filtered::{FilteredBand, PictureArea};
use crate::render::cpu::frame_shading::{
    FrameShading, ShadedPoint, TRIANGLE_TINT, TrianglePoint, unit_or_zero,
};
use crate::tree::Model;
use glam::{Mat3, Vec2, Vec3, Vec4};
use prefetch_index::prefetch_index;

/// Corners farther out, 16,384 pixels, are clipped. Up to there a sum with [`WHOLE`] has no places behind the point, and
/// is rounded to even.
const MOST_STEPS: f32 = (1 << 22) as f32;
const WHOLE: f32 = 3.0 * MOST_STEPS;

/// Triangles whose rows are known together. They lie near each other, in the order of the tree.
const GROUP: usize = 16;

/// How far ahead of a triangle the memory of another one is asked for: first its corners, then their vertices.
const AHEAD: usize = 2 * parallel::AHEAD;

/// The light of a frame, and where the device places corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameLight {
    screen: CornerScreen,
    shading: FrameShading,
    /// From model to view space.
    turn: Mat3,
    /// As [`FrameConstants::ray_scale`] and `ray_offset`.
    pub(super) ray_scale: Vec2,
    pub(super) ray_offset: Vec2,
    pub(super) is_parallel: bool,
    pub(super) is_two_sided: bool,
    /// Of white; and whether surfaces have colors of their own.
    pub(super) albedo: Vec3,
    pub(super) has_colors: bool,
    /// By how much corners are pushed away from the eye.
    push: Option<CornerPush>,
}

impl FrameLight {
    /// Light of a frame; none where it shows data, or has a lamp, which is the device's.
    pub fn new(frame: &FrameConstants, screen: CornerScreen) -> Option<Self> {
        let light = Self::of_frame(frame, screen);
        light.shading.has_headlight().then_some(light)
    }

    /// Light of a frame, which may have a lamp or show data.
    pub(super) fn of_frame(frame: &FrameConstants, screen: CornerScreen) -> Self {
        let has = |flag: u32| frame.flags & flag != 0;
        let is_tinted = has(FLAG_COLOR_BY_PRIMITIVE);
        let [x, y, z, _] = frame.view_from_model;
        let column = |[x, y, z, _]: [f32; 4]| Vec3::new(x, y, z);
        Self {
            screen,
            shading: FrameShading::new(frame),
            turn: Mat3::from_cols(column(x), column(y), column(z)),
            ray_scale: frame.ray_scale.into(),
            ray_offset: frame.ray_offset.into(),
            is_parallel: has(FLAG_PARALLEL_LIGHT),
            is_two_sided: has(FLAG_TWO_SIDED),
            albedo: if is_tinted {
                ALBEDO * TRIANGLE_TINT
            } else {
                Vec3::splat(ALBEDO)
            },
            has_colors: has(FLAG_USE_COLORS) && !is_tinted,
            push: None,
        }
    }

    /// The same, with triangles where the first of two passes that blend has them.
    pub(super) fn pushed(self, frame: &FrameConstants) -> Self {
        Self {
            push: Some(CornerPush::of_frame(frame)),
            ..self
        }
    }

    /// Clip position of a corner.
    #[inline]
    fn clip(&self, vertex: &Vertex) -> Vec4 {
        match &self.push {
            None => self.screen.clip(vertex.position),
            Some(push) => {
                let at = self.screen.in_view(vertex.position);
                let normal = match vertex.color[3] {
                    0 => Vec3::ZERO,
                    _ => unit_or_zero(self.turn * octahedral::decode(vertex.normal)),
                };
                self.screen.clip_of_view(push.pushed(at, normal))
            }
        }
    }
}

/// A triangle that may cover a center of a pixel, clockwise in the picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct PictureFace {
    /// The first corner, steps of 1/256 pixel from the corner of the picture, and the others from there.
    pub(super) origin: [i32; 2],
    pub(super) others: [[i32; 2]; 2],
    /// Reversed depth and 1 / w of the corners, and which vertices they are.
    pub(super) depth: Vec3,
    pub(super) inverse_w: Vec3,
    corners: [u32; 3],
    /// Pixels that it may cover: left, top, and one past right and bottom.
    pub(super) pixels: [u32; 4],
    /// Index into [`FacePart::clipped`] of a piece of a clipped triangle; else [`WHOLE_TRIANGLE`].
    clipped: u32,
}

/// The index of a triangle that is not clipped.
const WHOLE_TRIANGLE: u32 = u32::MAX;

/// Each mesh that triangles are of.
pub type MeshVertices<'a> = &'a [SurfaceMesh<'a>];

/// A triangle with the part that it is of, and its number among those of all parts.
#[derive(Debug, Clone, Copy)]
pub(super) struct NumberedFace<'a> {
    pub(super) part: &'a FacePart,
    pub(super) face: &'a PictureFace,
    pub(super) number: u32,
}

/// The triangles of a cut, as [`crate::render::cpu::filtered::draw`] draws them; none by default. Memory is kept from cut to cut.
#[derive(Debug, Default)]
pub struct CutTriangles {
    /// None where there are no triangles, or others are the device's.
    light: Option<FrameLight>,
    parts: Vec<FacePart>,
}

/// What one thread sets up.
#[derive(Debug, Default)]
pub(super) struct FacePart {
    /// Number of the first among those of all parts.
    first: u32,
    /// Index of the mesh that they are of.
    mesh: usize,
    faces: Vec<PictureFace>,
    /// The first row that those of each [`GROUP`] may cover, and one past the last.
    rows: Vec<[u32; 2]>,
    /// Of pieces of clipped triangles: the weights of the triangle's corners at those of the piece, a column each.
    clipped: Vec<Mat3>,
}

impl CutTriangles {
    /// Becomes those with these ids in the light of a frame, clipped to what the frame can show. Without a light, of which
    /// [`FrameLight::new`] has none, it says so and becomes none, unless there are none.
    #[must_use]
    pub fn set(&mut self, model: &Model, ids: &[u32], light: Option<FrameLight>) -> bool {
        self.set_all(&[(model, ids)], light)
    }

    /// As [`CutTriangles::set`], of several models; a triangle belongs to the mesh of its model's index.
    #[must_use]
    pub fn set_all(&mut self, drawn: &[(&Model, &[u32])], light: Option<FrameLight>) -> bool {
        self.light = light;
        let count = drawn.iter().map(|(_, ids)| ids.len()).sum();
        let Some(light) = &self.light else {
            self.parts.clear();
            return count == 0;
        };
        let chunks = drawn.iter().enumerate().flat_map(|(mesh, &(model, ids))| {
            let chunks = ids.chunks(parallel::PART);
            chunks.map(move |ids| (mesh, model, ids))
        });
        let chunks: Vec<(usize, &Model, &[u32])> = chunks.collect();
        self.parts.resize_with(chunks.len(), FacePart::default);
        let jobs = chunks.into_iter().zip(&mut self.parts);
        parallel::share(count, jobs, |((mesh, model, ids), part)| {
            part.mesh = mesh;
            light.fill(part, model, ids);
        });
        let mut first = 0;
        for part in &mut self.parts {
            part.first = first;
            first += part.faces.len() as u32;
        }
        true
    }

    /// How many may cover a pixel.
    pub fn count(&self) -> usize {
        self.parts.iter().map(|part| part.faces.len()).sum()
    }

    /// Tells whether they are of this part of a picture: left, top, and one past right and bottom, pixels.
    pub(super) fn are_within(&self, rect_px: [u32; 4]) -> bool {
        (self.light).is_none_or(|light| light.screen.rect_px() == rect_px)
    }

    /// Faces that may cover a pixel of some rows, in their order.
    pub(super) fn near(&self, rows: [u32; 2]) -> impl Iterator<Item = NumberedFace<'_>> {
        let are_near = move |[first, end]: [u32; 2]| first < rows[1] && end > rows[0];
        self.parts.iter().flat_map(move |part| {
            let groups = part.faces.chunks(GROUP).zip((part.first..).step_by(GROUP));
            let near = groups.zip(&part.rows);
            let near = near.filter(move |(_, rows)| are_near(**rows));
            near.flat_map(|((faces, first), _)| faces.iter().zip(first..))
                .filter(move |(face, _)| are_near(face.rows()))
                .map(move |(face, number)| NumberedFace { part, face, number })
        })
    }

    /// The one of a number that [`CutTriangles::near`] gave.
    pub(super) fn numbered(&self, number: u32) -> Option<NumberedFace<'_>> {
        let parts = self.parts.partition_point(|part| part.first <= number);
        let part = self.parts.get(parts.checked_sub(1)?)?;
        let face = part.faces.get((number - part.first) as usize)?;
        Some(NumberedFace { part, face, number })
    }

    /// The light that they are in; none where there are none.
    pub(super) fn light(&self) -> Option<&FrameLight> {
        self.light.as_ref()
    }

    /// Leaves their depths in the pixels that they cover.
    pub(super) fn leave_depths(&self, canvas: &PictureArea, band: &mut FilteredBand<'_>) {
        for NumberedFace { face, .. } in self.near(band.rows) {
            face.for_each_pixel(band.rows, |[x, y], weights| {
                let depth = face.depth_at(weights).to_bits();
                let at = canvas.index(band.rows, [x, y]);
                band.front[at] = band.front[at].max(depth);
            });
        }
    }

    /// Adds their shades with weight 1 where nothing hides them.
    pub(super) fn blend(
        &self,
        meshes: MeshVertices<'_>,
        canvas: &PictureArea,
        band: &mut FilteredBand<'_>,
    ) {
        let Some(light) = &self.light else { return };
        for NumberedFace { part, face, .. } in self.near(band.rows) {
            // Most are hidden, or share what they are like with no other pixel.
            let mut surface = None;
            face.for_each_pixel(band.rows, |[x, y], weights| {
                let at = canvas.index(band.rows, [x, y]);
                let depth = face.depth_at(weights);
                if band.front[at] > depth.to_bits() {
                    return;
                }
                let surface =
                    surface.get_or_insert_with(|| FaceSurface::of(face, part, meshes, light));
                let place = SurfacePlace {
                    pixel: [x, y],
                    weights: weights * face.inverse_w,
                    depth,
                };
                let color = light.color_at(surface, &place);
                let [red, green, blue] = color.to_array().map(in_steps);
                let weight = in_steps(1.0);
                let words = canvas.words();
                let sums = &mut band.sums[words * at..][..words];
                if canvas.is_gray {
                    sums[0] += red | weight << 32;
                } else {
                    sums[0] += red | green << 32;
                    sums[1] += blue | weight << 32;
                }
            });
        }
    }
}

/// In whole steps of the sums of large weights.
fn in_steps(value: f32) -> u64 {
    u64::from((value * COARSE_STEPS + 0.5) as u32)
}

impl PictureArea {
    /// Where a pixel lies in a band that begins at a row.
    pub(super) fn index(&self, [first, _]: [u32; 2], [x, y]: [u32; 2]) -> usize {
        (y - first) as usize * self.width() + (x - self.rect_px[0]) as usize
    }
}

impl PictureFace {
    fn rows(&self) -> [u32; 2] {
        [self.pixels[1], self.pixels[3]]
    }

    /// Calls `visit` for all pixels of some rows whose centers the triangle covers, with the weights of the corners in the
    /// window.
    #[inline]
    pub(super) fn for_each_pixel(&self, rows: [u32; 2], mut visit: impl FnMut([u32; 2], Vec3)) {
        let [left, _, right, _] = self.pixels;
        let (top, bottom) = (self.pixels[1].max(rows[0]), self.pixels[3].min(rows[1]));
        let (area, edges) = self.edges_from([left, top]);
        let mut starts = edges.map(|edge| edge.first);
        for y in top..bottom {
            let [mut a, mut b, mut c] = starts;
            let mut was_inside = false;
            for x in left..right {
                // None is below its least value.
                if (a - edges[0].least) | (b - edges[1].least) | (c - edges[2].least) >= 0 {
                    visit([x, y], Vec3::new(a as f32, b as f32, c as f32) / area);
                    was_inside = true;
                } else if was_inside {
                    break;
                }
                a += edges[0].right;
                b += edges[1].right;
                c += edges[2].right;
            }
            for (start, edge) in starts.iter_mut().zip(&edges) {
                *start += edge.down;
            }
        }
    }

    /// Twice the area, steps^2 of 1/256 pixel, and the functions of the edges opposite the corners, which are at their first
    /// value at the center of a pixel.
    #[inline]
    pub(super) fn edges_from(&self, pixel: [u32; 2]) -> (f32, [FaceEdge; 3]) {
        let [second, third] = self.others.map(|corner| corner.map(i64::from));
        let area = (second[0] * third[1] - second[1] * third[0]) as f32;
        let center =
            |axis: usize| 256 * i64::from(pixel[axis]) + 128 - i64::from(self.origin[axis]);
        let first = [center(0), center(1)];
        let edges = [
            FaceEdge::new(second, third, first),
            FaceEdge::new(third, [0; 2], first),
            FaceEdge::new([0; 2], second, first),
        ];
        (area, edges)
    }

    /// Where the surface is at the center of a pixel that it covers.
    pub(super) fn place_at(&self, pixel: [u32; 2], depth: f32) -> SurfacePlace {
        let (area, edges) = self.edges_from(pixel);
        let [a, b, c] = edges.map(|edge| edge.first as f32 / area);
        SurfacePlace {
            pixel,
            weights: Vec3::new(a, b, c) * self.inverse_w,
            depth,
        }
    }

    #[inline]
    pub(super) fn depth_at(&self, weights: Vec3) -> f32 {
        let of = weights * self.depth;
        (of.x + of.y + of.z).clamp(0.0, 1.0)
    }
}

/// A function that is positive inside of an edge and proportional to the weight of the corner opposite.
#[derive(Clone, Copy)]
pub(super) struct FaceEdge {
    /// At the first pixel, and by how much it grows to the next one of the row and of the column.
    pub(super) first: i64,
    pub(super) right: i64,
    pub(super) down: i64,
    /// The least value inside: 1 where a center exactly on the edge belongs to the neighbor.
    pub(super) least: i64,
}

impl FaceEdge {
    fn new(from: [i64; 2], to: [i64; 2], at: [i64; 2]) -> Self {
        let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
        // A left edge runs up, a top edge to the right, with y down.
        let is_top_left = dy < 0 || (dy == 0 && dx > 0);
        Self {
            first: dx * (at[1] - from[1]) - dy * (at[0] - from[0]),
            right: -256 * dy,
            down: 256 * dx,
            least: i64::from(!is_top_left),
        }
    }
}

/// Tells whether whole steps can say where a corner is.
fn is_within_reach(placed: &PlacedCorner) -> bool {
    placed.steps.iter().all(|steps| steps.abs() <= MOST_STEPS)
}

/// A place on a triangle, at the center of a pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct SurfacePlace {
    pixel: [u32; 2],
    /// Of the corners, in proportion to these; their sum is 1 over the last component of clip space.
    weights: Vec3,
    /// Reversed.
    depth: f32,
}

impl SurfacePlace {
    fn inverse_w(&self) -> f32 {
        self.weights.x + self.weights.y + self.weights.z
    }
}

impl FrameLight {
    /// Fills a part with those of these triangles that may cover a pixel.
    fn fill(&self, part: &mut FacePart, model: &Model, ids: &[u32]) {
        part.faces.clear();
        part.clipped.clear();
        for (index, &id) in ids.iter().enumerate() {
            if let Some(&next) = ids.get(index + AHEAD) {
                prefetch_index(&model.triangles, next as usize);
            }
            if let Some(&next) = ids.get(index + AHEAD / 2) {
                for corner in model.triangles[next as usize] {
                    prefetch_index(&model.vertices, corner as usize);
                }
            }
            let corners = model.triangles[id as usize];
            let clip = corners.map(|vertex| self.clip(&model.vertices[vertex as usize]));
            match clip.map(|clip| self.screen.place_clip(clip)) {
                [Some(a), Some(b), Some(c)] if [a, b, c].iter().all(is_within_reach) => {
                    part.faces.extend(self.face([a, b, c], corners));
                }
                _ => self.add_clipped(part, corners, clip),
            }
        }
        part.rows.clear();
        part.rows.extend(part.faces.chunks(GROUP).map(|group| {
            let rows = group.iter().map(PictureFace::rows);
            rows.fold([u32::MAX, 0], |a, b| [a[0].min(b[0]), a[1].max(b[1])])
        }));
    }

    /// Adds the pieces of a triangle that are between the near and the far plane and within reach of whole steps.
    #[cold]
    fn add_clipped(&self, part: &mut FacePart, corners: [u32; 3], clip: [Vec4; 3]) {
        let polygon = clip::clipped(clip, self.screen.viewport_px());
        for pieces in 1..polygon.len().max(2) - 1 {
            let piece = [&polygon[0], &polygon[pieces], &polygon[pieces + 1]];
            let placed = piece.map(|corner| self.screen.place_clip(corner.clip));
            let [Some(a), Some(b), Some(c)] = placed else {
                continue;
            };
            // Which corner of the piece the face has second is decided by how it turns.
            let numbers = [0, 1, 2];
            if let Some(face) = self.face([a, b, c], numbers) {
                let weights = face.corners.map(|number| piece[number as usize].weights);
                part.faces.push(PictureFace {
                    corners,
                    clipped: part.clipped.len() as u32,
                    ..face
                });
                part.clipped
                    .push(Mat3::from_cols(weights[0], weights[1], weights[2]));
            }
        }
    }

    /// A triangle of corners that are within reach, if it may cover a pixel.
    fn face(
        &self,
        placed: [PlacedCorner; 3],
        [first, mut second, mut third]: [u32; 3],
    ) -> Option<PictureFace> {
        let steps = placed.map(|corner| corner.steps.map(|steps| (steps + WHOLE - WHOLE) as i32));
        let [a, mut b, mut c] = placed;
        let origin = steps[0];
        let from_origin = |steps: [i32; 2]| [0, 1].map(|axis| steps[axis] - origin[axis]);
        let mut others = [from_origin(steps[1]), from_origin(steps[2])];
        let [[bx, by], [cx, cy]] = others.map(|other| other.map(i64::from));
        let area = bx * cy - by * cx;
        if area == 0 || self.screen.is_dropped(area.signum()) {
            return None;
        }
        if area < 0 {
            others.swap(0, 1);
            std::mem::swap(&mut b, &mut c);
            std::mem::swap(&mut second, &mut third);
        }
        let [least_x, least_y, most_x, most_y] = self.screen.rect_px();
        let range = |axis: usize, least: u32, most: u32| {
            let [b, c] = others.map(|other| other[axis]);
            let (low, high) = (
                b.min(c).min(0) + origin[axis],
                b.max(c).max(0) + origin[axis],
            );
            // The center of pixel i is at 256 i + 128.
            let first = ((low + 127) >> 8).max(least as i32);
            let end = (((high - 128) >> 8) + 1).min(most as i32);
            [first as u32, end.max(first) as u32]
        };
        let ([left, right], [top, bottom]) = (range(0, least_x, most_x), range(1, least_y, most_y));
        (left < right && top < bottom).then(|| PictureFace {
            origin,
            others,
            depth: Vec3::new(a.depth, b.depth, c.depth),
            inverse_w: Vec3::new(a.inverse_w, b.inverse_w, c.inverse_w),
            corners: [first, second, third],
            pixels: [left, top, right, bottom],
            clipped: WHOLE_TRIANGLE,
        })
    }

    /// Color and normal of a surface.
    pub(super) fn point_at(&self, surface: &FaceSurface<'_>, place: &SurfacePlace) -> ShadedPoint {
        let normal = unit_or_zero(surface.normals * (place.weights / place.inverse_w()));
        ShadedPoint {
            color: self.color_at(surface, place),
            normal: self.shading.in_model(normal),
        }
    }

    /// Color before light falls on it, and normal.
    pub(super) fn base_at(&self, surface: &FaceSurface<'_>, place: &SurfacePlace) -> ShadedPoint {
        let normal = unit_or_zero(surface.normals * (place.weights / place.inverse_w()));
        ShadedPoint {
            color: match self.shading.is_tinted() {
                true => TRIANGLE_TINT,
                false => surface.color_at(place.weights),
            },
            normal: self.shading.in_model(normal),
        }
    }

    /// Color of a surface.
    #[inline]
    fn color_at(&self, surface: &FaceSurface<'_>, place: &SurfacePlace) -> Vec3 {
        if self.shading.has_headlight() {
            return self.shade(surface, place.pixel, place.weights);
        }
        let inverse_w = place.inverse_w();
        let weights = place.weights / inverse_w;
        self.shading.of_triangle(&TrianglePoint {
            normal: unit_or_zero(surface.normals * weights),
            color: surface.color_at(place.weights),
            pixel: place.pixel,
            depth: place.depth,
            inverse_w,
        })
    }

    /// What the headlight makes of a surface at a pixel, where corners have weights in proportion to these.
    #[inline]
    fn shade(&self, surface: &FaceSurface<'_>, [x, y]: [u32; 2], placed: Vec3) -> Vec3 {
        let weights = placed / (placed.x + placed.y + placed.z);
        let normal = surface.normals * weights;
        let to_light = match self.is_parallel {
            true => Vec3::Z,
            false => {
                let at = (Vec2::new(x as f32, y as f32) + 0.5) * self.ray_scale + self.ray_offset;
                -at.extend(-1.0)
            }
        };
        let squared = normal.length_squared();
        let lambert = if squared > 0.0 {
            let facing = normal.dot(to_light) / (squared * to_light.length_squared()).sqrt();
            match self.is_two_sided {
                true => facing.abs(),
                false => facing.max(0.0),
            }
        } else {
            1.0
        };
        let albedo = match self.has_colors {
            true => self.albedo * surface.color_at(placed),
            false => self.albedo,
        };
        albedo * lambert.min(1.0)
    }
}

#[cfg(test)]
mod tests;
