//! The point of a scan, or the place on a surface, that is seen at a pixel. Pure logic over trees.
//!
//! The picture says how far away what is seen there is. Of a cloud the point next to that place counts; of a surface the first
//! triangle that the ray of the pixel meets.

use crate::math::camera::View;
use crate::projective::surface_rays::SurfaceRays;
use crate::tree::Model;
use glam::{DVec2, DVec3, Vec3};

/// Farthest that a point may be from the pixel, pixels.
pub const REACH_PX: f32 = 6.0;

/// Half of the diagonal of a splat over its radius, and a little more.
const SPLAT_REACH: f64 = 1.5;

/// How far before or behind what the picture shows a point may lie, pixels at its distance, beside its own radius: splats are
/// flat, and as wide as the threshold.
const DEPTH_PX: f32 = 3.0;

/// A model that can be picked from.
#[derive(Debug, Clone, Copy)]
pub struct PickedModel<'a> {
    /// The model.
    pub model: &'a Model,
    /// The model is drawn, and all of it is there.
    pub is_whole: bool,
}

/// What was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PickedPlace {
    /// Index of the model; `None` where only the picture tells the place.
    pub part: Option<usize>,
    /// The point or triangle of that model.
    pub leaf: u32,
    /// The place, model space.
    pub place: DVec3,
}

/// The ray of a pixel: start and direction, with component 1 along the view direction.
struct PixelRay<'a> {
    view: &'a View,
    start: DVec3,
    towards: DVec3,
    at: DVec2,
    /// Size of a pixel at distance 1; at any distance where `view` is parallel.
    pixel: f64,
    /// Distance of what the picture shows.
    depth: f64,
}

impl PixelRay<'_> {
    fn pixel_at(&self, distance: f64) -> f64 {
        match self.view.is_perspective {
            true => self.pixel * distance.max(0.0),
            false => self.pixel,
        }
    }

    /// Tells whether a ball may hold what is looked for, `reach` pixels beside the ray.
    fn comes_near(&self, center: Vec3, radius: f32, reach: f32) -> bool {
        let (offset, radius) = (center.as_dvec3() - self.start, f64::from(radius));
        let along = offset.dot(self.towards) / self.towards.length_squared();
        let beside = offset.distance(self.towards * along);
        // Twice: toward the corners of a wide view pixels are longer than in the middle.
        let slack = 2.0 * f64::from(reach) * self.pixel_at(along + radius);
        beside <= SPLAT_REACH * radius + slack && along + radius >= 0.0
    }

    /// Distance at which the ray meets a triangle, from either side.
    fn meets(&self, corners: [Vec3; 3]) -> Option<f64> {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3() - self.start);
        let (e1, e2) = (b - a, c - a);
        let p = self.towards.cross(e2);
        let determinant = e1.dot(p);
        if determinant == 0.0 {
            return None;
        }
        let u = -a.dot(p) / determinant;
        let q = (-a).cross(e1);
        let v = self.towards.dot(q) / determinant;
        let distance = e2.dot(q) / determinant;
        // A little over the edge, so that none is between two triangles.
        let is_inside = u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9;
        (is_inside && distance >= f64::from(self.view.near)).then_some(distance)
    }
}

/// What is seen at position `at` of a picture that was drawn with `view` (pixels, y down), where the picture shows something
/// at `depth`, the distance along the view direction. Where no model has it, the place is the picture's own.
pub fn pick(models: &[PickedModel<'_>], view: &View, at: DVec2, depth: f32) -> PickedPlace {
    let rays = SurfaceRays::of(view);
    let (x, y) = (at.x as f32, at.y as f32);
    let ray = PixelRay {
        view,
        start: rays.point(x, y, 0.0).as_dvec3(),
        towards: rays.direction(x, y).as_dvec3(),
        at,
        pixel: f64::from(rays.right.length().max(rays.down.length())),
        depth: f64::from(depth),
    };
    let mut best: Option<(f64, PickedPlace)> = None;
    for (part, own) in models.iter().enumerate().filter(|(_, own)| own.is_whole) {
        let found = if own.model.kind().is_surface() {
            on_surface(own.model, &ray)
        } else {
            of_points(own.model, &ray)
        };
        let Some((distance, leaf, place)) = found else {
            continue;
        };
        if best.is_none_or(|(nearest, _)| distance < nearest) {
            let part = Some(part);
            best = Some((distance, PickedPlace { part, leaf, place }));
        }
    }
    match best {
        Some((_, picked)) => picked,
        None => PickedPlace {
            part: None,
            leaf: 0,
            place: ray.start + ray.towards * ray.depth,
        },
    }
}

/// Calls `visit` with each leaf of a model below nodes that come near a ray.
fn each_leaf(model: &Model, ray: &PixelRay<'_>, reach: f32, mut visit: impl FnMut(u32)) {
    let tree = &model.tree;
    if tree.nodes.is_empty() {
        (0..tree.leaf_count()).for_each(visit);
        return;
    }
    let mut open = vec![0];
    while let Some(id) = open.pop() {
        let node = &tree.nodes[id as usize];
        if !ray.comes_near(node.center, node.radius, reach) {
            continue;
        }
        if node.has_leaves() {
            tree.children(id).for_each(&mut visit);
        } else {
            open.extend(tree.children(id));
        }
    }
}

/// The first place of a surface on a ray: its distance, triangle and place.
fn on_surface(model: &Model, ray: &PixelRay<'_>) -> Option<(f64, u32, DVec3)> {
    let mut nearest: Option<(f64, u32)> = None;
    each_leaf(model, ray, 0.5, |leaf| {
        let corners = model.triangles[leaf as usize];
        let corners = corners.map(|corner| model.vertices[corner as usize].position);
        if let Some(distance) = ray.meets(corners)
            && nearest.is_none_or(|(before, _)| distance < before)
        {
            nearest = Some((distance, leaf));
        }
    });
    let (distance, leaf) = nearest?;
    Some((distance, leaf, ray.start + ray.towards * distance))
}

/// The point of a cloud that is seen at a pixel: its distance, its leaf and its place. Of those whose splat may cover the pixel
/// or that are next to it, and that are as far away as what is seen, the one nearest to that place.
fn of_points(model: &Model, ray: &PixelRay<'_>) -> Option<(f64, u32, DVec3)> {
    let seen = ray.start + ray.towards * ray.depth;
    let pixel = ray.pixel_at(ray.depth);
    let mut nearest: Option<(f64, u32, f64)> = None;
    each_leaf(model, ray, REACH_PX, |leaf| {
        let own = &model.tree.leaves[leaf as usize];
        let (x, y, distance) = ray.view.project(own.center);
        let (distance, radius) = (f64::from(distance), f64::from(own.radius));
        let beside = DVec2::new(x.into(), y.into()).distance(ray.at);
        let reach = f64::from(REACH_PX).max(SPLAT_REACH * radius / pixel);
        let is_as_far = (distance - ray.depth).abs() <= f64::from(DEPTH_PX) * pixel + radius;
        let off = own.center.as_dvec3().distance(seen);
        // Of points at one place the first.
        if distance >= f64::from(ray.view.near)
            && is_as_far
            && beside <= reach
            && nearest.is_none_or(|(before, ..)| off < before)
        {
            nearest = Some((off, leaf, distance));
        }
    });
    let (_, leaf, distance) = nearest?;
    let place = model.tree.leaves[leaf as usize].center.as_dvec3();
    Some((distance, leaf, place))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may panic")]
    use super::*;
    use crate::generate::{self, ShapeSpec};
    use crate::math::camera::Camera;
    use crate::mesh::Mesh;
    use crate::progress::SilentProgress;
    use crate::tree::{BuildOptions, build};

    fn view(distance: f64, size: (u32, u32)) -> View {
        let eye = DVec3::new(0.3, 0.2, 1.0).normalize() * distance;
        let range = [0.1, 100.0];
        let camera = Camera::look_at(size, eye, DVec3::ZERO, DVec3::Y, 0.8, range);
        camera.view(DVec3::ZERO).unwrap()
    }

    fn whole(model: &Model) -> [PickedModel<'_>; 1] {
        let is_whole = true;
        [PickedModel { model, is_whole }]
    }

    /// Of points in a ball, each is found where it is seen; nothing before or behind that is.
    #[test]
    fn points_are_found_where_they_are_seen_and_not_behind() {
        let turn = |i: f32, k: f32| (i * k).sin();
        let positions: Vec<Vec3> = (0..4000)
            .map(|i| {
                let i = i as f32;
                Vec3::new(turn(i, 1.1), turn(i, 2.3), turn(i, 3.7))
            })
            .collect();
        let mesh = Mesh {
            positions,
            ..Mesh::default()
        };
        let model = build(mesh, &BuildOptions::default(), &SilentProgress).unwrap();
        let view = view(5.0, (800, 600));
        let mut elsewhere = 0;
        for (leaf, own) in model.tree.leaves.iter().enumerate().step_by(7) {
            let (x, y, distance) = view.project(own.center);
            let at = DVec2::new(x.into(), y.into());
            let found = pick(&whole(&model), &view, at, distance);
            // A twin may be at the same place.
            assert!(found.part == Some(0) && found.place.distance(own.center.as_dvec3()) < 1e-5);
            let twin = model.tree.leaves[found.leaf as usize].center;
            assert!(found.leaf as usize == leaf || twin.distance(own.center) < 1e-5);
            // Something stands before it: the points behind that are not seen.
            let before = pick(&whole(&model), &view, at, distance - 1.0);
            elsewhere += usize::from(before.part.is_none());
            let off = view.distance(before.place.as_vec3()) - (distance - 1.0);
            assert!(off.abs() < 0.35, "{before:?}");
        }
        assert!(elsewhere > 20, "{elsewhere}");
    }

    /// The place on a ball is that of the closed form, within the flatness of its triangles.
    #[test]
    fn places_on_a_surface_are_those_of_the_ray() {
        let spec: ShapeSpec = "sphere:200000".parse().unwrap();
        let model = build(
            generate::mesh(&spec),
            &BuildOptions::default(),
            &SilentProgress,
        )
        .unwrap();
        let view = view(4.0, (500, 500));
        for [x, y] in [[250.0, 250.0], [301.3, 222.8], [180.5, 330.1]] {
            let found = pick(&whole(&model), &view, DVec2::new(x, y), 3.0);
            assert_eq!(found.part, Some(0));
            let (u, v, distance) = view.project(found.place.as_vec3());
            assert!((f64::from(u) - x).abs() < 1e-2 && (f64::from(v) - y).abs() < 1e-2);
            assert!((found.place.length() - 1.0).abs() < 1e-4, "{found:?}");
            assert!(distance < 4.0, "the front");
            let corners = model.triangles[found.leaf as usize];
            let corners = corners.map(|corner| model.vertices[corner as usize].position);
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            assert!(middle.as_dvec3().distance(found.place) < 0.02);
        }
        // Beside the ball only the picture knows; a model that is not drawn is not looked at.
        let beside = pick(&whole(&model), &view, DVec2::new(3.0, 3.0), 3.5);
        assert_eq!(beside.part, None);
        assert!((view.distance(beside.place.as_vec3()) - 3.5).abs() < 1e-5);
        let hidden = PickedModel {
            model: &model,
            is_whole: false,
        };
        let found = pick(&[hidden], &view, DVec2::splat(250.0), 3.0);
        assert_eq!(found.part, None);
    }
}
