//! Pictures of a cut by error, on the processor: slow, exact, and without a renderer around it. Tests and measurements use it.
//!
//! One sample in the center of each pixel; the nearest distance wins. A patch is its footprint on the picture, widened by the
//! pixels that its thickness can be seen beside it ([`crate::pack::polygons`]). What lies in the widened margin is pushed back
//! by the thickness and its distance from the footprint, so that a neighbor's own area wins.

use super::cut::PatchCut;
use super::packed;
use super::record::NodePatch;
use super::record::NodePatches;
use crate::abi::OrientedPolygon;
use crate::cut::{StripRun, strip_centers};
use crate::image::{Image, unorm8};
use crate::math::camera::{HeadlightSource, View};
use crate::math::octahedral;
use crate::pack::ALBEDO;
use crate::pack::polygons::ScreenPolygon;
use crate::tree::Model;
use glam::{DVec2, DVec3, Vec2, Vec3};

/// How pictures look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchStyle {
    /// Red, green and blue where nothing is, 1 is white.
    pub background: [f32; 3],
    /// Use the colors of vertices.
    pub use_colors: bool,
    /// Side of squares, pixels.
    pub square_px: f32,
    /// Multiplies the pixels by which a patch is widened: 1, or less to see what that is for.
    pub margin: f64,
}

impl Default for PatchStyle {
    fn default() -> Self {
        Self {
            background: [1.0; 3],
            use_colors: true,
            square_px: 1.0,
            margin: 1.0,
        }
    }
}

/// Pictures and how many samples were written or lost to something nearer.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PatchPicture {
    /// The picture, with depth and with the values that its bytes are rounded from.
    pub image: Image,
    /// Samples of patches and tiny polygons.
    pub polygon_samples: u64,
    /// Samples of squares.
    pub square_samples: u64,
    /// Samples of triangles.
    pub triangle_samples: u64,
}

impl NodePatch {
    /// [`OrientedPolygon::color_slopes`] of the color.
    fn color_slopes(&self) -> [[i8; 4]; 2] {
        let largest = (self.color_gradient.iter())
            .map(|slope| slope.abs().max_element())
            .fold(0.0, f32::max);
        let exponent = packed::exponent_of(largest);
        self.color_gradient.map(|slope| {
            let [r, g, b] = slope
                .to_array()
                .map(|value| packed::bits_7(value, exponent));
            [r, g, b, exponent]
        })
    }

    /// The record as a polygon to draw. Its color is that of the middle; the shading normal is a unit vector times sigma there.
    pub fn polygon(&self) -> OrientedPolygon {
        let (corners, count) = self.corners();
        let mut padded = [corners[count - 1].to_array(); OrientedPolygon::MOST_CORNERS];
        for (to, from) in padded.iter_mut().zip(&corners[..count]) {
            *to = from.to_array();
        }
        let m = self.mean_normal;
        let byte = |value: f32| unorm8(f64::from(value));
        let scale = self.sigma / m.length().max(f32::MIN_POSITIVE);
        OrientedPolygon {
            center: self.origin,
            // All of the rectangle, and a little for rounding: nothing is cut off, and how far it reaches is known.
            round_radius: self.half_extents.length() * 1.0001,
            normal: self.normal,
            thickness: self.thickness,
            axis: self.axis,
            corner_count: count as u32,
            corners: padded,
            shading_normal: (self.axis * m.x + self.second_axis() * m.y + self.normal * m.z)
                * scale,
            color: [
                byte(self.color.x),
                byte(self.color.y),
                byte(self.color.z),
                255,
            ],
            shape_operator: self.shape.map(|s| s * scale),
            // The cut left out what faces away.
            spread: 1.0,
            color_slopes: self.color_slopes(),
        }
    }
}

/// Draws a cut. `patches` are those of the model.
pub fn draw(
    model: &Model,
    patches: &NodePatches,
    cut: &PatchCut,
    view: &View,
    style: &PatchStyle,
) -> PatchPicture {
    let mut canvas = PatchCanvas::new(view, style);
    for &id in cut.patches.iter().chain(&cut.tiny) {
        if let Some(patch) = patches.records.get(id as usize) {
            canvas.patch(patch);
        }
    }
    let tree = &model.tree;
    for &id in &cut.rest.nodes {
        canvas.node(model, id, tree.nodes[id as usize].center);
    }
    for &StripRun { node, count, seen } in &cut.rest.strips {
        for (index, center) in strip_centers(&tree.nodes[node as usize], count).enumerate() {
            if seen >> index & 1 != 0 {
                canvas.node(model, node, center);
            }
        }
    }
    for &leaf in &cut.rest.leaves {
        canvas.leaf(model, leaf);
    }
    for &leaf in &cut.rest.triangles {
        canvas.triangle(model, leaf);
    }
    canvas.finish()
}

/// Draws every triangle that is not seen from behind on a closed surface: the exact picture.
pub fn draw_triangles(model: &Model, view: &View, style: &PatchStyle) -> PatchPicture {
    let mut canvas = PatchCanvas::new(view, style);
    for leaf in 0..model.triangles.len() as u32 {
        canvas.triangle(model, leaf);
    }
    canvas.finish()
}

/// A picture in the making.
struct PatchCanvas<'a> {
    view: &'a View,
    style: &'a PatchStyle,
    depth: Vec<f32>,
    values: Vec<[f32; 4]>,
    picture: PatchPicture,
}

/// A sample's surface.
struct SurfaceSample {
    position: Vec3,
    /// Unit, or zero: lit as if it faced the light.
    normal: Vec3,
    sigma: f32,
    color: Vec3,
}

impl<'a> PatchCanvas<'a> {
    fn new(view: &'a View, style: &'a PatchStyle) -> Self {
        let pixels = view.width as usize * view.height as usize;
        let [r, g, b] = style.background;
        Self {
            view,
            style,
            depth: vec![f32::INFINITY; pixels],
            values: vec![[r, g, b, 0.0]; pixels],
            picture: PatchPicture::default(),
        }
    }

    fn finish(self) -> PatchPicture {
        let bytes = |value: &[f32; 4]| value.map(|v| unorm8(f64::from(v)));
        PatchPicture {
            image: Image {
                width: self.view.width,
                height: self.view.height,
                color: self.values.iter().map(bytes).collect(),
                depth: self.depth,
                normal: Vec::new(),
                values: self.values,
            },
            ..self.picture
        }
    }

    /// Tells whether a distance wins a pixel, and if so its index.
    fn wins(&mut self, [x, y]: [u32; 2], distance: f32) -> Option<usize> {
        let index = y as usize * self.view.width as usize + x as usize;
        let is_seen = distance >= self.view.near && distance <= self.view.far;
        (is_seen && distance < self.depth[index]).then(|| {
            self.depth[index] = distance;
            index
        })
    }

    fn shade(&mut self, index: usize, sample: &SurfaceSample) {
        let view = self.view;
        let to_light = match view.light {
            HeadlightSource::Point if view.is_perspective => {
                (view.eye - sample.position).normalize_or(view.backward)
            }
            _ => view.backward,
        };
        let facing = if sample.normal == Vec3::ZERO {
            1.0
        } else {
            sample.sigma * sample.normal.dot(to_light).abs()
        };
        let color = if self.style.use_colors {
            sample.color
        } else {
            Vec3::ONE
        };
        let [r, g, b] = (color * (ALBEDO * facing)).to_array();
        self.values[index] = [r, g, b, 1.0];
    }

    /// Pixels whose centers lie between two window positions.
    fn pixels(&self, low: DVec2, high: DVec2) -> [std::ops::Range<u32>; 2] {
        // The casts saturate, and take what is no number to 0.
        let range = |low: f64, high: f64, side: u32| {
            let first = (low - 0.5).ceil().max(0.0) as u32;
            first.min(side)..((high - 0.5).floor() + 1.0).clamp(0.0, f64::from(side)) as u32
        };
        [
            range(low.x, high.x, self.view.width),
            range(low.y, high.y, self.view.height),
        ]
    }

    fn patch(&mut self, patch: &NodePatch) {
        let mut polygon = patch.polygon();
        polygon.thickness *= self.style.margin as f32;
        let Some(seen) = ScreenPolygon::of(&polygon, self.view) else {
            return;
        };
        let [low, high] = seen.bounds();
        let [columns, rows] = self.pixels(low, high);
        for y in rows {
            for x in columns.clone() {
                let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let Some(sample) = seen.sample(at) else {
                    continue;
                };
                self.picture.polygon_samples += 1;
                let Some(index) = self.wins([x, y], sample.distance as f32) else {
                    continue;
                };
                let foot = Vec2::from_array(sample.uv);
                self.shade(
                    index,
                    &SurfaceSample {
                        position: patch.point(foot),
                        normal: patch.shading_normal(foot),
                        sigma: patch.sigma,
                        color: patch.color_at(foot),
                    },
                );
            }
        }
    }

    fn square(&mut self, sample: &SurfaceSample) {
        let (x, y, distance) = self.view.project(sample.position);
        if distance <= 0.0 && self.view.is_perspective {
            return;
        }
        let half = 0.5 * self.style.square_px;
        // Half-open: a square of a pixel covers one center.
        let range = |at: f32, side: u32| {
            let [first, end] =
                [at - half, at + half].map(|edge| (edge - 0.5).ceil().max(0.0) as u32);
            first.min(side)..end.min(side)
        };
        for row in range(y, self.view.height) {
            for column in range(x, self.view.width) {
                self.picture.square_samples += 1;
                if let Some(index) = self.wins([column, row], distance) {
                    self.shade(index, sample);
                }
            }
        }
    }

    fn node(&mut self, model: &Model, id: u32, position: Vec3) {
        let attributes = &model.tree.attributes[id as usize];
        let normal = if attributes.has_normal() {
            attributes.normal()
        } else {
            Vec3::ZERO
        };
        self.square(&SurfaceSample {
            position,
            normal,
            sigma: 1.0,
            color: color_of(attributes.color),
        });
    }

    fn leaf(&mut self, model: &Model, leaf: u32) {
        let position = model.tree.leaves[leaf as usize].center;
        let (mut normal, mut color) = (Vec3::ZERO, Vec3::ZERO);
        let corners = match model.triangles.get(leaf as usize) {
            Some(&corners) => corners,
            None => [leaf; 3],
        };
        for corner in corners {
            let vertex = &model.vertices[corner as usize];
            if vertex.color[3] != 0 {
                normal += octahedral::decode(vertex.normal);
            }
            color += color_of(vertex.color) / 3.0;
        }
        self.square(&SurfaceSample {
            position,
            normal: normal.normalize_or_zero(),
            sigma: 1.0,
            color,
        });
    }

    /// A triangle, by edge functions in homogeneous coordinates (Olano and Greer, *Triangle Scan Conversion using 2D
    /// Homogeneous Coordinates*, 1997), so that it may reach behind the eye.
    fn triangle(&mut self, model: &Model, leaf: u32) {
        let vertices =
            model.triangles[leaf as usize].map(|corner| &model.vertices[corner as usize]);
        let placed = vertices.map(|vertex| self.homogeneous(vertex.position));
        let [a, b, c] = placed.map(|(corner, _)| corner);
        let edges = [b.cross(c), c.cross(a), a.cross(b)];
        let determinant = a.dot(edges[0]);
        if determinant == 0.0 || !determinant.is_finite() {
            return;
        }
        let is_front = |corner: &DVec3| corner.z > 0.0;
        let (low, high) = if [a, b, c].iter().all(is_front) {
            let [a, b, c] = [a, b, c].map(|corner| corner.truncate() / corner.z);
            (a.min(b).min(c), a.max(b).max(c))
        } else {
            (
                DVec2::ZERO,
                DVec2::new(self.view.width.into(), self.view.height.into()),
            )
        };
        let [columns, rows] = self.pixels(low, high);
        for y in rows {
            for x in columns.clone() {
                let at = DVec3::new(f64::from(x) + 0.5, f64::from(y) + 0.5, 1.0);
                let weights = edges.map(|edge| edge.dot(at) * determinant.signum());
                let sum: f64 = weights.iter().sum();
                if weights.iter().any(|&weight| weight < 0.0) || sum <= 0.0 {
                    continue;
                }
                self.picture.triangle_samples += 1;
                let weights = weights.map(|weight| weight / sum);
                let blend = |value: [Vec3; 3]| {
                    let [a, b, c] = [0, 1, 2].map(|i| value[i].as_dvec3() * weights[i]);
                    (a + b + c).as_vec3()
                };
                let distance: f64 = (0..3).map(|i| placed[i].1 * weights[i]).sum();
                if let Some(index) = self.wins([x, y], distance as f32) {
                    let normals = vertices.map(|vertex| match vertex.color[3] {
                        0 => Vec3::ZERO,
                        _ => octahedral::decode(vertex.normal),
                    });
                    let sample = SurfaceSample {
                        position: blend(vertices.map(|vertex| vertex.position)),
                        normal: blend(normals).normalize_or_zero(),
                        sigma: 1.0,
                        color: blend(vertices.map(|vertex| color_of(vertex.color))),
                    };
                    self.shade(index, &sample);
                }
            }
        }
    }

    /// Window position times w, with w, and the distance along the view direction.
    fn homogeneous(&self, position: Vec3) -> (DVec3, f64) {
        let view = self.view;
        let v = view
            .view_from_model
            .as_dmat4()
            .transform_point3(position.as_dvec3());
        let [sx, sy] = view.scale.map(f64::from);
        let [ox, oy] = view.offset.map(f64::from);
        let w = if view.is_perspective { -v.z } else { 1.0 };
        let (x, y) = if view.is_perspective {
            (sx * v.x + ox * v.z, sy * v.y + oy * v.z)
        } else {
            (sx * v.x + ox, sy * v.y + oy)
        };
        let half = 0.5 * DVec2::new(view.width.into(), view.height.into());
        (DVec3::new((x + w) * half.x, (w - y) * half.y, w), -v.z)
    }
}

/// Red, green and blue as value / 255.
fn color_of([r, g, b, _]: [u8; 4]) -> Vec3 {
    Vec3::new(f32::from(r), f32::from(g), f32::from(b)) / 255.0
}
