//! From a cut to splats, written straight into the caller's memory (the mapped buffer of a frame): first those that the
//! device can draw as points, at the end those that are too large and become quads.

use crate::abi::{Splat, SplatId, SplatRadius, Vertex, WeightedSplat};
use crate::cut::{Cut, SizeMetric, StripRun, strip_ball_radius, strip_center_of};
use crate::math::camera::View;
use crate::math::octahedral;
use crate::pack::parallel;
use crate::pack::parallel::RecordSink;
use crate::pack::{Footprint, falsecolor};
use crate::tree::{Leaf, Model, ModelKind, Node, NodeAttributes};
use glam::Vec3;
use prefetch_index::prefetch_index;

/// What the packing depends on besides model, cut and view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplatPlan {
    /// What splats look like.
    pub footprint: Footprint,
    /// Size of splats without a radius of their own, pixels; at least 1.
    pub threshold_px: f32,
    /// The metric of the cut.
    pub size: SizeMetric,
    /// Draw leaves that are larger than the threshold as splats too, not as triangles.
    pub draws_large_leaves: bool,
    /// Standard deviation of the Gaussian that footprints are widened by, pixels.
    pub low_pass_px: f32,
    /// Color by level of the tree.
    pub by_level: bool,
    /// The view of the cut, where it is not the one that is drawn: splats without a size of their own have that of there.
    pub cut_view: Option<View>,
    /// Largest point that the device draws, pixels.
    pub max_point_px: f32,
}

/// What was written: points from the start of the list, quads up to its end.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PackedSplats {
    /// Number of records to draw as points.
    pub points: usize,
    /// Number of records that may be too large for points.
    pub quads: usize,
}

/// A splat of a cut, with its number.
#[derive(Debug, Clone, Copy)]
pub struct NumberedSplat {
    /// What of the model it is.
    pub id: SplatId,
    /// What it looks like.
    pub splat: Splat,
    /// The area of surface that it stands for (model units squared; negative where it is unknown).
    pub area: f32,
}

/// A record of a draw list of splats.
pub trait SplatRecord {
    /// Record of a splat.
    fn of(named: &NumberedSplat) -> Self;
}

impl SplatRecord for Splat {
    fn of(named: &NumberedSplat) -> Self {
        named.splat
    }
}

impl SplatRecord for WeightedSplat {
    fn of(named: &NumberedSplat) -> Self {
        Self {
            splat: named.splat,
            area: named.area,
        }
    }
}

impl SplatRecord for SplatId {
    fn of(named: &NumberedSplat) -> Self {
        named.id
    }
}

/// What a footprint may be larger by than the disc in the plane: snapping, and one pixel for the low pass and rounding.
pub(crate) const SLACK_PX: f32 = 1.0;

impl SplatPlan {
    /// The color of a splat of a node (none: of a leaf) whose own color is `color`.
    fn color_of(&self, model: &Model, node: Option<u32>, color: [u8; 4]) -> [u8; 4] {
        if self.by_level {
            falsecolor::of_record(&model.tree, node, color)
        } else {
            color
        }
    }

    /// Tells whether every splat of a cut of this plan is smaller than the largest point, so that none is looked at.
    ///
    /// A node is a splat when the ellipse of its ball has a major axis of at most the threshold t. Its disc lies in
    /// that ball, and the ellipse contains the projected center: the footprint reaches at most t from there.
    pub(crate) fn fits_always(&self, kind: ModelKind) -> bool {
        self.fits_within_threshold() && !self.draws_large_leaves && kind.is_surface()
    }

    /// Tells whether no splat has a radius of its own. Of a leaf that is small by [`SizeMetric::Exact`] the size at its center
    /// is at most the threshold too.
    pub(crate) fn has_one_size(&self, kind: ModelKind) -> bool {
        self.footprint != Footprint::Oriented
            && self.size == SizeMetric::Exact
            && !self.draws_large_leaves
            && self.cut_view.is_none()
            && kind.is_surface()
    }

    /// Largest footprint of what is at most the threshold wide, pixels.
    pub(crate) fn within_threshold_px(&self) -> f32 {
        match self.footprint {
            Footprint::Square => self.threshold_px,
            Footprint::Circle => self.threshold_px + SLACK_PX,
            Footprint::Oriented => 2.0 * self.threshold_px + self.widened_px(),
        }
    }

    /// Tells whether every node of a cut of this plan fits a point, and every leaf that is at most the threshold wide, see
    /// [`fits_always`](Self::fits_always).
    pub(crate) fn fits_within_threshold(&self) -> bool {
        self.within_threshold_px() <= self.max_point_px
            && self.cut_view.is_none()
            && (self.footprint != Footprint::Oriented || self.size == SizeMetric::Exact)
    }

    /// Largest side of a splat that is drawn as a point, pixels, without what it is widened by.
    pub(crate) fn largest_side_px(&self) -> f32 {
        self.max_point_px - self.widened_px()
    }

    fn widened_px(&self) -> f32 {
        4.0 * self.low_pass_px + SLACK_PX
    }

    /// Largest side of a point of this plan, pixels: half of it must fit between the picture and the border of the
    /// view volume, or centers beside the picture are lost.
    pub fn largest_point_px(&self, kind: ModelKind) -> f32 {
        if self.fits_always(kind) {
            self.within_threshold_px()
        } else {
            self.max_point_px
        }
    }

    /// Largest side of the footprint of a vertex that is drawn with the threshold's size, pixels: a disc of radius
    /// r = t z / 2 f anywhere in the picture. With slope s = |xy| / z of the center it reaches at most
    /// f r (1 + s) / (z - r) from there.
    pub fn vertex_px(&self, view: &View) -> f32 {
        let side = self.threshold_px;
        if self.footprint == Footprint::Square {
            return side;
        }
        if self.footprint == Footprint::Circle || !view.is_perspective {
            return side + self.widened_px();
        }
        let ratio = side / (2.0 * view.focal_px());
        // Centers up to one picture beside it.
        let slope = |i: usize| 3.0 * (1.0 + view.offset[i].abs()) / view.scale[i].abs();
        let slope = slope(0).hypot(slope(1));
        if ratio < 1.0 {
            side * (1.0 + slope) / (1.0 - ratio) + self.widened_px()
        } else {
            f32::INFINITY
        }
    }
}

/// Where splats go.
pub(crate) trait SplatOutput {
    /// Whether it is asked how thick patches are; else their alpha says no more than whether they have a normal.
    const HAS_THICKNESS: bool = true;

    /// The next splat.
    fn point(&mut self, named: &NumberedSplat);
    /// The next of those that may be too large for a point.
    fn quad(&mut self, named: &NumberedSplat);
}

impl<R: SplatRecord> SplatOutput for RecordSink<'_, R> {
    #[inline]
    fn point(&mut self, named: &NumberedSplat) {
        RecordSink::point(self, R::of(named));
    }

    fn quad(&mut self, named: &NumberedSplat) {
        RecordSink::quad(self, R::of(named));
    }
}

/// Number of records that [`pack`] needs room for.
pub fn count(cut: &Cut, plan: &SplatPlan) -> usize {
    let strips = StripRun::splats_of(&cut.strips);
    let large = if plan.draws_large_leaves {
        cut.triangles.len()
    } else {
        0
    };
    cut.nodes.len() + strips + cut.leaves.len() + large
}

/// Writes the splats of a cut into the first [`count`] records of `out`.
///
/// Squares and circles have the frame's constant size (radius 0), but for leaves that are larger. Oriented discs have a
/// radius in which all of their patch lies: of a node the largest distance of a corner, of a row of splats that of its
/// balls, of a leaf that of its sphere. Patches of triangles without any area are left out: as triangles they would cover
/// nothing. Points stay, whatever their spacing.
///
/// # Panics
/// When `out` is shorter than [`count`].
pub fn pack<R: SplatRecord + Copy + Send>(
    model: &Model,
    cut: &Cut,
    view: &View,
    plan: &SplatPlan,
    out: &mut [R],
) -> PackedSplats {
    let writer = SplatWriter::new(model, view, plan);
    parallel::write(parts_of(cut, plan), out, |part, sink| {
        writer.part(part, sink);
    })
}

/// What is written at a time, each with the most records that it may have.
pub(crate) fn parts_of<'a>(cut: &'a Cut, plan: &SplatPlan) -> Vec<(PackedPart<'a>, usize)> {
    let large: &[u32] = if plan.draws_large_leaves {
        &cut.triangles
    } else {
        &[]
    };
    (cut.nodes
        .chunks(parallel::PART)
        .map(|p| (PackedPart::Nodes(p), p.len())))
    .chain(
        cut.strips
            .chunks(parallel::PART)
            .map(|p| (PackedPart::Rows(p), StripRun::splats_of(p))),
    )
    .chain(
        cut.leaves
            .chunks(parallel::PART)
            .map(|p| (PackedPart::Leaves(p), p.len())),
    )
    .chain(
        large
            .chunks(parallel::PART)
            .map(|p| (PackedPart::Large(p), p.len())),
    )
    .collect()
}

/// What one thread writes at a time.
#[derive(Clone, Copy)]
pub(crate) enum PackedPart<'a> {
    Nodes(&'a [u32]),
    Rows(&'a [StripRun]),
    Leaves(&'a [u32]),
    /// Leaves above the threshold.
    Large(&'a [u32]),
}

/// A triangle as a patch of surface: its mean color, and the mean normal of its corners with a thickness that reaches
/// all of it, or with `is_in_plane` its own normal.
fn of_triangle(corners: [Vertex; 3], center: Vec3, is_in_plane: bool) -> (Splat, f32) {
    let [a, b, c] = corners.map(|v| v.position);
    let cross = (b - a).cross(c - a);
    let plane = cross.normalize_or_zero();
    let sum: Vec3 = corners
        .iter()
        .filter(|v| v.color[3] != 0)
        .map(|v| octahedral::decode(v.normal))
        .sum();
    let mean = sum.normalize_or(plane);
    let (normal, thickness) = if is_in_plane && plane != Vec3::ZERO {
        (if mean.dot(plane) < 0.0 { -plane } else { plane }, 0.0)
    } else {
        // Around the mean normal the triangle is as thick as the sine of the angle between the two.
        (mean, mean.cross(plane).length().min(1.0))
    };
    let channel =
        |i: usize| ((corners.iter().map(|v| u32::from(v.color[i])).sum::<u32>() + 1) / 3) as u8;
    let alpha = if normal == Vec3::ZERO {
        0
    } else {
        alpha_of(thickness)
    };
    let splat = Splat {
        center,
        radius: SplatRadius::OF_FRAME,
        normal: octahedral::encode(normal),
        color: [channel(0), channel(1), channel(2), alpha],
    };
    (splat, 0.5 * cross.length())
}

/// Half the thickness of a patch over its radius, from the alpha of its color.
fn thickness_of(alpha: u8) -> f32 {
    f32::from(255 - alpha) / 254.0
}

/// The alpha of a thickness, rounded to thicker; NaN is as thick as can be.
fn alpha_of(thickness: f32) -> u8 {
    255 - (thickness.clamp(0.0, 1.0) * 254.0).ceil().min(254.0) as u8
}

/// Pixels of a unit of the model, parallel to the picture, at the depth of a point.
pub(crate) fn pixels_of_unit(view: &View, at: Vec3) -> f32 {
    let z = if view.is_perspective {
        view.distance(at).max(view.near)
    } else {
        1.0
    };
    view.focal_px() * view.model_scale / z
}

/// Makes splats of a cut.
pub(crate) struct SplatWriter<'a> {
    model: &'a Model,
    view: &'a View,
    plan: &'a SplatPlan,
    is_oriented: bool,
    /// Whether a splat may be too large for a point.
    is_checked: bool,
    /// Whether splats stand for triangles rather than points.
    has_triangles: bool,
}

impl<'a> SplatWriter<'a> {
    pub(crate) fn new(model: &'a Model, view: &'a View, plan: &'a SplatPlan) -> Self {
        Self {
            model,
            view,
            plan,
            is_oriented: plan.footprint == Footprint::Oriented,
            is_checked: !plan.fits_always(model.kind()),
            has_triangles: model.kind().is_surface(),
        }
    }

    /// Writes the splats of a part.
    pub(crate) fn part(&self, part: PackedPart<'_>, out: &mut impl SplatOutput) {
        match part {
            PackedPart::Nodes(ids) => self.nodes(ids, out),
            PackedPart::Rows(rows) => self.rows(rows, out),
            PackedPart::Leaves(ids) => self.leaves(ids, false, out),
            PackedPart::Large(ids) => self.leaves(ids, true, out),
        }
    }

    fn nodes(&self, ids: &[u32], out: &mut impl SplatOutput) {
        let tree = &self.model.tree;
        let (nodes, attributes): (&[Node], &[NodeAttributes]) = (&tree.nodes, &tree.attributes);
        for (index, &id) in ids.iter().enumerate() {
            if let Some(&next) = ids.get(index + parallel::AHEAD) {
                prefetch_index(nodes, next as usize);
                prefetch_index(attributes, next as usize);
            }
            let a = &attributes[id as usize];
            let splat = Splat {
                center: nodes[id as usize].center,
                radius: self.own(a.splat_radius),
                normal: a.normal,
                color: self.plan.color_of(self.model, Some(id), a.color),
            };
            self.write(SplatId::node(id), splat, a.area, out);
        }
    }

    fn rows<O: SplatOutput>(&self, rows: &[StripRun], out: &mut O) {
        let tree = &self.model.tree;
        let (nodes, attributes): (&[Node], &[NodeAttributes]) = (&tree.nodes, &tree.attributes);
        for (index, row) in rows.iter().enumerate() {
            let &StripRun {
                node: id, count, ..
            } = row;
            if let Some(next) = rows.get(index + parallel::AHEAD) {
                prefetch_index(nodes, next.node as usize);
                prefetch_index(attributes, next.node as usize);
            }
            let node = &nodes[id as usize];
            let a = &attributes[id as usize];
            let ball = strip_ball_radius(node, count);
            let center_of = strip_center_of(node, count);
            for i in (0..count).filter(|&i| row.is_seen(i)) {
                let center = center_of(i);
                let [r, g, b, alpha] = self.plan.color_of(self.model, Some(id), a.color);
                // The slab lies around the node's center, and its thickness counts in the radii of the ball.
                let thickness = || {
                    let normal = octahedral::decode(a.normal);
                    let own = thickness_of(alpha) * a.splat_radius;
                    (own + normal.dot(center - node.center).abs()) / ball
                };
                let alpha = match O::HAS_THICKNESS && alpha != 0 {
                    true => alpha_of(thickness()),
                    false => alpha,
                };
                let splat = Splat {
                    center,
                    radius: self.own(ball),
                    normal: a.normal,
                    color: [r, g, b, alpha],
                };
                let part = SplatId::of_row(id, count, i);
                self.write(part, splat, a.area / count as f32, out);
            }
        }
    }

    fn leaves(&self, ids: &[u32], is_large: bool, out: &mut impl SplatOutput) {
        let model = self.model;
        let leaves: &[Leaf] = &model.tree.leaves;
        let of_cut = self.plan.cut_view.as_ref().unwrap_or(self.view);
        for (index, &leaf) in ids.iter().enumerate() {
            if let Some(&next) = ids.get(index + parallel::AHEAD) {
                prefetch_index(leaves, next as usize);
                // Which corners it has was asked for when it was twice as far.
                for &corner in model.triangles.get(next as usize).into_iter().flatten() {
                    prefetch_index(&model.vertices, corner as usize);
                }
            }
            if let Some(&next) = ids.get(index + 2 * parallel::AHEAD) {
                prefetch_index(&model.triangles, next as usize);
            }
            let sphere = &leaves[leaf as usize];
            let mut part = SplatId::leaf(leaf);
            let (mut splat, area) = match model.triangles.get(leaf as usize) {
                Some(corners) => {
                    let corners = corners.map(|i| model.vertices[i as usize]);
                    // Its own normal is the plane of the disc; what faces the picture anyway is lit by the mean of its corners.
                    let is_in_plane = is_large && self.is_oriented;
                    if is_in_plane {
                        part.part |= SplatId::IN_PLANE;
                    }
                    let (mut splat, area) = of_triangle(corners, sphere.center, is_in_plane);
                    let textures = model.textures.as_deref();
                    if let Some([r, g, b]) = textures.and_then(|own| own.leaf_color(leaf as usize))
                    {
                        splat.color = [r, g, b, splat.color[3]];
                    }
                    (
                        Splat {
                            radius: self.own(sphere.radius),
                            ..splat
                        },
                        area,
                    )
                }
                None => {
                    let vertex = &model.vertices[leaf as usize];
                    let splat = Splat {
                        center: vertex.position,
                        radius: self.own(sphere.radius),
                        normal: vertex.normal,
                        color: vertex.color,
                    };
                    (splat, -1.0)
                }
            };
            splat.color = self.plan.color_of(model, None, splat.color);
            // A square or circle has the threshold's size unless its leaf is larger.
            if !self.is_oriented
                && sphere.radius > 0.0
                && 2.0 * sphere.radius * pixels_of_unit(of_cut, sphere.center)
                    > self.plan.threshold_px
            {
                splat.radius = SplatRadius::own(sphere.radius);
                part.part |= SplatId::OF_OWN_SIZE;
            }
            self.write(part, splat, area, out);
        }
    }

    /// A radius of 0 asks for the constant size: right for points in one place, and what has an area has a radius.
    fn own(&self, radius: f32) -> SplatRadius {
        match self.is_oriented {
            true => SplatRadius::own(radius),
            false => SplatRadius::OF_FRAME,
        }
    }

    #[inline]
    fn write(&self, id: SplatId, mut splat: Splat, area: f32, out: &mut impl SplatOutput) {
        if area == 0.0 && self.has_triangles {
            return;
        }
        if let Some(of_cut) = &self.plan.cut_view
            && splat.radius.model_units() <= 0.0
        {
            let radius = 0.5 * self.plan.threshold_px / pixels_of_unit(of_cut, splat.center);
            splat.radius = SplatRadius::own(radius);
        }
        let named = NumberedSplat { id, splat, area };
        if self.is_checked && !self.fits(&splat) {
            out.quad(&named);
        } else {
            out.point(&named);
        }
    }

    /// Diameter in pixels of a ball at the depth of its center.
    fn side_px(&self, center: Vec3, radius: f32) -> f32 {
        2.0 * radius * pixels_of_unit(self.view, center)
    }

    /// Tells whether the footprint is surely smaller than the largest point. A point q of the disc around c is at most r
    /// from it, so their projections differ by |q_xy - c_xy - (c_xy / c_z) (q_z - c_z)| / q_z <= r (1 + s) / (z - r).
    fn fits(&self, splat: &Splat) -> bool {
        let (view, plan) = (self.view, self.plan);
        let limit = plan.largest_side_px();
        let radius = splat.radius.model_units();
        if radius <= 0.0 {
            return match plan.footprint {
                Footprint::Oriented => plan.vertex_px(view) <= plan.max_point_px,
                _ => plan.within_threshold_px() <= plan.max_point_px,
            };
        }
        if plan.footprint != Footprint::Oriented || !view.is_perspective {
            return self.side_px(splat.center, radius) <= limit;
        }
        let center = view.view_from_model.transform_point3(splat.center);
        let (z, r) = (-center.z, radius * view.model_scale);
        if z - r <= view.near {
            return 2.0 * view.focal_px() * r <= limit * z.max(view.near);
        }
        let slope = center.truncate().length() / z;
        2.0 * view.focal_px() * r * (1.0 + slope) <= limit * (z - r)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::octahedral;

    fn corner(position: Vec3, normal: Vec3) -> Vertex {
        Vertex {
            position,
            normal: octahedral::encode(normal),
            color: [255; 4],
        }
    }

    #[test]
    fn a_triangle_is_as_thick_as_its_normals_are_off() {
        let at = [Vec3::ZERO, Vec3::X, Vec3::Y];
        for degrees in [0f32, 10.0, 45.0, 90.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let normal = Vec3::new(sin, 0.0, cos);
            let (splat, area) = of_triangle(at.map(|p| corner(p, normal)), Vec3::ZERO, false);
            let thickness = f32::from(255 - splat.color[3]) / 254.0;
            assert!(
                thickness >= sin - 2e-4 && thickness < sin + 5e-3,
                "{degrees}: {thickness}"
            );
            assert!((area - 0.5).abs() < 1e-6);
            let (large, _) = of_triangle(at.map(|p| corner(p, normal)), Vec3::ZERO, true);
            assert!((octahedral::decode(large.normal).z - 1.0).abs() < 1e-6);
            assert_eq!(large.color[3], 255);
        }
        let (line, area) = of_triangle(
            [Vec3::ZERO, Vec3::X, Vec3::X].map(|p| corner(p, Vec3::Y)),
            Vec3::ZERO,
            true,
        );
        assert_eq!((line.color[3], area), (255, 0.0));
    }
}
