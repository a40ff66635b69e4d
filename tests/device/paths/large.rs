//! Large squares and discs by the processor, beside those of the rasterizer.

use super::{built, colored, passes, pictures};
use crate::common::{self, Device, generated, orbit};
use surfel::generate::GeneratedShape;
use surfel::render::PictureOutputs;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Culling, Method, Path, Settings, SplatKind};

/// Asserts of statue, torus, a model of colors and its points that the processor's pictures are those of the rasterizer: how many it
/// drew, and how many have splats of the rasterizer.
fn compared(method: Method, thresholds_px: &[f32]) -> Option<[usize; 2]> {
    let device = Device::with_compute()?;
    let mut cloud = colored();
    cloud.triangles.clear();
    let models = [
        ("statue", generated(GeneratedShape::Statue, 60_000)),
        ("few", generated(GeneratedShape::Torus, 2_000)),
        ("colored", built(colored())),
        ("cloud", built(cloud)),
    ];
    let size = (240, 200);
    let on_device = Backend::Vulkan(device.gpu().clone());
    let outputs = PictureOutputs {
        depth: true,
        normal: false,
        values: false,
    };
    let [mut alone, mut rasterized] = [0; 2];
    for (name, model) in &models {
        let engine = |backend| Engine::new(backend, model, size, outputs).unwrap();
        let (mut theirs, mut ours) = (engine(&on_device), engine(&Backend::Cpu));
        let mut part = orbit(model, size, 30.0, 20.0, 1.6);
        part.offset = [0.9, -0.7];
        for view in [
            orbit(model, size, 80.0, -10.0, 0.9),
            part,
            common::orthographic(model, size),
        ] {
            for &threshold_px in thresholds_px {
                for (splat, culling) in [
                    (SplatKind::Square, Culling::Auto),
                    (SplatKind::Disc, Culling::Off),
                ] {
                    let settings = Settings {
                        method,
                        splat,
                        threshold_px,
                        culling,
                        background: [0.1, 0.2, 0.3],
                        ..Settings::default()
                    };
                    let by_raster = Settings {
                        path: Path::Raster,
                        ..settings
                    };
                    let (wanted, others, _) = passes(&mut theirs, &view, &by_raster);
                    let (picture, own, _) = passes(&mut ours, &view, &settings);
                    let what = format!("{name}, {splat:?}, {threshold_px}: {own:?}");
                    alone += usize::from(own.is_empty());
                    rasterized += usize::from(others.contains(&"opaque.splats"));
                    pictures::CPU_LARGE_AS_RASTER.assert_same(&wanted, &picture, &what);
                }
            }
        }
    }
    println!("{alone} pictures by the processor, {rasterized} of splats by the rasterizer");
    Some([alone, rasterized])
}

#[test]
fn large_splats_are_the_same_by_the_processor() {
    if let Some([alone, rasterized]) = compared(Method::Pop, &[6.5, 12.0, 25.3, 70.0]) {
        assert!(alone == 96 && rasterized >= 60);
    }
}

/// A leaf that is larger than the threshold is a splat of its own size.
#[test]
fn leaves_of_their_own_sizes_are_the_same_by_the_processor() {
    if let Some([alone, rasterized]) = compared(Method::Splats, &[0.5, 1.0, 3.0, 12.0]) {
        assert!(alone == 96 && rasterized >= 60);
    }
}
