//! Places of patches in images.
//!
//! A patch has one texture coordinate that is linear in its plane: least squares over the corners below the node, by area. Both
//! that and the place of a triangle in its image are linear over the triangle, so what a patch shows of it is moved in the
//! plane by no more than the worst of its corners is: the slip. It counts as the thickness does: a node is a patch only where
//! its slip is within the tolerance on screen. Where triangles of several images, or some without, lie in its footprint a node
//! never is one; where a seam of one image does, the slip is as far as its sides are apart in the image.

use super::build::FOREIGN_SAMPLES;
use super::fit::{self, FitCorner};
use super::footprint;
use super::nearest::{SurfaceDistance, corner_shares};
use super::record::NodePatch;
use crate::abi::{OrientedPolygon, PatchTexture};
use crate::textures::{NO_IMAGE, TextureImage, TexturePoint, TextureSlope};
use crate::tree::{Model, ModelTextures, PatchRecords, geometric_normal};
use bytemuck::Zeroable;
use glam::{DMat2, Mat3, Vec2, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Rays of pixels: the view as the size of texels needs it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PixelRays {
    /// View from model space, with its scale.
    pub(crate) turn: Mat3,
    /// Length in view space of a unit vector in model space.
    pub(crate) model_scale: f32,
    /// Change of the ray at z = -1 to the next pixel on the right and below; of parallel rays that of their place.
    pub(crate) step: Vec2,
    pub(crate) is_parallel: bool,
}

impl PatchTexture {
    /// A patch in no image.
    pub(crate) fn none() -> Self {
        Self {
            image: NO_IMAGE,
            ..Self::zeroed()
        }
    }

    /// Mark of what no patch may stand for.
    fn never() -> Self {
        Self {
            slip: f32::INFINITY,
            ..Self::none()
        }
    }

    /// Texture coordinate at plane coordinates.
    pub(crate) fn place(&self, uv: Vec2) -> Vec2 {
        Vec2::from(self.at) + self.change(uv)
    }

    /// Change of the texture coordinate along a way in the plane.
    fn change(&self, way: Vec2) -> Vec2 {
        Vec2::from(self.along_u) * way.x + Vec2::from(self.along_v) * way.y
    }

    /// Distance in the plane from these coordinates to where the patch shows what belongs to them, model units; infinite where it
    /// does nowhere.
    fn slip_of(&self, uv: Vec2, place: Vec2) -> f32 {
        let off = place - self.place(uv);
        if self.image == NO_IMAGE || off == Vec2::ZERO {
            return 0.0;
        }
        let [u, v] = [self.along_u, self.along_v].map(|along| Vec2::from(along).as_dvec2());
        let way = DMat2::from_cols(u, v).inverse() * off.as_dvec2();
        let length = way.length() as f32 * 1.000_01;
        if length.is_finite() {
            length
        } else {
            f32::INFINITY
        }
    }

    /// Red, green and blue where a pixel sees a polygon: its plane coordinates, and the place in view space. `None` without an
    /// image.
    pub(crate) fn color(
        &self,
        images: &[Arc<TextureImage>],
        polygon: &OrientedPolygon,
        (uv, place): (Vec2, Vec3),
        rays: &PixelRays,
    ) -> Option<Vec3> {
        let image = images.get(self.image as usize)?;
        let [right, down] = plane_steps(polygon, place, rays);
        let slope = TextureSlope {
            right: self.change(right),
            down: self.change(down),
        };
        Some(image.sample(self.place(uv), image.level_of(slope)))
    }
}

/// Change of plane coordinates from a place of the plane, in view space, to what the next pixels on the right and below see.
fn plane_steps(polygon: &OrientedPolygon, place: Vec3, rays: &PixelRays) -> [Vec2; 2] {
    let [u, v] = [polygon.axis, polygon.second_axis()].map(|axis| rays.turn * axis);
    let normal = u.cross(v);
    // Along the ray the plane is met again.
    let (ray, distance) = match rays.is_parallel {
        true => (Vec3::NEG_Z, 1.0),
        false => (place / -place.z, -place.z),
    };
    let steps = [Vec3::X * rays.step.x, Vec3::Y * rays.step.y];
    steps.map(|step| {
        let way = (step - ray * (normal.dot(step) / normal.dot(ray))) * distance;
        Vec2::new(u.dot(way), v.dot(way)) / (rays.model_scale * rays.model_scale)
    })
}

/// Places in images of the patches of a model, one for each record; none of a model without images. Memory beside the result:
/// 48 bytes for each corner below the largest node that may be a patch, a thread.
pub(super) fn textures_of(model: &Model, records: &PatchRecords) -> Vec<PatchTexture> {
    let Some(textures) = model.textures.as_deref() else {
        return Vec::new();
    };
    let surface = SurfaceDistance::new(model);
    let source = TextureSource {
        model,
        textures,
        surface,
    };
    let nodes = model.tree.nodes.par_iter().enumerate();
    let nodes = nodes.take(records.records.len()).with_min_len(64);
    nodes
        .map_init(Vec::new, |corners, (index, node)| {
            let patch = records.record(index, node);
            match patch.may_be_drawn() && patch.thickness <= node.radius {
                true => source.of_node((index as u32, node.radius), &patch, corners),
                false => PatchTexture::never(),
            }
        })
        .collect()
}

/// A model with images.
struct TextureSource<'a> {
    model: &'a Model,
    textures: &'a ModelTextures,
    surface: SurfaceDistance<'a>,
}

impl TextureSource<'_> {
    /// The place in an image of the patch of a node with this radius.
    fn of_node(
        &self,
        (node, radius): (u32, f32),
        patch: &NodePatch,
        corners: &mut Vec<FitCorner>,
    ) -> PatchTexture {
        corners.clear();
        let model = self.model;
        let own = model.tree.leaf_range(node);
        let mut image = None;
        for leaf in own.clone() {
            let triangle = model.triangles[leaf as usize];
            let positions = triangle.map(|corner| model.vertices[corner as usize].position);
            let (_, area) = geometric_normal(positions);
            for (position, corner) in positions.into_iter().zip(triangle) {
                let TexturePoint { at, image: found } = self.point(corner);
                if *image.get_or_insert(found) != found {
                    return PatchTexture::never();
                }
                corners.push(FitCorner {
                    at: foot(patch, position),
                    normal: Vec3::Z,
                    color: at.extend(0.0),
                    weight: area,
                });
            }
        }
        let mut found = match image {
            None | Some(NO_IMAGE) => PatchTexture::none(),
            Some(image) => fitted(corners, image),
        };
        if found.slip < radius {
            found.slip = found.slip.max(self.foreign_slip(&found, patch, node));
        }
        found
    }

    /// Largest slip of what other triangles show that lie in the footprint: they may be behind a seam of the image, where the
    /// patch shows what is beside its own triangles in the image. Infinite where they are in another image.
    fn foreign_slip(&self, texture: &PatchTexture, patch: &NodePatch, node: u32) -> f32 {
        let model = self.model;
        let own = model.tree.leaf_range(node);
        let enough = patch.thickness.max(patch.overhang);
        let mut most = 0.0f32;
        for share in footprint::samples(FOREIGN_SAMPLES, patch.corner_cuts) {
            let at = share * patch.half_extents;
            let found = self.surface.nearest(patch.point(at), node, enough);
            if !found.distance.is_finite() || own.contains(&found.leaf) {
                continue;
            }
            let triangle = model.triangles[found.leaf as usize];
            let positions = triangle.map(|corner| model.vertices[corner as usize].position);
            if self.point(triangle[0]).image != texture.image {
                return f32::INFINITY;
            }
            let shares = corner_shares(positions, found.place);
            let places = triangle.map(|corner| self.point(corner).at);
            let place: Vec2 = (places.iter().zip(shares))
                .map(|(at, share)| *at * share)
                .sum();
            most = most.max(texture.slip_of(foot(patch, found.place), place));
        }
        most
    }

    fn point(&self, vertex: u32) -> TexturePoint {
        let point = self.textures.points.get(vertex as usize);
        point.copied().unwrap_or(TexturePoint::NOWHERE)
    }
}

/// Plane coordinates of the foot of a point.
fn foot(patch: &NodePatch, point: Vec3) -> Vec2 {
    let offset = point - patch.origin;
    Vec2::new(offset.dot(patch.axis), offset.dot(patch.second_axis()))
}

/// The place that fits corners best, whose texture coordinates are in the place of colors.
fn fitted(corners: &[FitCorner], image: u32) -> PatchTexture {
    let Some((at, [along_u, along_v])) = fit::of_linear(corners) else {
        return PatchTexture::never();
    };
    let mut found = PatchTexture {
        at: at.truncate().to_array(),
        along_u: along_u.truncate().to_array(),
        along_v: along_v.truncate().to_array(),
        image,
        slip: 0.0,
    };
    let slips = corners
        .iter()
        .map(|c| found.slip_of(c.at, c.color.truncate()));
    found.slip = slips.fold(0.0, f32::max);
    found
}

#[cfg(test)]
mod tests;
