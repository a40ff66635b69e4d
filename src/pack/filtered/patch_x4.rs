//! Four patches in the four lanes of vectors: what of each is seen, how it is lit and how large it is drawn.
//!
//! The arithmetic of [`super`], some hundred operations a patch with nine roots and quotients; four at a time take little
//! longer than one.

use crate::abi::FilteredSplat;
use crate::abi::constants::{
    LEAST_EXTENT_PX, LEAST_FACING_OF_OWN, LEAST_FILTERED_FACING, LEAST_FRONT, LEAST_SPREAD,
    MOST_CHANGE, OFFSET_OF_BEND, OFFSET_OF_NEIGHBORS, OFFSET_OF_THICKNESS,
};
use crate::math::camera::HeadlightSource;
use crate::pack::filtered::MARGIN_PX;
use crate::pack::filtered::eye::FilteredEye;
use crate::pack::filtered::patch::SummedPatch;
use crate::pack::splats::pixels_of_unit;
use crate::pack::{ALBEDO, ColorBy, falsecolor};
use crate::tree::{Model, Node, SurfaceMoments};
use glam::{Mat4, Vec3, Vec4};

/// Four vectors of three dimensions.
pub(super) type Vectors = [Vec4; 3];

#[inline]
pub(super) fn splat(v: Vec3) -> Vectors {
    v.to_array().map(Vec4::splat)
}

/// Vectors in the four lanes.
#[inline]
pub(super) fn vectors(v: [Vec3; 4]) -> Vectors {
    let [x, y, z, _] = columns(v.map(|v| v.extend(0.0)));
    [x, y, z]
}

#[inline]
pub(super) fn dot([a, b, c]: &Vectors, [x, y, z]: &Vectors) -> Vec4 {
    *a * *x + *b * *y + *c * *z
}

#[inline]
pub(super) fn cross([a, b, c]: &Vectors, [x, y, z]: &Vectors) -> Vectors {
    [*b * *z - *c * *y, *c * *x - *a * *z, *a * *y - *b * *x]
}

#[inline]
pub(super) fn scaled(v: &Vectors, by: Vec4) -> Vectors {
    v.map(|v| v * by)
}

/// 1 / x; 0 where that is no number.
#[inline]
pub(super) fn inverse_or_zero(x: Vec4) -> Vec4 {
    Vec4::select(x.cmpgt(Vec4::ZERO), Vec4::ONE / x, Vec4::ZERO)
}

/// Four rows become four columns.
#[inline]
fn columns(rows: [Vec4; 4]) -> [Vec4; 4] {
    let lanes = Mat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
    [lanes.x_axis, lanes.y_axis, lanes.z_axis, lanes.w_axis]
}

/// Which normals light it.
#[derive(Clone, Copy)]
pub(super) enum PatchNormals {
    /// Second moments, area included: xx, yy, zz, xy, xz, yz.
    Second([Vec4; 6]),
    /// A unit vector each.
    One(Vectors),
}

/// Four patches.
#[derive(Clone, Copy)]
pub(super) struct FourPatches {
    pub(super) center: Vectors,
    pub(super) area: Vec4,
    pub(super) vector_area: Vectors,
    pub(super) normals: PatchNormals,
    pub(super) half_thickness: Vec4,
    pub(super) bend: Vec4,
    /// Red, green and blue, 0..=1.
    pub(super) color: Vectors,
    /// 1 where nothing is known of the normals, else 0.
    pub(super) bare: Vec4,
    /// Radius of the ball around the center that the patch lies in, model units; infinite where that is not known.
    pub(super) reach: Vec4,
    /// Whether there are edges, and of triangles the ways from the first corner to the others, else zero (no `Option`: what
    /// is computed ahead of the branch would be of words that are no numbers, and slow).
    pub(super) has_edges: bool,
    pub(super) edges: [Vectors; 2],
}

/// Both halves of words as signed whole numbers.
#[inline]
fn halves(words: Vec4) -> [Vec4; 2] {
    let words = words.to_array().map(f32::to_bits);
    [
        Vec4::from_array(words.map(|w| ((w << 16) as i32 >> 16) as f32)),
        Vec4::from_array(words.map(|w| (w as i32 >> 16) as f32)),
    ]
}

impl FourPatches {
    /// Nodes; see [`SummedPatch::of_node`].
    #[inline]
    pub(super) fn of_nodes(model: &Model, ids: [u32; 4]) -> Self {
        let tree = &model.tree;
        let [x, y, z, radius] = columns(ids.map(|id| {
            let node = &tree.nodes[id as usize];
            node.center.extend(node.radius)
        }));
        // The words travel as floats, whose bits nothing changes on the way.
        let words =
            ids.map(|id| bytemuck::cast::<SurfaceMoments, [f32; 6]>(tree.moments[id as usize]));
        let [m0, m1, m2, m3] = columns(words.map(|w| Vec4::new(w[0], w[1], w[2], w[3])));
        let [m4, m5, ..] = columns(words.map(|w| Vec4::new(w[4], w[5], 0.0, 0.0)));
        let unit = Vec4::splat(1.0 / SurfaceMoments::UNIT);
        let [[cx, cy], [cz, vx], [vy, vz], [xx, yy], [zz, xy], [xz, yz]] =
            [m0, m1, m2, m3, m4, m5].map(halves);
        let [_, colors, splat_radius, area] = columns(ids.map(|id| {
            let [normal, color, radius, area] =
                bytemuck::cast::<_, [f32; 4]>(tree.attributes[id as usize]);
            Vec4::new(normal, color, radius, area)
        }));
        let colors = colors.to_array().map(f32::to_bits);
        let byte = |at: u32| Vec4::from_array(colors.map(|c| (c >> (8 * at) & 0xff) as i32 as f32));
        let alpha = byte(3);
        // Normals all around have no mean, and the color is that of a ball in the light; the sums know better.
        let has_none = alpha.cmpeq(Vec4::ZERO);
        let moments = [xx, yy, zz, xy, xz, yz].map(Vec4::abs);
        let is_bare = has_none & (moments.into_iter().sum::<Vec4>()).cmpeq(Vec4::ZERO);
        let of_ball = Vec4::select(has_none & !is_bare, Vec4::splat(1.5), Vec4::ONE);
        let thickness = (Vec4::splat(255.0) - alpha) * (1.0 / 254.0);
        let (step, sums) = (radius * unit, area * unit);
        let off = [cx * step, cy * step, cz * step];
        Self {
            center: [x + off[0], y + off[1], z + off[2]],
            area,
            vector_area: [vx, vy, vz].map(|v| v * sums),
            normals: PatchNormals::Second([xx, yy, zz, xy, xz, yz].map(|v| v * sums)),
            half_thickness: splat_radius * Vec4::select(has_none, Vec4::ONE, thickness),
            bend: Vec4::ZERO,
            color: [0, 1, 2].map(|i| (byte(i) * (1.0 / 255.0) * of_ball).min(Vec4::ONE)),
            bare: Vec4::select(is_bare, Vec4::ONE, Vec4::ZERO),
            reach: radius + dot(&off, &off).sqrt(),
            has_edges: false,
            edges: [[Vec4::ZERO; 3]; 2],
        }
    }

    /// Tells whether any of them has no area.
    pub(super) fn has_nothing(&self) -> bool {
        self.area.cmpeq(Vec4::ZERO).any()
    }

    /// Points.
    #[inline]
    pub(super) fn of_points(patches: [&SummedPatch; 4]) -> Self {
        let lanes = |of: fn(&SummedPatch) -> f32| Vec4::from_array(patches.map(of));
        let vectors = |of: fn(&SummedPatch) -> Vec3| vectors(patches.map(of));
        let area = lanes(|p| p.area);
        let color = |i: usize| Vec4::from_array(patches.map(|p| f32::from(p.color[i]))) / 255.0;
        Self {
            center: vectors(|p| p.center),
            area,
            vector_area: vectors(|p| p.vector_area),
            normals: PatchNormals::One(scaled(&vectors(|p| p.normals), inverse_or_zero(area))),
            half_thickness: lanes(|p| p.half_thickness),
            bend: lanes(|p| p.bend),
            color: [color(0), color(1), color(2)],
            bare: lanes(|p| f32::from(u8::from(p.is_bare))),
            reach: Vec4::INFINITY,
            has_edges: false,
            edges: [[Vec4::ZERO; 3]; 2],
        }
    }

    /// Pieces of the same patches in other places.
    #[inline]
    pub(super) fn at(self, centers: [Vec3; 4]) -> Self {
        Self {
            center: vectors(centers),
            reach: Vec4::INFINITY,
            ..self
        }
    }
}

/// How a color changes along a line.
pub(super) struct ColorSlope {
    direction: Vectors,
    per_unit: [f32; 3],
    /// How much it may differ from the mean.
    most: [f32; 3],
}

impl ColorSlope {
    /// Slope of the line through the colors of the `lanes` of four parts of a node that has the least squares, each counting
    /// as much as is seen of it (`weight`). None where they are not spread along the node's strip.
    pub(super) fn new(
        (four, lanes): (&FourPatches, u32),
        weight: Vec4,
        colors: &Vectors,
        node: &Node,
    ) -> Option<Self> {
        let is_in = [0, 1, 2, 3].map(|i| f32::from((lanes >> i & 1) as u8));
        let is_in = Vec4::from_array(is_in).cmpgt(Vec4::ZERO);
        let weight = Vec4::select(is_in, weight, Vec4::ZERO);
        let sum = weight.element_sum();
        let direction = splat(node.strip.direction());
        let along = dot(&direction, &four.center);
        let off = along - weight.dot(along) / sum;
        let spread = weight.dot(off * off);
        // Also where nothing is seen and the quotient is no number.
        let least = LEAST_SPREAD * node.radius;
        let is_spread = spread > sum * least * least;
        if !is_spread {
            return None;
        }
        let range = |c: Vec4| {
            let least = Vec4::select(is_in, c, Vec4::splat(f32::INFINITY));
            let most = Vec4::select(is_in, c, Vec4::splat(f32::NEG_INFINITY));
            most.max_element() - least.min_element()
        };
        Some(Self {
            direction,
            per_unit: colors.map(|c| weight.dot(off * c) / spread),
            // A row reaches beyond the middles of its parts, but what they differ by is not all slope.
            most: colors.map(|c| MOST_CHANGE * range(c)),
        })
    }

    /// The colors at the centers of `four`, where they are `mean` at `middle`.
    #[inline]
    pub(super) fn from(&self, mean: &Vectors, middle: Vectors, four: &FourPatches) -> Vectors {
        let from = [0, 1, 2].map(|i| four.center[i] - middle[i]);
        let along = dot(&self.direction, &from);
        [0, 1, 2].map(|i| {
            let most = Vec4::splat(self.most[i]);
            let change = (along * self.per_unit[i]).min(most).max(-most);
            (mean[i] + change).max(Vec4::ZERO).min(Vec4::ONE)
        })
    }
}

/// What is seen of four patches.
pub(super) struct SeenPatches {
    /// Toward the eye, unit vectors.
    v: Vectors,
    /// To the eye, and along the view direction, model units (1 in an orthographic view).
    distance: Vec4,
    z: Vec4,
    /// Projected area of the fronts, model units squared.
    pub(super) front: Vec4,
    /// Projected area of fronts and backs.
    both: Vec4,
    /// Cosine of the mean normal, [`LEAST_FILTERED_FACING`] to 1.
    facing: Vec4,
    /// Share of the albedo that the headlight makes of them.
    lambert: Vec4,
    /// Length of the vector area.
    length: Vec4,
    /// Which lanes cover anything.
    pub(super) lanes: u32,
}

/// How large four splats are drawn.
#[derive(Clone, Copy)]
pub(super) struct SplatSizes {
    /// Share of their patches.
    pub(super) share: Vec4,
    /// Splats that belong to rows: the way from one to the next, model space.
    pub(super) is_row: bool,
    pub(super) step: Vectors,
    /// Diameter in pixels; the rectangle is not larger.
    pub(super) diameter_px: Vec4,
    /// The rectangle is as large as the diameter, tilted: for patches that are not dense.
    pub(super) is_own: bool,
}

impl FilteredEye<'_> {
    pub(super) fn seen(&self, four: &FourPatches) -> SeenPatches {
        let view = self.view;
        let (w, z) = if view.is_perspective {
            // Both in model units: the scale of the view cancels in the projected area.
            let eye = splat(view.eye);
            let w = [0, 1, 2].map(|i| eye[i] - four.center[i]);
            let z = dot(&splat(self.forward.truncate()), &four.center) + self.forward.w;
            (w, z)
        } else {
            (splat(view.backward), Vec4::ONE)
        };
        let distance = dot(&w, &w).sqrt();
        let v = scaled(&w, Vec4::ONE / distance);
        let light = match view.light {
            HeadlightSource::Point if view.is_perspective => v,
            _ => splat(view.backward),
        };
        let is_bare = four.bare.cmpgt(Vec4::ZERO);
        let mut toward = dot(&four.vector_area, &v);
        if !self.shade.cull_back {
            toward = toward.abs();
        }
        let (lit, projection) = match &four.normals {
            PatchNormals::Second([xx, yy, zz, xy, xz, yz]) => {
                let times = |[x, y, z]: &Vectors| {
                    [
                        *xx * *x + *xy * *y + *xz * *z,
                        *xy * *x + *yy * *y + *yz * *z,
                        *xz * *x + *yz * *y + *zz * *z,
                    ]
                };
                let least = dot(&v, &times(&v)).max(Vec4::ZERO);
                (
                    dot(&v, &times(&light)).abs(),
                    (least + (least * four.area).sqrt()) * 0.5,
                )
            }
            PatchNormals::One(s) => ((toward * dot(s, &light)).abs(), Vec4::ZERO),
        };
        let both = projection.max(toward.abs());
        let front = Vec4::select(is_bare, four.area, (both + toward) * 0.5);
        let length = dot(&four.vector_area, &four.vector_area).sqrt();
        let cosine = toward * inverse_or_zero(length);
        // Seen edge-on or from behind it covers nothing.
        let seen = front.cmpgt(four.area * LEAST_FRONT)
            & four.area.cmpgt(Vec4::ZERO)
            & z.cmpgt(Vec4::ZERO)
            & distance.cmpgt(Vec4::ZERO);
        SeenPatches {
            v,
            distance,
            z,
            front,
            both,
            facing: Vec4::select(
                is_bare,
                Vec4::ONE,
                cosine
                    .max(Vec4::splat(LEAST_FILTERED_FACING))
                    .min(Vec4::ONE),
            ),
            lambert: Vec4::select(is_bare, Vec4::ONE, (lit / both).min(Vec4::ONE)),
            length,
            lanes: seen.bitmask(),
        }
    }

    /// Tells whether [`lit`](Self::lit) knows the color.
    pub(super) fn is_plain(&self) -> bool {
        self.lamp.is_none() && self.sphere.is_none() && !self.shade.color_by.is_data()
    }

    /// Colors in the headlight.
    #[inline]
    pub(super) fn lit(&self, four: &FourPatches, seen: &SeenPatches) -> Vectors {
        let value = seen.lambert * ALBEDO;
        match self.shade.color_by {
            ColorBy::Primitive => [1.0, 0.2, 0.2].map(|c| (value * c).min(Vec4::ONE)),
            _ if self.shade.use_colors => four.color.map(|c| (value * c).min(Vec4::ONE)),
            _ => [value.min(Vec4::ONE); 3],
        }
    }

    /// The color of one patch by a lamp, or as data.
    fn color(&self, patch: &SummedPatch, center: Vec3, v: Vec3, both: f32) -> [f32; 3] {
        let own = || [0, 1, 2].map(|i| f32::from(patch.color[i]) / 255.0);
        let lit = |base: [f32; 3]| {
            if let Some(sphere) = &self.sphere {
                return self.on_sphere(sphere, patch, v, base);
            }
            let (lambert, highlight) = match &self.lamp {
                Some((phong, source)) if !patch.is_bare => {
                    self.in_lamp(phong, *source, patch, center, v, both)
                }
                _ => (1.0, 0.0),
            };
            base.map(|c| (c * ALBEDO * lambert + highlight).min(1.0))
        };
        match self.shade.color_by {
            ColorBy::Primitive => lit([1.0, 0.2, 0.2]),
            ColorBy::Shading | ColorBy::Classification if self.shade.use_colors => lit(own()),
            ColorBy::Shading | ColorBy::Classification | ColorBy::Overdraw => lit([1.0; 3]),
            ColorBy::Level => falsecolor::of_item(self.tree, patch.node),
            ColorBy::Normal => falsecolor::of_normal(self.normal(patch)),
            ColorBy::Depth => {
                falsecolor::of_depth(self.view.distance(center), self.shade.depth_range)
            }
        }
    }

    /// Calls `write` with the splats of the first `count` lanes that cover anything. `colors` are those in the headlight;
    /// `patch` is asked for where that is not what decides.
    #[inline]
    pub(super) fn splats(
        &self,
        (four, seen, count): (&FourPatches, &SeenPatches, usize),
        size: &SplatSizes,
        colors: &Vectors,
        patch: impl Fn(usize) -> SummedPatch,
        mut write: impl FnMut(FilteredSplat),
    ) {
        let view = self.view;
        let (z, front) = (seen.z, seen.front);
        let focal = Vec4::splat(self.focal_px);
        let area_px = if view.is_perspective {
            focal * focal * front * seen.distance / (z * z * z)
        } else {
            focal * focal * front
        };
        let limit = (self.shade.max_size_px - MARGIN_PX).max(1.0);
        let node_px = match &self.shade.cut_view {
            Some(of_cut) => Vec4::from_array([0, 1, 2, 3].map(|lane| {
                let at = Vec3::from(four.center.map(|c| c[lane]));
                self.shade.side_px * (pixels_of_unit(view, at) / pixels_of_unit(of_cut, at))
            })),
            None => Vec4::ZERO,
        };
        let diameter = node_px.max(size.diameter_px).min(Vec4::splat(limit));
        // Area in the mean plane, and pixels of a model unit there.
        let area = seen.length.max(front) * size.share;
        let scale = focal / z;
        let is_bare = four.bare.cmpgt(Vec4::ZERO);
        let flat = (seen.length / four.area).min(Vec4::ONE);
        let unit = scaled(
            &four.vector_area,
            Vec4::select(is_bare, Vec4::ZERO, inverse_or_zero(seen.length)),
        );
        let largest = diameter.max(Vec4::ONE);
        let inverse_square = inverse_or_zero(dot(&size.step, &size.step));
        let extent = |axis: Vec3| {
            let axis = splat(axis);
            let across = dot(&unit, &axis);
            let wide = if size.is_own {
                let tilt = Vec4::ONE - across * across * flat;
                diameter * tilt.max(Vec4::ZERO).sqrt()
            } else if four.has_edges {
                let [b, c] = four.edges.each_ref().map(|edge| dot(edge, &axis));
                scale
                    * ((b * b + c * c - b * c) * (2.0 / 3.0))
                        .max(Vec4::ZERO)
                        .sqrt()
            } else if size.is_row {
                let beside = dot(&cross(&unit, &size.step), &axis).abs();
                let along = dot(&size.step, &axis).abs();
                let wide = scale * (along + area * beside * inverse_square);
                Vec4::select(is_bare, largest, wide)
            } else {
                let tilt = Vec4::ONE - across * across;
                let wide = scale * (area * tilt.max(Vec4::ZERO)).sqrt();
                Vec4::select(is_bare, largest, wide)
            };
            wide.max(Vec4::splat(LEAST_EXTENT_PX)).min(largest)
        };
        let (wide, high) = (extent(self.right), extent(self.up));
        let side = diameter.max(Vec4::splat(self.shade.side_px));
        // What is smaller than the threshold needs no square of its size. Beside the axis a ball is seen larger.
        let side = if size.is_own {
            side
        } else {
            let aside = if view.is_perspective {
                seen.distance / (z * z)
            } else {
                Vec4::ONE
            };
            side.min((four.reach * aside * focal * 2.0).max(Vec4::ONE))
        };
        // Its neighbors may be as large as the threshold.
        let largest = diameter.max(Vec4::splat(self.shade.side_px)) * z / (focal * 2.0);
        let reach = depth_reach(four, largest, seen.facing, size.is_own);
        let places = self.projection.places(&four.center, reach * self.offset_px);
        let lanes = seen.lanes & places.lanes;
        let [x, y] = places.window_px;
        let hidden = columns([x, y, places.pushed_depth, side]);
        let sizes = columns([places.depth, area_px * size.share, wide, high]);
        let shades = columns([colors[0], colors[1], colors[2], Vec4::ZERO]);
        let is_plain = self.is_plain();
        for lane in 0..count {
            if lanes >> lane & 1 == 0 {
                continue;
            }
            // A record is three vectors: what hides, what is spread, color.
            let mut record: FilteredSplat =
                bytemuck::cast([hidden[lane], sizes[lane], shades[lane]]);
            if !is_plain {
                let v = Vec3::from(seen.v.map(|v| v[lane]));
                let center = Vec3::from(four.center.map(|c| c[lane]));
                record.color = self.color(&patch(lane), center, v, seen.both[lane]);
            }
            write(record);
        }
    }
}

/// How far behind one another the middles of neighboring patches lie whose squares are `half` to either side, in the
/// world: as far as the plane falls off over that length, a little for what is next to a patch and not parallel to
/// it, and their thickness along the ray; at most what a sphere of that radius takes, which a triangle has that is
/// drawn as one large splat.
#[inline]
fn depth_reach(four: &FourPatches, half: Vec4, facing: Vec4, is_own: bool) -> Vec4 {
    if is_own {
        return half / facing.max(Vec4::splat(LEAST_FACING_OF_OWN));
    }
    let most = half / facing;
    let tangent = (Vec4::ONE - facing * facing).max(Vec4::ZERO).sqrt() / facing;
    let neighbors = four.bend * OFFSET_OF_BEND + OFFSET_OF_NEIGHBORS;
    let range = half * (tangent + neighbors) + four.half_thickness * OFFSET_OF_THICKNESS / facing;
    range.min(most)
}
