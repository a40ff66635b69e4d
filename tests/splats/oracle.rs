//! Pictures of the device beside those of the mirror.

use crate::common::Device;
use glam::Vec3;
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::render::engine::{Backend, Engine};
use surfel::render::vulkan::renderer::Outputs;
use surfel::render::{Settings, SplatKind};
use surfel::tree::Model;

pub(crate) fn draw(backend: &Backend, model: &Model, view: &View, settings: &Settings) -> Image {
    engine(backend, model, view, settings)
        .render(view, settings)
        .unwrap()
}

fn engine<'m>(backend: &Backend, model: &'m Model, view: &View, settings: &Settings) -> Engine<'m> {
    let outputs = Outputs {
        depth: true,
        normal: settings.splat != SplatKind::Filtered,
        values: false,
    };
    Engine::new(backend, model, (view.width, view.height), outputs).unwrap()
}

/// How many pixels differ: in coverage or color by more than one level, in depth, or in normal.
fn differing(device: &Image, mirror: &Image) -> usize {
    (0..mirror.color.len())
        .filter(|&i| {
            let colors = device.color[i].iter().zip(mirror.color[i]);
            let far = (device.depth[i], mirror.depth[i]);
            // Reversed single-precision depth resolves about 1e-6 of the distance in these scenes.
            let depth = far.0.is_finite() != far.1.is_finite()
                || (far.1.is_finite() && (far.0 - far.1).abs() > 1e-3 * far.1);
            let normal = !device.normal.is_empty()
                && (Vec3::from(device.normal[i]) - Vec3::from(mirror.normal[i])).length() > 4e-3;
            depth || normal || colors.into_iter().any(|(d, m)| d.abs_diff(m) > 1)
        })
        .count()
}

/// Draws with device and mirror. The last bit of a position moves the outline of a footprint by about 1e-4 of a pixel
/// and the pixel of a small one by 1/256: `share` of the covered pixels may change hands, and two.
pub(crate) fn same(
    device: &Device,
    model: &Model,
    view: &View,
    settings: &Settings,
    name: &str,
    share: f64,
) -> Image {
    let picture = draw(
        &Backend::Device(device.gpu().clone()),
        model,
        view,
        settings,
    );
    let mirror = engine(&Backend::Mirror, model, view, settings)
        .with_subpixel_bits(device.gpu().info().subpixel_bits)
        .render(view, settings)
        .unwrap();
    let covered = mirror.color.iter().filter(|c| c[3] > 0).count();
    let differ = differing(&picture, &mirror);
    let allowed = 2 + (share * covered as f64).ceil() as usize;
    println!("{name}: {differ} of {covered} differ, {allowed} allowed");
    assert!(covered > 50, "{name}: an empty picture proves nothing");
    if differ > allowed
        && let Some(folder) = std::env::var_os("SURFEL_KEEP")
    {
        let folder = std::path::PathBuf::from(folder);
        picture.save_png(&folder.join("device.png")).unwrap();
        mirror.save_png(&folder.join("mirror.png")).unwrap();
    }
    assert!(differ <= allowed, "{name}: {differ} pixels differ");
    picture
}
