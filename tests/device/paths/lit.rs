//! A lamp, and data as colors: the processor's renderer and a device.

use super::{passes, pictures};
use glam::DVec3;
use surfel::math::camera::View;
use surfel::pack::lit_sphere::LitSphere;
use surfel::pack::{ColorBy, Lamp, Phong, SurfaceLighting};
use surfel::render::engine::Engine;
use surfel::render::{Path, Settings, SplatKind};

/// Of these compute has filtered splats in a lamp alone; the others of the device are the rasterizer's.
pub(crate) fn assert_same(theirs: &mut Engine<'_>, ours: &mut Engine<'_>, view: &View, name: &str) {
    let at_a_point = Phong {
        lamp: Lamp::At(DVec3::new(-1.2, 0.6, 0.9)),
        specular: 0.5,
        ..Phong::default()
    };
    for splat in [SplatKind::Square, SplatKind::Disc, SplatKind::Filtered] {
        for (light, color_by) in [
            (SurfaceLighting::Phong(Phong::default()), ColorBy::Shading),
            (SurfaceLighting::Phong(at_a_point), ColorBy::Primitive),
            (
                SurfaceLighting::Sphere(LitSphere::Porcelain),
                ColorBy::Shading,
            ),
            (SurfaceLighting::Headlight, ColorBy::Level),
            (SurfaceLighting::Headlight, ColorBy::Normal),
            (SurfaceLighting::Headlight, ColorBy::Depth),
        ] {
            for threshold_px in [1.0, 3.5] {
                let settings = Settings {
                    splat,
                    light,
                    color_by,
                    threshold_px,
                    path: match splat == SplatKind::Filtered && !color_by.is_data() {
                        true => Path::Compute,
                        false => Path::Raster,
                    },
                    ..Settings::default()
                };
                let what = format!("{name}, {splat:?}, {threshold_px}, {color_by:?}, {light:?}");
                let (wanted, others, _) = passes(theirs, view, &settings);
                assert!(!others.is_empty(), "{what}");
                let (picture, own, _) = passes(ours, view, &settings);
                assert!(own.is_empty(), "{what}: {own:?}");
                assert!(wanted.color.iter().any(|c| c[3] > 0), "{what}: empty");
                pictures::CPU_AS_DEVICE.assert_same(&wanted, &picture, &what);
            }
        }
    }
}
