//! Draws a model into a picture, without a window: `cargo run --release --example headless -- horse.ply horse.png`

use surfel::render::{Settings, engine};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let file = args.next().ok_or("usage: headless MODEL PICTURE.png")?;
    let picture = args.next().ok_or("usage: headless MODEL PICTURE.png")?;
    let model = surfel::open(file, &Default::default(), &surfel::progress::SilentProgress)?.model;
    let backend = engine::Backend::open(&Default::default())?;
    let mut engine = engine::Engine::new(&backend, &model, (800, 600), Default::default())?;
    let camera = model.orbit_camera((800, 600), 0.5, 0.35, 1.0);
    let image = engine.smooth(&camera.view(model.origin)?, &Settings::for_people(&model))?;
    Ok(image.to_image().save_png(picture.as_ref())?)
}
