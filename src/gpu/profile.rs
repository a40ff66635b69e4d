//! Pass times, and the test that they can be believed.

use super::buffer::{Buffer, Usage};
use super::frame::{Frames, Load};
use super::image::{Format, Image};
use super::pipeline::{Attribute, AttributeFormat, Depth, Description, Pipeline, Record, Topology};
use super::{Error, Gpu};
use crate::abi::{FrameConstants, Splat, shaders};
use bytemuck::Zeroable;
use glam::Mat4;
use std::sync::Arc;

/// Time of one pass on the device.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PassTime {
    /// Name of the pass.
    pub name: &'static str,
    /// Milliseconds between the timestamps around it.
    pub ms: f64,
}

/// One pass of the self-test, measured in two ways.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SelfTestRow {
    /// Name of the pass.
    pub name: &'static str,
    /// Median of its timestamps in one submission together with the others, milliseconds.
    pub together_ms: f64,
    /// Median of the host clock around a submission of its own, less that of an empty one, milliseconds.
    pub alone_ms: f64,
}

/// Whether the pass times of a device can be believed.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SelfTest {
    /// Each pass; empty when the device has no timestamps.
    pub rows: Vec<SelfTestRow>,
    /// Median host clock of the submission with all passes, milliseconds.
    pub host_ms: f64,
    /// An empty submission on the host clock, milliseconds: what every frame costs.
    pub empty_ms: f64,
    /// No pass differs by more than [`SelfTest::TOLERANCE`] (and a tenth of a millisecond).
    pub agrees: bool,
}

impl SelfTest {
    /// Share by which a pass alone may differ from the same pass among others. Wide, because a busy machine
    /// shifts the host clock; work booked to the wrong pass shows as a factor of two and more.
    pub const TOLERANCE: f64 = 0.35;
}

impl std::fmt::Display for SelfTest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.rows.is_empty() {
            return write!(
                f,
                "   self-test: no timestamps, pass times are not available"
            );
        }
        let verdict = if self.agrees {
            "pass times agree with the host clock"
        } else {
            "PASS TIMES DO NOT AGREE with the host clock: compare frames, not passes"
        };
        write!(
            f,
            "   self-test: {verdict} (all passes {:.2} ms on the host clock, empty frame {:.3} ms)",
            self.host_ms, self.empty_ms
        )?;
        for row in &self.rows {
            write!(
                f,
                "\n      {:<16} {:8.2} ms among others, {:8.2} ms alone",
                row.name, row.together_ms, row.alone_ms
            )?;
        }
        Ok(())
    }
}

const PASSES: [(&str, u32, f32); 3] = [
    ("selftest.small", 20_000, 1.0),
    ("selftest.large", 20_000, 12.0),
    ("selftest.many", 80_000, 1.0),
];

/// Runs three passes of different kind on the same target, in one submission and in one each, and compares
/// timestamps with the host clock. Takes well under a second.
///
/// # Errors
/// When memory runs out or the device is lost.
pub fn self_test(gpu: &Arc<Gpu>) -> Result<SelfTest, Error> {
    const SIDE: u32 = 256;
    let color = Image::new(gpu, "self-test color", Format::Rgba8, SIDE, SIDE)?;
    let depth = Image::new(gpu, "self-test depth", Format::Depth32, SIDE, SIDE)?;
    let pipeline = Pipeline::new(
        gpu,
        &Description {
            name: "self-test",
            vertex: &shaders::SPLATS_SQUARE_VERT,
            fragment: Some(&shaders::POINTS_DRAW_FRAG),
            constants: &[false],
            record: Record {
                stride: size_of::<Splat>() as u32,
                attributes: &[
                    Attribute {
                        name: "center",
                        format: AttributeFormat::Float3,
                        offset: 0,
                    },
                    Attribute {
                        name: "radius",
                        format: AttributeFormat::Float,
                        offset: 12,
                    },
                    Attribute {
                        name: "normal",
                        format: AttributeFormat::Snorm16x2,
                        offset: 16,
                    },
                    Attribute {
                        name: "color",
                        format: AttributeFormat::Unorm8x4,
                        offset: 20,
                    },
                ],
            },
            topology: Topology::Points,
            colors: &[Format::Rgba8],
            depth: Depth::Nearest,
            is_additive: false,
        },
    )?;
    let most = PASSES.iter().map(|p| p.1).max().unwrap_or(1);
    let splats: Vec<Splat> = (0..most)
        .map(|i| {
            // A low-discrepancy scatter over the picture, front to back.
            let u = (f64::from(i) * 0.754_877_666_246_692_7).fract() as f32 * 2.0 - 1.0;
            let v = (f64::from(i) * 0.569_840_290_998_053_2).fract() as f32 * 2.0 - 1.0;
            Splat {
                center: glam::Vec3::new(u, v, -1.0 - i as f32 / most as f32),
                radius: 0.0,
                normal: [0, 0],
                color: [255; 4],
            }
        })
        .collect();
    let buffer = Buffer::with_data(
        gpu,
        "self-test splats",
        Usage::Vertex,
        bytemuck::cast_slice(&splats),
    )?;
    let clip = glam::Mat4::from_cols_array(&[
        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 1.0, 1.0,
    ]);
    let columns = |m: Mat4| [m.x_axis, m.y_axis, m.z_axis, m.w_axis].map(|c| c.to_array());
    let mut frames = Frames::new(gpu, 1, true)?;
    let mut run = |which: &[usize]| -> Result<(Vec<PassTime>, f64), Error> {
        let mut frame = frames.begin()?;
        for &index in which {
            let (name, count, size) = PASSES[index];
            let constants = FrameConstants {
                view_from_model: columns(Mat4::IDENTITY),
                clip_from_view: columns(clip),
                splat_size_px: size,
                focal_px: 1.0,
                model_scale: 1.0,
                ..FrameConstants::zeroed()
            };
            let constants = frame.uniform(&constants)?;
            let pass = frame
                .pass(name)
                .color(&color, Load::Clear([0.0; 4]))
                .depth(&depth, Load::Clear([0.0; 4]))
                .vertices(&buffer);
            pass.draw([0.0, 0.0, SIDE as f32, SIDE as f32], |draw| {
                draw.cull_back_faces(false, false);
                draw.bind(&pipeline, &[constants], &[]);
                draw.vertices(&buffer, 0);
                draw.draw(0, count);
            });
        }
        let ticket = frame.submit()?;
        let finished = frames.finish(ticket)?;
        Ok((finished.passes, finished.host.as_secs_f64() * 1e3))
    };
    const REPEATS: usize = 9;
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    // Shaders are compiled at the first draw.
    run(&[0, 1, 2])?;
    let mut empty = Vec::new();
    let mut host = Vec::new();
    let mut together = vec![Vec::new(); PASSES.len()];
    let mut alone = vec![Vec::new(); PASSES.len()];
    for _ in 0..REPEATS {
        empty.push(run(&[])?.1);
        let (passes, ms) = run(&[0, 1, 2])?;
        host.push(ms);
        for (list, pass) in together.iter_mut().zip(&passes) {
            list.push(pass.ms);
        }
        for (index, list) in alone.iter_mut().enumerate() {
            list.push(run(&[index])?.1);
        }
    }
    let empty_ms = median(&mut empty);
    let mut rows = Vec::new();
    if together.iter().all(|t| !t.is_empty()) {
        for (index, (together, alone)) in together.iter_mut().zip(&mut alone).enumerate() {
            rows.push(SelfTestRow {
                name: PASSES[index].0,
                together_ms: median(together),
                alone_ms: (median(alone) - empty_ms).max(0.0),
            });
        }
    }
    let agrees = rows.iter().all(|r| {
        (r.together_ms - r.alone_ms).abs()
            <= 0.1 + SelfTest::TOLERANCE * r.alone_ms.max(r.together_ms)
    });
    Ok(SelfTest {
        rows,
        host_ms: median(&mut host),
        empty_ms,
        agrees,
    })
}
