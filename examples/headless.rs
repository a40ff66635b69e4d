//! Draws a model into a picture, without a window: `cargo run --release --example headless -- horse.ply horse.png`

use surfel::render::engine::{Backend, Engine};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let file = args.next().ok_or("usage: headless MODEL PICTURE.png")?;
    let picture = args.next().ok_or("usage: headless MODEL PICTURE.png")?;
    let model = surfel::open(file, &Default::default(), &surfel::progress::SilentProgress)?.model;
    let camera = model.orbit_camera((800, 600), 0.5, 0.35, 1.0);
    let backend = Backend::open(&Default::default())?;
    let mut engine = Engine::new(&backend, &model, (800, 600), Default::default())?;
    let image = engine.render(&camera.view(model.origin)?, &Default::default())?;
    Ok(image.save_png(picture.as_ref())?)
}
