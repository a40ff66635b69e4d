//! One ray a pixel through a binary hierarchy of the crate obvhs.
//!
//! Source: Meister and Bittner, *Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction* (2018), as
//! the crate has it, with its fast preset. Its eight-way hierarchy and its slower presets were tried: on the statue of a
//! million triangles 41 and 30 to 35 ms where this takes 30, and up to three times as long to build.

use super::RayCaster;
use crate::bench::BenchError;
use crate::image::Image;
use crate::math::camera::View;
use crate::math::octahedral;
use crate::tree::Model;
use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;
use rayon::prelude::*;

/// Threads that cast.
const THREADS: usize = 2;
/// Side of a block of pixels that one thread casts in a row: rays of neighbors go the same way.
const BLOCK: u32 = 16;

pub(super) struct RayScene<'m> {
    model: &'m Model,
    /// In the order of the hierarchy's leaves.
    triangles: Vec<Triangle>,
    bvh: Bvh2,
    pool: rayon::ThreadPool,
}

impl std::fmt::Debug for RayScene<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Rays")
            .field("triangles", &self.triangles.len())
            .finish_non_exhaustive()
    }
}

impl<'m> RayScene<'m> {
    pub(super) fn new(model: &'m Model) -> Result<Self, BenchError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(THREADS)
            .build()
            .map_err(|e| BenchError::Rival {
                name: "threads for rays",
                cause: e.to_string(),
            })?;
        let triangles: Vec<Triangle> = model
            .triangles
            .par_iter()
            .map(|t| {
                let [v0, v1, v2] = t.map(|i| Vec3A::from(model.vertices[i as usize].position));
                Triangle { v0, v1, v2 }
            })
            .collect();
        let mut time = std::time::Duration::ZERO;
        let bvh = build_bvh2_from_tris(&triangles, BvhBuildParams::fast_build(), &mut time);
        let triangles = bvh
            .primitive_indices
            .par_iter()
            .map(|&i| triangles[i as usize])
            .collect();
        Ok(Self {
            model,
            triangles,
            bvh,
            pool,
        })
    }

    /// Color and coverage of the ray through a place of the picture.
    fn cast(&self, eye: Vec3, direction: Vec3) -> [u8; 4] {
        let mut hit = RayHit::none();
        let ray = Ray::new_inf(eye.into(), direction.into());
        let is_hit = self
            .bvh
            .ray_traverse(ray, &mut hit, |ray, i| self.triangles[i].intersect(ray));
        if !is_hit {
            return [0; 4];
        }
        let found = hit.primitive_id as usize;
        let corners = self.model.triangles[self.bvh.primitive_indices[found] as usize]
            .map(|i| &self.model.vertices[i as usize]);
        // Weights are the parts of the triangle's area across from each corner.
        let place = eye + direction * hit.t;
        let [p, q, r] = corners.map(|v| v.position - place);
        let whole = (q - p).cross(r - p);
        let weight = |a: Vec3, b: Vec3| a.cross(b).dot(whole) / whole.length_squared();
        let weights = [weight(q, r), weight(r, p), weight(p, q)];
        let mut normal = Vec3::ZERO;
        let mut color = [0.0; 3];
        for (v, w) in corners.iter().zip(weights) {
            normal += octahedral::decode(v.normal) * w;
            for (sum, c) in color.iter_mut().zip(v.color) {
                *sum += f32::from(c) / 255.0 * w;
            }
        }
        let light = 0.8 * normal.normalize_or_zero().dot(direction.normalize()).abs();
        let [red, green, blue] = color.map(|c| crate::image::unorm8(f64::from(c * light)));
        [red, green, blue, 255]
    }
}

impl RayCaster for RayScene<'_> {
    fn draw(&self, view: &View) -> Image {
        let (width, height) = (view.width, view.height);
        let model_from_view = view.view_from_model.inverse();
        let mut image = Image::filled(width, height, [0; 4]);
        let cast = |(row, pixels): (usize, &mut [[u8; 4]])| {
            let top = row as u32 * BLOCK;
            for left in (0..width).step_by(BLOCK as usize) {
                for y in top..(top + BLOCK).min(height) {
                    for x in left..(left + BLOCK).min(width) {
                        let x_ndc = (2.0 * x as f32 + 1.0) / width as f32 - 1.0;
                        let y_ndc = 1.0 - (2.0 * y as f32 + 1.0) / height as f32;
                        // Inverse of clip.xy / clip.w at distance 1.
                        let direction = Vec3::new(
                            (x_ndc + view.offset[0]) / view.scale[0],
                            (y_ndc + view.offset[1]) / view.scale[1],
                            -1.0,
                        );
                        let direction = model_from_view.transform_vector3(direction);
                        pixels[((y - top) * width + x) as usize] = self.cast(view.eye, direction);
                    }
                }
            }
        };
        self.pool.install(|| {
            image
                .color
                .par_chunks_mut((width * BLOCK) as usize)
                .enumerate()
                .for_each(cast);
        });
        image
    }
}
