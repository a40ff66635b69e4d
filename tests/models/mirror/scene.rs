//! Scenes and views of the tests.

use glam::{DMat4, DVec3, DVec4, Vec3};
use std::f64::consts::{PI, TAU};
use surfel::abi::{Splat, SplatRadius, Vertex};
use surfel::image::Image;
use surfel::math::camera::{Camera, HeadlightSource, View};
use surfel::math::octahedral;
use surfel::pack::{DrawList, PrimitiveStyle};
use surfel::render::PictureOutputs;
use surfel::render::reference::render;

pub(crate) const BOTH: PictureOutputs = PictureOutputs {
    depth: true,
    normal: true,
    values: false,
};

/// A white vertex with a normal towards +z.
pub(crate) fn vertex(position: Vec3) -> Vertex {
    Vertex {
        position,
        normal: octahedral::encode(Vec3::Z),
        color: [255; 4],
    }
}

pub(crate) fn splat(center: Vec3, radius: f32) -> Splat {
    Splat {
        center,
        radius: SplatRadius::own(radius),
        normal: octahedral::encode(Vec3::Z),
        color: [255; 4],
    }
}

/// Vertices and triangles of a model of a test.
#[derive(Default, Clone)]
pub(crate) struct Model {
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Model {
    pub(crate) fn list(&self) -> DrawList<'_> {
        DrawList {
            vertices: &self.vertices,
            triangles: &self.triangles,
            ..DrawList::default()
        }
    }

    pub(crate) fn from_corners(triangles: &[[Vec3; 3]]) -> Self {
        Self {
            vertices: triangles.iter().flatten().map(|p| vertex(*p)).collect(),
            triangles: (0..triangles.len() as u32)
                .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
                .collect(),
        }
    }
}

/// The generated sphere of the conventions: nu x nv cells, seam doubled, analytic normals.
pub(crate) fn sphere(center: DVec3, nu: u32, nv: u32) -> Model {
    let mut model = Model::default();
    for j in 0..=nv {
        for i in 0..=nu {
            let u = f64::from(i) / f64::from(nu) * TAU;
            let w = (f64::from(j) / f64::from(nv) - 0.5) * PI;
            let p = DVec3::new(w.cos() * u.sin(), w.sin(), w.cos() * u.cos());
            model.vertices.push(Vertex {
                position: (center + p).as_vec3(),
                normal: octahedral::encode(p.as_vec3()),
                color: [255; 4],
            });
        }
    }
    for j in 0..nv {
        for i in 0..nu {
            let a = j * (nu + 1) + i;
            model.triangles.push([a, a + 1, a + nu + 2]);
            model.triangles.push([a, a + nu + 2, a + nu + 1]);
        }
    }
    model
}

/// A perspective camera in the origin, looking down -z.
pub(crate) fn from_origin(size: (u32, u32), fov_degrees: f64, planes: (f64, f64)) -> View {
    Camera::look_at(
        size,
        DVec3::ZERO,
        DVec3::NEG_Z,
        DVec3::Y,
        fov_degrees.to_radians(),
        planes.into(),
    )
    .view(DVec3::ZERO)
    .unwrap()
}

/// An orthographic view of 64 x 64 pixels in which [`at`] gives window positions, distances 0 to 16.
pub(crate) fn flat_view() -> View {
    let camera = Camera {
        width: 64,
        height: 64,
        view: DMat4::IDENTITY,
        proj: DMat4::from_cols(
            DVec4::new(2.0 / 64.0, 0.0, 0.0, 0.0),
            DVec4::new(0.0, 2.0 / 64.0, 0.0, 0.0),
            DVec4::new(0.0, 0.0, -1.0 / 16.0, 0.0),
            DVec4::new(-1.0, -1.0, 0.0, 1.0),
        ),
        y_down: false,
        light: HeadlightSource::Point,
        other: serde_json::Map::new(),
    };
    camera.view(DVec3::ZERO).unwrap()
}

/// The model-space point that [`flat_view`] shows at window position (x, y) and distance z.
pub(crate) fn at(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, 64.0 - y, -z)
}

pub(crate) fn draw_flat(list: &DrawList, style: &PrimitiveStyle) -> Image {
    render(&flat_view(), list, style, BOTH)
}

/// Alpha of each pixel as a count of 0 or 1.
pub(crate) fn coverage(image: &Image) -> Vec<u32> {
    image.color.iter().map(|c| u32::from(c[3] == 255)).collect()
}

/// The unit sphere from distance `d` on +z, field of view 60 degrees, square picture.
pub(crate) fn sphere_view(d: f64, size: u32) -> View {
    let eye = DVec3::new(0.0, 0.0, d);
    Camera::look_at(
        (size, size),
        eye,
        DVec3::ZERO,
        DVec3::Y,
        PI / 3.0,
        [d - 1.05, d + 1.05],
    )
    .view(DVec3::ZERO)
    .unwrap()
}
