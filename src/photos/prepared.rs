//! A photograph, ready for any frame: its camera in the space of a model, what it sees of it, and its colors at some places.

use crate::math::octahedral;
use crate::photos::depth_map::{DepthQuery, PhotoDepth, PhotoVisibility};
use crate::photos::error::PhotoError;
use crate::photos::hull::{HullMiddle, hull_direction};
use crate::photos::library::load_photo;
use crate::photos::look::LookPhoto;
use crate::photos::projected::ProjectedPhoto;
use crate::photos::pyramid::PhotoPyramid;
use crate::photos::scene::ScenePhoto;
use crate::photos::surface::SurfaceDrawer;
use crate::tree::Model;
use glam::Vec3;
use std::sync::Arc;

/// Places of the surface at which exposures are compared, at most.
const GAIN_PLACES: usize = 20_000;

/// Points of the model that its hull in a photograph is made of, at most.
const HULL_POINTS: usize = 200_000;

/// Levels above the one of a photograph's pixels at which exposures are compared.
const GAIN_LEVEL: f32 = 3.0;

/// A photograph, ready for any frame; its pixels are kept elsewhere.
#[derive(Debug, Clone)]
pub struct PreparedPhoto {
    /// Camera of the photograph.
    pub projected: ProjectedPhoto,
    /// Depth of the model as it sees it.
    pub depth: Arc<PhotoDepth>,
    /// Mask of the photograph, where it has one.
    pub mask: Option<Arc<PhotoPyramid>>,
    /// Colors at the places where exposures are compared; `None` where it does not show them.
    pub colors: Vec<Option<Vec3>>,
}

/// Vertices that something is drawn of.
pub(crate) fn used_vertices(model: &Model) -> &[crate::abi::Vertex] {
    &model.vertices[..(model.used_vertices as usize).min(model.vertices.len())]
}

/// Every so many, such that at most `most` are left.
fn stride(count: usize, most: usize) -> usize {
    count.div_ceil(most.max(1)).max(1)
}

impl PreparedPhoto {
    /// Readies the photograph of this index in its scene: draws its depth map, decodes its mask, and reads colors from some of
    /// its pixels, which may be those of a thumbnail. Levels of masks longer than `longest_side` are left out.
    ///
    /// # Errors
    /// When the mask cannot be decoded or the depth map not be drawn.
    pub fn new(
        index: usize,
        photo: &ScenePhoto,
        drawer: &SurfaceDrawer<'_>,
        pixels: &PhotoPyramid,
        longest_side: u32,
    ) -> Result<Self, PhotoError> {
        let model = drawer.model();
        let size = 2.0 * f64::from(model.orbit_radius);
        let mut projected = ProjectedPhoto::new(index as u32, &photo.camera, model.origin, size);
        let used = used_vertices(model);
        let step = stride(used.len(), HULL_POINTS);
        let points = used
            .iter()
            .step_by(step)
            .map(|v| model.origin + v.position.as_dvec3());
        let hull = hull_direction(&photo.camera, points, HullMiddle::Area);
        (projected.direction, projected.area) = (hull.direction.as_vec3(), hull.area as f32);
        let depth = Arc::new(drawer.depth_map(&photo.camera)?);
        let mask = match &photo.mask {
            None => None,
            Some(file) => {
                let mut of_mask = photo.clone();
                of_mask.file = Some(file.clone());
                Some(Arc::new(load_photo(&of_mask, longest_side)?))
            }
        };
        let step = stride(used.len(), GAIN_PLACES);
        let look = LookPhoto {
            photo: &projected,
            pixels,
            depth: &depth,
            mask: mask.as_deref(),
        };
        let colors = used
            .iter()
            .step_by(step)
            .map(|v| color_at(&look, v.position, octahedral::decode(v.normal)));
        let colors = colors.collect();
        Ok(Self {
            projected,
            depth,
            mask,
            colors,
        })
    }

    /// Tells whether the photograph shows any of the model. The hull knows vertices alone: none of a large triangle may lie in it.
    pub fn shows_model(&self) -> bool {
        self.projected.area > 0.0 || self.depth.depth.iter().any(|depth| depth.is_finite())
    }

    /// As the look takes it, without pixels and mask: for weights alone.
    pub fn without_pixels<'a>(&'a self, nothing: &'a PhotoPyramid) -> LookPhoto<'a> {
        LookPhoto {
            photo: &self.projected,
            pixels: nothing,
            depth: &self.depth,
            mask: None,
        }
    }
}

/// The color of a point in a photograph that sees it, blurred a little.
pub(crate) fn color_at(look: &LookPhoto<'_>, position: Vec3, normal: Vec3) -> Option<Vec3> {
    let photo = look.photo;
    let place = photo.place(position)?;
    let facing = normal.dot(photo.ray_to(position)).abs();
    let p = photo.rotation * (position - photo.center);
    let query = DepthQuery {
        ray: p.truncate() / p.z,
        depth: p.z,
        slope: (1.0 - facing * facing).max(0.0).sqrt() / facing.max(0.05),
    };
    let seen = look.depth.visibility(query, PhotoVisibility::DepthSoft);
    let at = (place.pixel / photo.size).to_array();
    let is_masked = look.mask.is_some_and(|mask| mask.sample(at, 0.0)[1] < 0.5);
    // Levels are counted from the largest that is held.
    let held = (look.pixels.size()[0] as f32 / photo.size.x.max(1.0))
        .max(1e-6)
        .log2();
    let level = (GAIN_LEVEL + held.min(0.0)).max(0.0);
    (seen > 0.5 && facing > 0.2 && !is_masked).then(|| Vec3::from(look.pixels.sample(at, level)))
}
