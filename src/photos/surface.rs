//! The surface that a camera sees, pixel by pixel, from the renderers that there are: depth and normals of a picture.

use crate::image::Image;
use crate::math::camera::{Camera, HeadlightSource};
use crate::photos::depth_map::PhotoDepth;
use crate::photos::error::PhotoError;
use crate::photos::look::SurfacePixel;
use crate::photos::scene::CalibratedCamera;
use crate::render::engine::{Backend, Engine};
use crate::render::{Method, PictureOutputs, Settings};
use crate::tree::Model;
use glam::{DMat3, DMat4, DVec2, DVec3, DVec4, Vec2, Vec3};

/// Longest side of a depth map, texels.
pub const DEPTH_SIDE: u32 = 1024;

/// Part of the far distance at which the near plane is at least.
const LEAST_NEAR: f64 = 1e-4;

/// Widest field of a depth map: tangent of the angle from the axis.
const WIDEST_FIELD: f64 = 3.0;

/// The surface in a picture of a calibrated camera without distortion.
#[derive(Debug, Clone, Default)]
pub struct SurfacePicture {
    /// The picture as it was drawn, with depth and normals.
    pub image: Image,
    /// The place of each pixel on the surface; `None` where there is none.
    pub pixels: Vec<Option<SurfacePixel>>,
}

/// The renderer's camera of a calibrated one (its distortion is left out), with near and far planes around a model; `None`
/// where the whole model is behind it.
pub fn renderer_camera(camera: &CalibratedCamera, model: &Model) -> Option<Camera> {
    let corners = (0..8).map(|i| {
        let pick = |bit: usize, low: f32, high: f32| if i >> bit & 1 == 0 { low } else { high };
        let (low, high) = (model.min, model.max);
        let corner = Vec3::new(
            pick(0, low.x, high.x),
            pick(1, low.y, high.y),
            pick(2, low.z, high.z),
        );
        camera.to_camera(model.origin + corner.as_dvec3()).z
    });
    let (nearest, farthest) = corners.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| {
        (a.min(z), b.max(z))
    });
    if farthest.is_nan() || farthest <= 0.0 {
        return None;
    }
    let far = 1.01 * farthest;
    let near = (0.99 * nearest).max(LEAST_NEAR * far);
    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let rotation = flip * camera.rotation;
    let mut view = DMat4::from_mat3(rotation);
    view.w_axis = (-(rotation * camera.center)).extend(1.0);
    let [w, h] = [camera.width, camera.height].map(f64::from);
    let [cx, cy] = camera.principal;
    let proj = DMat4::from_cols(
        DVec4::new(2.0 * camera.focal[0] / w, 0.0, 0.0, 0.0),
        DVec4::new(0.0, 2.0 * camera.focal[1] / h, 0.0, 0.0),
        DVec4::new(
            1.0 - 2.0 * cx / w,
            2.0 * cy / h - 1.0,
            far / (near - far),
            -1.0,
        ),
        DVec4::new(0.0, 0.0, near * far / (near - far), 0.0),
    );
    Some(Camera {
        width: camera.width,
        height: camera.height,
        view,
        proj,
        y_down: false,
        light: HeadlightSource::Point,
        other: serde_json::Map::new(),
    })
}

/// The calibrated camera of a renderer's perspective camera; `None` of an orthographic one.
pub fn calibrated_camera(camera: &Camera) -> Option<CalibratedCamera> {
    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let rotation = flip * DMat3::from_mat4(camera.view);
    let [w, h] = [camera.width, camera.height].map(f64::from);
    let sign = if camera.y_down { -1.0 } else { 1.0 };
    let (p, is_perspective) = (
        camera.proj,
        camera.proj.row(3) == DVec4::new(0.0, 0.0, -1.0, 0.0),
    );
    let found = CalibratedCamera {
        width: camera.width,
        height: camera.height,
        focal: [0.5 * w * p.x_axis.x, 0.5 * sign * h * p.y_axis.y],
        principal: [
            0.5 * w * (1.0 - p.z_axis.x),
            0.5 * h * (1.0 + sign * p.z_axis.y),
        ],
        lens: Default::default(),
        rotation,
        center: -(rotation.transpose() * (flip * camera.view.w_axis.truncate())),
    };
    (is_perspective && found.is_usable()).then_some(found)
}

/// Draws the surface of one model.
#[derive(Debug)]
pub struct SurfaceDrawer<'m> {
    backend: Backend,
    model: &'m Model,
    settings: Settings,
}

impl<'m> SurfaceDrawer<'m> {
    /// Draws on a backend: a mesh as triangles, a point cloud as splats of its points.
    pub fn new(backend: &Backend, model: &'m Model) -> Self {
        let method = match model.kind().is_surface() {
            true => Method::Triangles,
            false => Method::Splats,
        };
        Self {
            backend: backend.clone(),
            model,
            settings: Settings {
                method,
                ..Settings::default()
            },
        }
    }

    /// The model.
    pub fn model(&self) -> &'m Model {
        self.model
    }

    fn picture(
        &self,
        model: &Model,
        camera: &CalibratedCamera,
        outputs: PictureOutputs,
    ) -> Result<Image, PhotoError> {
        let size = (camera.width, camera.height);
        let Some(of_renderer) = renderer_camera(camera, self.model) else {
            let mut nothing = Image::filled(size.0, size.1, [0, 0, 0, 0]);
            nothing.depth = vec![f32::INFINITY; nothing.color.len()];
            nothing.normal = vec![[0.0; 3]; nothing.color.len()];
            nothing.values = vec![[0.0; 4]; nothing.color.len()];
            return Ok(nothing);
        };
        let mut engine = Engine::new(&self.backend, model, size, outputs)?;
        Ok(engine.render(&of_renderer.view(model.origin)?, &self.settings)?)
    }

    /// The surface that a camera without distortion sees.
    ///
    /// # Errors
    /// When the backend cannot draw it.
    pub fn surface(&self, camera: &CalibratedCamera) -> Result<SurfacePicture, PhotoError> {
        let outputs = PictureOutputs {
            depth: true,
            normal: true,
            values: false,
        };
        let image = self.picture(self.model, camera, outputs)?;
        let eye = camera.center - self.model.origin;
        let to_world = camera.rotation.transpose();
        let direction = |x: f64, y: f64| {
            let ray = DVec3::new(
                (x - camera.principal[0]) / camera.focal[0],
                (y - camera.principal[1]) / camera.focal[1],
                1.0,
            );
            to_world * ray
        };
        let pixels = (0..image.depth.len()).map(|index| {
            let depth = f64::from(image.depth[index]);
            if !depth.is_finite() {
                return None;
            }
            let column = (index % image.width as usize) as f64 + 0.5;
            let row = (index / image.width as usize) as f64 + 0.5;
            let ray = direction(column, row);
            let position = eye + depth * ray;
            let mut normal = Vec3::from(image.normal[index]).as_dvec3();
            if normal.dot(ray) > 0.0 {
                normal = -normal;
            }
            // Where the next pixels' rays meet the plane of this one; at grazing angles not farther than eight steps.
            let step = |dx: f64, dy: f64| {
                let other = direction(column + dx, row + dy);
                let flat = depth * (other - ray);
                let facing = normal.dot(other);
                if facing > -1e-6 {
                    return flat.as_vec3();
                }
                let along = other * (depth * normal.dot(ray) / facing) - depth * ray;
                let longest = 8.0 * flat.length();
                along.clamp_length_max(longest).as_vec3()
            };
            Some(SurfacePixel {
                position: position.as_vec3(),
                normal: normal.as_vec3(),
                steps: [step(1.0, 0.0), step(0.0, 1.0)],
            })
        });
        Ok(SurfacePicture {
            pixels: pixels.collect(),
            image,
        })
    }

    /// The colors of the model's vertices, without light, as a camera without distortion sees them: red, green, blue and
    /// covered fraction, 0..=1.
    ///
    /// # Errors
    /// When the backend cannot draw it.
    pub fn vertex_colors(
        &self,
        colors: &[[u8; 3]],
        camera: &CalibratedCamera,
    ) -> Result<Vec<[f32; 4]>, PhotoError> {
        let mut colored = self.model.clone();
        colored.has_colors = true;
        for (vertex, [r, g, b]) in colored.vertices.iter_mut().zip(colors) {
            // Without a normal it is drawn as if it faced the light.
            vertex.color = [*r, *g, *b, 0];
        }
        let outputs = PictureOutputs {
            values: true,
            ..PictureOutputs::default()
        };
        let image = self.picture(&colored, camera, outputs)?;
        // What faces the light has a value of 0.8.
        Ok(image
            .values
            .iter()
            .map(|[r, g, b, a]| [r / 0.8, g / 0.8, b / 0.8, *a])
            .collect())
    }

    /// Depth of the model as a photograph sees it, in a map of at most [`DEPTH_SIDE`] texels that holds all rays of its lens.
    ///
    /// # Errors
    /// When the backend cannot draw it.
    pub fn depth_map(&self, camera: &CalibratedCamera) -> Result<PhotoDepth, PhotoError> {
        let of_map = map_camera(camera);
        let outputs = PictureOutputs {
            depth: true,
            ..PictureOutputs::default()
        };
        let image = self.picture(self.model, &of_map, outputs)?;
        let pair = |v: [f64; 2]| Vec2::new(v[0] as f32, v[1] as f32);
        let size = [of_map.width, of_map.height];
        Ok(PhotoDepth::new(
            size,
            pair(of_map.focal),
            pair(of_map.principal),
            image.depth,
        ))
    }
}

/// A pinhole camera of at most [`DEPTH_SIDE`] pixels that sees all that a photograph does, undistorted.
fn map_camera(camera: &CalibratedCamera) -> CalibratedCamera {
    let [w, h] = [camera.width.max(1), camera.height.max(1)].map(f64::from);
    let steps = 16;
    let mut low = DVec2::splat(f64::INFINITY);
    let mut high = DVec2::splat(f64::NEG_INFINITY);
    for i in 0..=steps {
        let t = f64::from(i) / f64::from(steps);
        for pixel in [(t * w, 0.0), (t * w, h), (0.0, t * h), (w, t * h)] {
            let ray = camera.lens.undistort([
                (pixel.0 - camera.principal[0]) / camera.focal[0],
                (pixel.1 - camera.principal[1]) / camera.focal[1],
            ]);
            let [x, y] = ray.unwrap_or([WIDEST_FIELD; 2]);
            low = low.min(DVec2::new(x, y));
            high = high.max(DVec2::new(x, y));
        }
    }
    let low = low.max(DVec2::splat(-WIDEST_FIELD));
    let high = high.min(DVec2::splat(WIDEST_FIELD)).max(low + 1e-6);
    let field = high - low;
    let f = f64::from(DEPTH_SIDE.min(camera.width.max(camera.height).max(1))) / field.max_element();
    CalibratedCamera {
        width: (field.x * f).ceil().max(1.0) as u32,
        height: (field.y * f).ceil().max(1.0) as u32,
        focal: [f; 2],
        principal: [-low.x * f, -low.y * f],
        ..camera.pinhole()
    }
}
