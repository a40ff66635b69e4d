//! How long the passes of visibility splats take, for the benchmarks that print it.

use surfel::math::camera::View;
use surfel::render::engine::Engine;
use surfel::render::{Path, Reconstruction, Settings, SplatKind};

/// Most that the passes of pull-push may take at 1024 x 768, milliseconds, on two cores and a software device.
pub(crate) const PULL_PUSH_TARGET_MS: f64 = 21.0;

/// Visibility splats with a reconstruction.
pub(crate) fn settings(threshold_px: f32, reconstruction: Reconstruction) -> Settings {
    Settings {
        splat: SplatKind::Visibility,
        reconstruction,
        threshold_px,
        path: Path::Raster,
        ..Settings::default()
    }
}

/// The least of several times: what the work takes on a machine that does something else now and then.
pub(crate) fn least(times: &[f64]) -> f64 {
    times.iter().copied().fold(f64::INFINITY, f64::min)
}

/// Milliseconds of visibility.depth, of visibility.centers and of the reconstruction, all by the rasterizer, in each of `frames` frames of all
/// `reconstructions` in turn; two frames more go before.
pub(crate) fn times(
    engine: &mut Engine<'_>,
    view: &View,
    threshold_px: f32,
    reconstructions: &[Reconstruction],
    frames: usize,
) -> Vec<[Vec<f64>; 3]> {
    let mut found = vec![[const { Vec::new() }; 3]; reconstructions.len()];
    for frame in 0..frames + 2 {
        for (how, found) in reconstructions.iter().zip(&mut found) {
            let times = engine
                .draw(view, &settings(threshold_px, *how))
                .expect("it draws");
            // Shaders are compiled at the first draw.
            if frame < 2 {
                continue;
            }
            let mut sums = [0.0; 3];
            for pass in &times.passes {
                let row = match pass.name {
                    "visibility.depth" => 0,
                    "visibility.centers" => 1,
                    _ => 2,
                };
                sums[row] += pass.ms;
            }
            for (found, sum) in found.iter_mut().zip(sums) {
                found.push(sum);
            }
        }
    }
    found
}
