//! Faults made on purpose: the net of the other tests must catch each of them.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::Device;
use surfel::gpu::buffer::{BufferUsage, DeviceBuffer, ReadbackBuffer};
use surfel::gpu::frame::{FrameMeasure, FrameRing, TargetLoad};
use surfel::gpu::image::{DeviceImage, ImageFormat};
use surfel::gpu::{DeviceOptions, Error, Gpu};

const SIDE: u32 = 16;

/// Clears an image in a pass with the given viewport and copies it out.
fn clear_and_read(
    frames: &mut FrameRing,
    image: &DeviceImage,
    readback: &ReadbackBuffer,
    viewport: [f32; 4],
) {
    let mut frame = frames.begin().unwrap();
    let pass = frame
        .pass("test.clear")
        .color(image, TargetLoad::Clear([1.0, 0.6, 0.2, 1.0]));
    pass.draw(viewport, |_| {});
    frame.read_back("test.read", image, readback);
    let ticket = frame.submit().unwrap();
    frames.finish(ticket).unwrap();
}

#[test]
fn a_clean_pass_leaves_no_message_and_the_cleared_value() {
    let Some(device) = Device::open() else { return };
    let image = DeviceImage::new(device.gpu(), "target", ImageFormat::Rgba8, SIDE, SIDE).unwrap();
    let mut readback = ReadbackBuffer::new(device.gpu(), "readback", image.bytes()).unwrap();
    let mut frames = FrameRing::new(device.gpu(), 2, true).unwrap();
    for _ in 0..5 {
        clear_and_read(&mut frames, &image, &readback, [0.0, 0.0, 16.0, 16.0]);
    }
    assert!(
        readback
            .bytes()
            .chunks_exact(4)
            .all(|p| p == [255, 153, 51, 255])
    );
    assert_eq!(device.take_messages(), []);
}

#[test]
fn what_the_host_writes_into_an_image_is_what_is_copied_out() {
    for pretend_noncoherent in [false, true] {
        let options = DeviceOptions {
            pretend_noncoherent,
            ..DeviceOptions::default()
        };
        let Some(device) = Device::open_with(options) else {
            return;
        };
        let gpu = device.gpu();
        let most = gpu.info().max_mapped_side;
        // A row of it may have gaps behind it.
        let (width, height) = (37, 21);
        let Some(mut image) = DeviceImage::mapped(gpu, "by the host", width, height).unwrap()
        else {
            assert!(most < width, "the device has such images: {most}");
            return;
        };
        if let Some(above) = most.checked_add(1) {
            assert!(
                DeviceImage::mapped(gpu, "too wide", above, 1)
                    .unwrap()
                    .is_none()
            );
        }
        let mut readback = ReadbackBuffer::new(gpu, "readback", image.bytes()).unwrap();
        let mut frames = FrameRing::new(gpu, 2, true).unwrap();
        for round in 0..4 {
            let value = |x: u32, y: u32| round << 24 | y << 12 | x;
            let mut wanted = vec![0; (width * height) as usize];
            // Nothing is written in the first round, and the image is empty.
            if round > 0 {
                let (words, pitch) = image.words_mut();
                for (y, row) in words.chunks_mut(pitch).enumerate() {
                    for (x, word) in row[..width as usize].iter_mut().enumerate() {
                        *word = value(x as u32, y as u32);
                        wanted[y * width as usize + x] = *word;
                    }
                }
                image.flush();
            }
            let mut frame = frames.begin().unwrap();
            frame.read_back("test.read", &image, &readback);
            let ticket = frame.submit().unwrap();
            frames.finish(ticket).unwrap();
            let read: &[u32] = bytemuck::cast_slice(readback.bytes());
            assert!(read == wanted, "round {round}");
        }
        assert_eq!(device.take_messages(), []);
    }
}

#[test]
fn a_frame_without_passes_takes_the_device_no_time() {
    let Some(device) = Device::open() else { return };
    let image = DeviceImage::new(device.gpu(), "target", ImageFormat::Rgba8, SIDE, SIDE).unwrap();
    let readback = ReadbackBuffer::new(device.gpu(), "readback", image.bytes()).unwrap();
    let mut frames = FrameRing::new(device.gpu(), 2, true).unwrap();
    frames
        .measure(FrameMeasure {
            passes: true,
            frame: true,
            counters: true,
        })
        .unwrap();
    for round in 0..5 {
        let frame = frames.begin().unwrap();
        let ticket = frame.submit().unwrap();
        let finished = frames.finish(ticket).unwrap();
        let has_clock = device.gpu().info().timestamp_period_ns > 0.0;
        assert_eq!(finished.device.frame_ms, has_clock.then_some(0.0));
        assert_eq!((finished.passes, finished.submitted), (Vec::new(), None));
        // What comes after is as ever.
        if round % 2 == 1 {
            clear_and_read(&mut frames, &image, &readback, [0.0, 0.0, 16.0, 16.0]);
        }
    }
    assert_eq!(device.take_messages(), []);
}

#[test]
fn an_impossible_viewport_is_caught() {
    let Some(device) = Device::open() else { return };
    let image = DeviceImage::new(device.gpu(), "target", ImageFormat::Rgba8, SIDE, SIDE).unwrap();
    let readback = ReadbackBuffer::new(device.gpu(), "readback", image.bytes()).unwrap();
    let mut frames = FrameRing::new(device.gpu(), 1, false).unwrap();
    clear_and_read(&mut frames, &image, &readback, [0.0, 0.0, -5.0, 16.0]);
    let messages = device.take_messages();
    assert!(
        messages
            .iter()
            .any(|m| m.is_error && m.id.contains("VkViewport-width")),
        "{messages:?}"
    );
}

#[test]
fn a_missing_barrier_is_caught() {
    let Some(device) = Device::open() else { return };
    let image = DeviceImage::new(device.gpu(), "target", ImageFormat::Rgba8, SIDE, SIDE).unwrap();
    let readback = ReadbackBuffer::new(device.gpu(), "readback", image.bytes()).unwrap();
    let mut frames = FrameRing::new(device.gpu(), 1, false).unwrap();
    frames.omit_barriers();
    clear_and_read(&mut frames, &image, &readback, [0.0, 0.0, 16.0, 16.0]);
    let messages = device.take_messages();
    assert!(messages.iter().any(|m| m.is_error), "{messages:?}");
}

#[test]
#[should_panic(expected = "a resource outlives its test")]
fn a_leaked_resource_is_caught() {
    let Some(device) = Device::open() else {
        panic!("no device; a resource outlives its test cannot be shown");
    };
    let buffer =
        DeviceBuffer::with_data(device.gpu(), "leaked", BufferUsage::Vertex, &[0; 64]).unwrap();
    std::mem::forget(buffer);
}

#[test]
fn sizes_past_the_limits_are_errors_with_the_limit() {
    let Some(device) = Device::open() else { return };
    let limit = device.gpu().info().max_image_side;
    for (w, h) in [(0, 4), (4, 0), (limit + 1, 4)] {
        match DeviceImage::new(device.gpu(), "too large", ImageFormat::Rgba8, w, h) {
            Err(Error::Limit { limit: l, .. }) => assert_eq!(l, u64::from(limit)),
            other => panic!("{w}x{h}: {other:?}"),
        }
    }
    let too_many = device
        .gpu()
        .info()
        .max_buffer
        .min(device.gpu().info().max_allocation)
        + 1;
    assert!(matches!(
        ReadbackBuffer::new(device.gpu(), "too large", too_many),
        Err(Error::Limit { .. })
    ));
}

#[test]
fn a_device_that_is_not_there_is_named_with_those_that_are() {
    let Some(device) = Device::open() else { return };
    let wanted = DeviceOptions {
        device: Some("no such device".into()),
        ..DeviceOptions::default()
    };
    match Gpu::open(&wanted) {
        Err(Error::UnknownDevice { available, .. }) => {
            assert!(available.contains(&device.gpu().info().name))
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn pass_times_agree_with_the_host_clock() {
    let Some(device) = Device::open() else { return };
    let report = surfel::gpu::profile::self_test(device.gpu()).unwrap();
    println!("{report}");
    if device.gpu().info().timestamp_period_ns == 0.0 {
        assert!(report.rows.is_empty());
        return;
    }
    // Time itself decides nothing here: what must hold on any machine is that no pass is lost and that the
    // passes together do not take longer than the submission they were in, up to a busy machine's jitter.
    assert_eq!(report.rows.len(), 3);
    assert!(report.rows.iter().all(|r| r.together_ms > 0.0));
    let sum: f64 = report.rows.iter().map(|r| r.together_ms).sum();
    assert!(
        sum <= 1.5 * report.host_ms + 1.0,
        "{sum} ms of passes in {} ms",
        report.host_ms
    );
}
