//! Draws a model into a picture, without a window: `cargo run --release --example headless -- horse.ply horse.png`

use std::path::Path;
use surfel::gpu::Options;
use surfel::math::camera::Camera;
use surfel::progress::Silent;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Method, Settings};
use surfel::{input, tree};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let (Some(file), Some(picture)) = (args.next(), args.next()) else {
        return Err("usage: headless MODEL PICTURE.png".into());
    };
    let mesh = input::load(Path::new(&file), &input::Options::default(), &Silent)?.mesh;
    let model = tree::build(mesh, &tree::BuildOptions::default(), &Silent)?;
    let center = model.origin + model.orbit_center.as_dvec3();
    let camera = Camera::orbit(
        (800, 600),
        center,
        f64::from(model.orbit_radius),
        0.5,
        0.35,
        1.0,
    );
    let view = camera.view(model.origin)?;
    let backend = Backend::open(&Options::default())?;
    let mut engine = Engine::new(&backend, &model, (800, 600), PictureOutputs::default())?;
    let settings = Settings {
        method: Method::Pop,
        threshold_px: 1.0,
        ..Settings::default()
    };
    engine
        .render(&view, &settings)?
        .save_png(Path::new(&picture))?;
    Ok(())
}
