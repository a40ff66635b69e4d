#![allow(clippy::unwrap_used, reason = "tests may panic")]
mod common;
use glam::{DVec3, Vec3};
use surfel::abi::Vertex;
use surfel::math::camera::Camera;
use surfel::method::renderer::{Outputs, Renderer};
use surfel::method::scene::Scene;
use surfel::method::{Method, Settings};
use surfel::tree::Model;

#[test]
fn smoke() {
    let Some(device) = common::Device::open() else { return };
    let gpu = device.gpu();
    let v = |x: f32, y: f32| Vertex { position: Vec3::new(x, y, 0.0), normal: [0, 0], color: [255; 4] };
    let model = Model {
        vertices: vec![v(-1.0, -1.0), v(1.0, -1.0), v(1.0, 1.0), v(-1.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        used_vertices: 4,
        ..Model::default()
    };
    let view = Camera::orbit((64, 64), DVec3::ZERO, 1.5, 0.0, 0.0, 0.9).view(DVec3::ZERO).unwrap();
    let mut scene = Scene::new(gpu, &model).unwrap();
    let mut r = Renderer::new(gpu, 64, 64, Outputs { depth: true, normal: true }, true).unwrap();
    for method in [Method::Triangles, Method::Points, Method::Pop] {
        let s = Settings { method, threshold_px: 3.0, ..Settings::default() };
        let t = r.draw(&model, &mut scene, &view, &s).unwrap();
        let image = r.read(&view).unwrap();
        let covered = image.color.iter().filter(|c| c[3] > 0).count();
        println!("{method:?} {covered} {:?} {:?} {} {:?}", t, image.color[32 * 64 + 32], image.depth[32 * 64 + 32], image.normal[32 * 64 + 32]);
    }
}
