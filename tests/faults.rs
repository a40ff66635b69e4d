//! Calls of Vulkan that fail, one after the other, and devices that can less: each run ends in the same picture or in one
//! sentence, with nothing left behind on the device.
//!
//! Each test run lets a part of the calls fail; all of them, in an hour or so (docs/TRUST.md), with
//!
//!     SURFEL_FAULTS=all cargo test --test faults -- --nocapture
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;
#[cfg(feature = "viewer")]
#[path = "faults/window.rs"]
mod window;

use common::{Device, generated};
use std::sync::{Mutex, MutexGuard, PoisonError};
use surfel::generate::GeneratedShape;
use surfel::gpu::device::DeviceInfo;
use surfel::gpu::faults::{CallFault, CallFaults};
use surfel::gpu::{DeviceOptions, Error, Gpu};
use surfel::image::Image;
use surfel::render::engine::{Backend, Engine};
use surfel::render::{Path, PictureOutputs, Settings, SplatKind};
use surfel::tree::Model;

const SIZE: (u32, u32) = (96, 80);

/// One device has counted calls at a time.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether every call is let fail, by every fault.
fn is_full() -> bool {
    std::env::var("SURFEL_FAULTS").is_ok_and(|value| value == "all")
}

fn settings(path: Path, splat: SplatKind) -> Settings {
    Settings {
        path,
        splat,
        threshold_px: 3.0,
        ..Settings::default()
    }
}

/// Runs whose calls are let fail: the passes of the rasterizer, of two blended passes, and of compute.
fn cases() -> [(&'static str, Settings); 3] {
    [
        ("squares", settings(Path::Raster, SplatKind::Square)),
        ("gauss", settings(Path::Raster, SplatKind::Gauss)),
        ("compute", settings(Path::Compute, SplatKind::Square)),
    ]
}

fn draw(engine: &mut Engine<'_>, model: &Model, settings: &Settings) -> Result<Image, Error> {
    let camera = model.orbit_camera(SIZE, 0.5, 0.35, 0.9);
    engine.render(&camera.view(model.origin).unwrap(), settings)
}

/// Opens a device, draws two frames, and closes it. The error of the first call that failed, or the last picture.
///
/// # Panics
/// When validation says anything, or a frame after one that failed is another picture.
fn run(
    model: &Model,
    settings: &Settings,
    options: DeviceOptions,
    wanted: Option<&Image>,
) -> Result<Image, Error> {
    let gpu = Gpu::open(&DeviceOptions {
        validation: true,
        ..options
    })?;
    let messages = gpu.messages().clone();
    let mut result = Err(Error::NoDevice("nothing was drawn".to_owned()));
    {
        let backend = Backend::Vulkan(gpu.clone());
        match Engine::new(&backend, model, SIZE, PictureOutputs::default()) {
            Ok(mut engine) => {
                let mut failure = None;
                for _ in 0..3 {
                    match draw(&mut engine, model, settings) {
                        Ok(image) => {
                            if let Some(wanted) = wanted {
                                assert!(image == *wanted, "another picture");
                            }
                            result = Ok(image);
                        }
                        Err(error) => failure = failure.or(Some(error)),
                    }
                }
                if let Some(error) = failure {
                    result = Err(error);
                }
            }
            Err(error) => result = Err(error),
        }
    }
    assert!(
        std::sync::Arc::try_unwrap(gpu).is_ok(),
        "something of the device is left"
    );
    let said = messages.take();
    assert!(said.is_empty(), "validation said: {said:#?}");
    result
}

/// One sentence that says what failed and for what.
fn assert_sentence(error: &Error, call: &str) {
    let text = error.to_string();
    assert!(
        text.lines().count() == 1 && text.len() < 400 && text.len() > 20,
        "{call}: {text}"
    );
    let is_named = matches!(error, Error::Memory { .. }) || text.contains("failed for");
    assert!(is_named, "{call}: {text}");
}

/// Lets each call that can fail so fail once, every `step`-th of them; prints how the runs ended.
fn sweep(name: &str, settings: &Settings, fault: CallFault, step: u64) {
    let model = generated(GeneratedShape::Statue, 3000);
    let with = |faults: &CallFaults| DeviceOptions {
        call_faults: Some(faults.clone()),
        ..DeviceOptions::default()
    };
    let counting = CallFaults::new(fault, 0);
    let wanted = run(&model, settings, with(&counting), None).unwrap();
    let calls = counting.calls();
    let least = if fault == CallFault::InitializationFailed {
        3
    } else {
        10
    };
    assert!(calls > least, "{calls} calls: are they counted at all?");
    let (mut pictures, mut sentences) = (0, 0);
    for at in (1..=calls).step_by(step as usize) {
        let faults = CallFaults::new(fault, at);
        let result = run(&model, settings, with(&faults), Some(&wanted));
        // Pipelines that are in the cache by now are made sooner, but none is left out.
        let Some(call) = faults.failed() else {
            panic!("{name}: call {at} of {calls} was not made")
        };
        match result {
            Ok(_) => pictures += 1,
            Err(error) => {
                assert_sentence(&error, call);
                sentences += 1;
            }
        }
    }
    println!("| {name} | {fault:?} | {calls} | {pictures} | {sentences} |");
    assert!(sentences > 0, "no call failed");
}

#[test]
fn out_of_device_memory_at_every_call() {
    let _alone = alone();
    let Some(device) = Device::open() else { return };
    drop(device);
    let [(name, settings), ..] = cases();
    sweep(name, &settings, CallFault::OutOfDeviceMemory, 1);
}

#[test]
fn a_lost_device_at_every_call() {
    let _alone = alone();
    let Some(device) = Device::open() else { return };
    drop(device);
    for (name, settings) in cases() {
        sweep(name, &settings, CallFault::DeviceLost, 1);
    }
}

#[test]
fn samples_of_the_other_faults() {
    let _alone = alone();
    let Some(device) = Device::with_compute() else {
        return;
    };
    drop(device);
    let step = |of_samples| if is_full() { 1 } else { of_samples };
    for (name, settings) in cases() {
        sweep(name, &settings, CallFault::OutOfHostMemory, step(7));
        sweep(name, &settings, CallFault::OutOfDeviceMemory, step(5));
        sweep(name, &settings, CallFault::InitializationFailed, 1);
    }
}

/// Most pixels that two ways of drawing may differ in, of 96 x 80: points and quads round their edges differently.
const MOST_DIFFERENT: usize = 60;

#[test]
fn devices_that_can_less_draw_the_same() {
    let _alone = alone();
    let Some(device) = Device::open() else { return };
    drop(device);
    type NarrowDevice = fn(&mut DeviceInfo);
    let narrowed: [(&str, NarrowDevice); 7] = [
        ("no 64-bit atomics", |info| info.has_int64_atomics = false),
        ("no timestamps", |info| {
            (info.timestamp_period_ns, info.timestamp_bits) = (0.0, 0);
        }),
        ("points of one pixel", |info| info.max_point_size_px = 1.0),
        ("storage bindings of 64 KiB", |info| {
            info.max_storage_range = 64 << 10;
        }),
        ("buffers of 256 KiB", |info| {
            (info.max_allocation, info.max_buffer) = (256 << 10, 256 << 10);
        }),
        ("no images in host memory", |info| info.max_mapped_side = 0),
        ("no blending of floats", |info| info.has_float_blend = false),
    ];
    let model = generated(GeneratedShape::Statue, 3000);
    for splat in [SplatKind::Square, SplatKind::Gauss] {
        let settings = settings(Path::Auto, splat);
        let wanted = run(&model, &settings, DeviceOptions::default(), None).unwrap();
        for (name, narrow) in narrowed {
            let options = DeviceOptions {
                narrowed: Some(narrow),
                ..DeviceOptions::default()
            };
            match run(&model, &settings, options, None) {
                Ok(image) => {
                    let differs = |(a, b): &(&[u8; 4], &[u8; 4])| {
                        a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 2)
                    };
                    let pixels = image.color.iter().zip(&wanted.color);
                    let count = pixels.filter(differs).count();
                    println!("{splat:?}, {name}: {count} pixels differ");
                    assert!(count <= MOST_DIFFERENT, "{splat:?}, {name}: {count} pixels");
                }
                Err(error) => {
                    let is_refused =
                        matches!(error, Error::Unsupported { .. } | Error::Limit { .. });
                    println!("{splat:?}, {name}: {error}");
                    assert!(
                        is_refused && error.to_string().lines().count() == 1,
                        "{error}"
                    );
                }
            }
        }
    }
    // A picture larger than any target is refused before anything is made.
    let options = DeviceOptions {
        narrowed: Some(|info| info.max_image_side = 64),
        ..DeviceOptions::default()
    };
    let error = run(&model, &Settings::default(), options, None).unwrap_err();
    assert!(matches!(error, Error::Limit { .. }), "{error}");
}
