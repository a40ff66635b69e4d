//! From a cut to draw lists, written straight into the caller's memory (the mapped buffer of a frame).

use crate::abi::{Splat, Vertex};
use crate::cut::{Cut, StripRun};
use crate::math::camera::View;
use crate::math::octahedral;
use crate::tree::Model;
use glam::Vec3;

/// How many splats [`splats`] will write at most for a cut.
///
/// `max_size_px` is the largest square the device draws: a larger one is packed as several.
pub fn splat_count(
    model: &Model,
    cut: &Cut,
    view: &View,
    threshold_px: f32,
    max_size_px: f32,
) -> usize {
    let strips: usize = cut.strips.iter().map(|s| s.count as usize).sum();
    let tiles = tiles_per_side(threshold_px, max_size_px);
    let mut count = (cut.nodes.len() + strips) * tiles * tiles;
    if model.triangles.is_empty() {
        for &leaf in &cut.leaves {
            let side = cloud_side_px(model, leaf, view);
            let tiles = tiles_per_side(side.max(threshold_px), max_size_px);
            count += tiles * tiles;
        }
    } else {
        count += cut.leaves.len() * tiles * tiles;
    }
    count
}

/// Into how many squares per side a square of `side` pixels is cut so that none is above `limit`.
fn tiles_per_side(side: f32, limit: f32) -> usize {
    // Nothing on a picture needs more than its largest side in points; the bound keeps a splat just in front
    // of the near plane from asking for millions.
    ((side / limit).ceil() as usize).clamp(1, 64)
}

/// Side in pixels of the square of a cloud's leaf.
fn cloud_side_px(model: &Model, leaf: u32, view: &View) -> f32 {
    let sphere = &model.tree.leaves[leaf as usize];
    if sphere.radius <= 0.0 {
        return 0.0;
    }
    let z = if view.is_perspective {
        view.distance(sphere.center).max(view.near)
    } else {
        1.0
    };
    2.0 * view.focal_px() * sphere.radius * view.model_scale / z
}

/// Writes the splats of a cut and returns how many they are.
///
/// Splats of nodes and small leaves have radius 0, the constant size of the frame (`threshold_px`); a leaf of
/// a cloud that is larger on screen keeps its own radius. Squares above `max_size_px` are written as a grid of
/// smaller ones of the same depth, which cover the same pixels.
///
/// # Panics
/// When `out` is shorter than [`splat_count`].
pub fn splats(
    model: &Model,
    cut: &Cut,
    view: &View,
    threshold_px: f32,
    max_size_px: f32,
    out: &mut [Splat],
) -> usize {
    let mut writer = Writer {
        out,
        len: 0,
        view,
        threshold_px,
        max_size_px,
    };
    let tree = &model.tree;
    for &id in &cut.nodes {
        let node = &tree.nodes[id as usize];
        let attributes = &tree.attributes[id as usize];
        writer.constant(node.center, attributes.normal, attributes.color);
    }
    for &StripRun { node: id, count } in &cut.strips {
        let node = &tree.nodes[id as usize];
        let attributes = &tree.attributes[id as usize];
        for i in 0..count {
            writer.constant(
                crate::cut::strip_center(node, count, i),
                attributes.normal,
                attributes.color,
            );
        }
    }
    for &leaf in &cut.leaves {
        let sphere = &tree.leaves[leaf as usize];
        match model.triangles.get(leaf as usize) {
            Some(corners) => {
                let (normal, color) = mean(corners.map(|i| model.vertices[i as usize]));
                writer.constant(sphere.center, normal, color);
            }
            None => {
                let vertex = &model.vertices[leaf as usize];
                let side = cloud_side_px(model, leaf, view);
                let radius = if side > threshold_px {
                    sphere.radius
                } else {
                    0.0
                };
                writer.write(
                    vertex.position,
                    radius,
                    side.max(threshold_px),
                    vertex.normal,
                    vertex.color,
                );
            }
        }
    }
    writer.len
}

/// Mean normal and color of a triangle's corners (methods.md 2.4).
fn mean(corners: [Vertex; 3]) -> ([i16; 2], [u8; 4]) {
    let sum: Vec3 = corners
        .iter()
        .filter(|v| v.color[3] != 0)
        .map(|v| octahedral::decode(v.normal))
        .sum();
    let channel =
        |i: usize| ((corners.iter().map(|v| u32::from(v.color[i])).sum::<u32>() + 1) / 3) as u8;
    let has_normal = sum != Vec3::ZERO;
    (
        octahedral::encode(sum),
        [
            channel(0),
            channel(1),
            channel(2),
            if has_normal { 255 } else { 0 },
        ],
    )
}

struct Writer<'a> {
    out: &'a mut [Splat],
    len: usize,
    view: &'a View,
    threshold_px: f32,
    max_size_px: f32,
}

impl Writer<'_> {
    #[inline]
    fn constant(&mut self, center: Vec3, normal: [i16; 2], color: [u8; 4]) {
        self.write(center, 0.0, self.threshold_px, normal, color);
    }

    #[inline]
    fn write(&mut self, center: Vec3, radius: f32, side_px: f32, normal: [i16; 2], color: [u8; 4]) {
        if side_px <= self.max_size_px {
            self.out[self.len] = Splat {
                center,
                radius,
                normal,
                color,
            };
            self.len += 1;
        } else {
            self.tile(center, side_px, normal, color);
        }
    }

    /// One square above the device's limit as a grid of squares at the same depth.
    #[cold]
    fn tile(&mut self, center: Vec3, side_px: f32, normal: [i16; 2], color: [u8; 4]) {
        let tiles = tiles_per_side(side_px, self.max_size_px);
        let z = if self.view.is_perspective {
            self.view.distance(center).max(self.view.near)
        } else {
            1.0
        };
        // Model-space length of one pixel at the center's depth.
        let pixel = z / (self.view.focal_px() * self.view.model_scale);
        let tile_px = side_px / tiles as f32;
        let axis =
            |row: usize| self.view.view_from_model.row(row).truncate() / self.view.model_scale;
        let (right, up) = (axis(0), axis(1));
        for y in 0..tiles {
            for x in 0..tiles {
                let offset = |i: usize| (i as f32 + 0.5 - tiles as f32 / 2.0) * tile_px * pixel;
                self.out[self.len] = Splat {
                    center: center + right * offset(x) + up * offset(y),
                    radius: 0.5 * tile_px * pixel,
                    normal,
                    color,
                };
                self.len += 1;
            }
        }
    }
}

/// Writes the corners of the cut's triangles with ids in `range`, as `corners` has them.
///
/// # Panics
/// When `out` is shorter than `ids`.
pub fn triangles(ids: &[u32], corners: &[[u32; 3]], first_id: u32, out: &mut [[u32; 3]]) {
    for (out, &id) in out[..ids.len()].iter_mut().zip(ids) {
        *out = corners[(id - first_id) as usize];
    }
}
