//! Pictures of the device beside those of the mirror.

use crate::common::Device;
use crate::common::pictures::{self, PictureOracle};
use surfel::image::Image;
use surfel::math::camera::View;
use surfel::render::engine::Backend;
use surfel::render::{Settings, SplatKind};
use surfel::tree::Model;

pub(crate) fn draw(backend: &Backend, model: &Model, view: &View, settings: &Settings) -> Image {
    let outputs = pictures::with_depth(settings.splat != SplatKind::Filtered);
    pictures::draw(backend, model, view, settings, outputs).unwrap()
}

/// Draws with device and mirror, and compares. Returns the device's picture.
pub(crate) fn same(
    device: &Device,
    model: &Model,
    view: &View,
    settings: &Settings,
    name: &str,
    oracle: PictureOracle,
) -> Image {
    let backend = Backend::Device(device.gpu().clone());
    let picture = draw(&backend, model, view, settings);
    let mirror = draw(&Backend::Reference, model, view, settings);
    oracle.assert_same(&mirror, &picture, name);
    picture
}
