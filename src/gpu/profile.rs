//! Pass times, and the test that they can be believed.

use super::buffer::{BufferUsage, DeviceBuffer};
use super::frame::{
    FinishedFrame, FrameMeasure, FrameRing, PassCounters, PipelineStatistics, TargetLoad,
};
use super::image::{DeviceImage, ImageFormat};
use super::pipeline::{
    AttributeFormat, DepthMode, PipelineDescription, PrimitiveTopology, RecordAttribute,
    ShaderPipeline, VertexRecord,
};
use super::{Error, Gpu};
use crate::abi::specialization::IS_QUAD;
use crate::abi::{FrameConstants, Splat, shaders};
use bytemuck::Zeroable;
use glam::Mat4;
use std::sync::Arc;

/// One pass of the self-test, measured in two ways.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SelfTestRow {
    /// Name of the pass.
    pub name: &'static str,
    /// Median of its timestamps in one submission together with the others, milliseconds.
    pub together_ms: f64,
    /// Median of the processor's clock around a submission of its own, less that of an empty one, milliseconds.
    pub alone_ms: f64,
}

/// Proof that the pass times of a device can be believed, or not.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SelfTest {
    /// Each pass; empty when the device has no timestamps.
    pub rows: Vec<SelfTestRow>,
    /// Median of the processor's clock over the submission with all passes, milliseconds.
    pub host_ms: f64,
    /// An empty submission on the processor's clock, milliseconds: what every frame costs.
    pub empty_ms: f64,
    /// Median of the frame with all passes on the device's clock, first command to last, milliseconds.
    pub device_ms: f64,
    /// No pass differs by more than [`SelfTest::TOLERANCE`] (and a tenth of a millisecond).
    pub agrees: bool,
}

impl SelfTest {
    /// Share by which a pass alone may differ from the same pass among others. Wide, because a busy machine
    /// shifts the processor's clock; work booked to the wrong pass shows as a factor of two and more.
    pub const TOLERANCE: f64 = 0.35;

    /// Sum of the passes over the device time of their frame; `None` without timestamps.
    pub fn covered(&self) -> Option<f64> {
        let sum: f64 = self.rows.iter().map(|r| r.together_ms).sum();
        (self.device_ms > 0.0).then(|| sum / self.device_ms)
    }
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
            "pass times agree with the processor's clock"
        } else {
            "PASS TIMES DO NOT AGREE with the processor's clock: compare frames, not passes"
        };
        write!(
            f,
            "   self-test: {verdict} (all passes {:.2} ms on the processor's clock, empty frame {:.3} ms)",
            self.host_ms, self.empty_ms
        )?;
        for row in &self.rows {
            write!(
                f,
                "\n      {:<16} {:8.2} ms among others, {:8.2} ms alone",
                row.name, row.together_ms, row.alone_ms
            )?;
        }
        if let Some(covered) = self.covered() {
            write!(
                f,
                "\n      the passes are {:.1} % of the frame's {:.2} ms on the device",
                100.0 * covered,
                self.device_ms
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

/// Side of the tests' picture, pixels.
const SIDE: u32 = 256;

/// Draws splats into a small picture of its own.
struct ProfileStand {
    color: DeviceImage,
    depth: DeviceImage,
    pipeline: ShaderPipeline,
    splats: DeviceBuffer,
    frames: FrameRing,
}

/// A pass of the tests: its splats from `first` on, `count` of them, squares of `size_px` pixels.
#[derive(Clone, Copy)]
struct TestPass {
    name: &'static str,
    first: u32,
    count: u32,
    size_px: f32,
    load: TargetLoad,
}

impl ProfileStand {
    fn new(gpu: &Arc<Gpu>, splats: &[Splat], measure: FrameMeasure) -> Result<Self, Error> {
        let pipeline = ShaderPipeline::new(
            gpu,
            &PipelineDescription {
                name: "self-test",
                vertex: &shaders::SPLATS_SQUARE_VERT,
                fragment: Some(shaders::POINTS_DRAW_FRAG.of(false)),
                constants: &[IS_QUAD.is(false)],
                record: VertexRecord {
                    stride: size_of::<Splat>() as u32,
                    attributes: &[
                        RecordAttribute {
                            name: "center",
                            format: AttributeFormat::Float3,
                            offset: 0,
                        },
                        RecordAttribute {
                            name: "radius",
                            format: AttributeFormat::Float,
                            offset: 12,
                        },
                        RecordAttribute {
                            name: "normal",
                            format: AttributeFormat::Snorm16x2,
                            offset: 16,
                        },
                        RecordAttribute {
                            name: "color",
                            format: AttributeFormat::Unorm8x4,
                            offset: 20,
                        },
                    ],
                },
                topology: PrimitiveTopology::Points,
                colors: &[ImageFormat::Rgba8],
                depth: DepthMode::Nearest,
                is_additive: false,
            },
        )?;
        let mut frames = FrameRing::new(gpu, 1, false)?;
        frames.measure(measure)?;
        Ok(Self {
            color: DeviceImage::new(gpu, "self-test color", ImageFormat::Rgba8, SIDE, SIDE)?,
            depth: DeviceImage::new(gpu, "self-test depth", ImageFormat::Depth32, SIDE, SIDE)?,
            pipeline,
            splats: DeviceBuffer::with_data(
                gpu,
                "self-test splats",
                BufferUsage::Vertex,
                bytemuck::cast_slice(splats),
            )?,
            frames,
        })
    }

    /// Runs passes in one submission.
    fn run(&mut self, passes: &[TestPass]) -> Result<FinishedFrame, Error> {
        let clip = glam::Mat4::from_cols_array(&[
            1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 1.0, 1.0,
        ]);
        let columns = |m: Mat4| [m.x_axis, m.y_axis, m.z_axis, m.w_axis].map(|c| c.to_array());
        let mut frame = self.frames.begin()?;
        for pass in passes {
            let constants = FrameConstants {
                view_from_model: columns(Mat4::IDENTITY),
                clip_from_view: columns(clip),
                splat_size_px: pass.size_px,
                focal_px: 1.0,
                model_scale: 1.0,
                ..FrameConstants::zeroed()
            };
            let constants = frame.uniform(&constants)?;
            frame
                .pass(pass.name)
                .color(&self.color, pass.load)
                .depth(&self.depth, pass.load)
                .vertices(&self.splats)
                .draw([0.0, 0.0, SIDE as f32, SIDE as f32], |draw| {
                    draw.cull_back_faces(false, false);
                    draw.bind(&self.pipeline, &[constants], &[]);
                    draw.vertices(&self.splats, 0);
                    draw.draw(pass.first, pass.count);
                });
        }
        let ticket = frame.submit()?;
        self.frames.finish(ticket)
    }
}

/// Runs three passes of different kind on the same target, in one submission and in one each, and compares
/// timestamps with the processor's clock. Takes well under a second.
///
/// # Errors
/// When memory runs out or the device is lost.
pub fn self_test(gpu: &Arc<Gpu>) -> Result<SelfTest, Error> {
    let most = PASSES.iter().map(|p| p.1).max().unwrap_or(1);
    let splats: Vec<Splat> = (0..most)
        .map(|i| {
            // A low-discrepancy scatter over the picture, front to back.
            let u = (f64::from(i) * 0.754_877_666_246_692_7).fract() as f32 * 2.0 - 1.0;
            let v = (f64::from(i) * 0.569_840_290_998_053_2).fract() as f32 * 2.0 - 1.0;
            splat(u, v, -1.0 - i as f32 / most as f32)
        })
        .collect();
    let measure = FrameMeasure {
        passes: true,
        frame: true,
        counters: false,
    };
    let mut stand = ProfileStand::new(gpu, &splats, measure)?;
    let passes = PASSES.map(|(name, count, size_px)| TestPass {
        name,
        first: 0,
        count,
        size_px,
        load: TargetLoad::Clear([0.0; 4]),
    });
    let ms = |finished: &FinishedFrame| finished.host.as_secs_f64() * 1e3;
    const REPEATS: usize = 9;
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or_default()
    };
    // Shaders are compiled at the first draw.
    stand.run(&passes)?;
    let mut empty = Vec::new();
    let mut host = Vec::new();
    let mut device = Vec::new();
    let mut together = vec![Vec::new(); PASSES.len()];
    let mut alone = vec![Vec::new(); PASSES.len()];
    for _ in 0..REPEATS {
        empty.push(ms(&stand.run(&[])?));
        let finished = stand.run(&passes)?;
        host.push(ms(&finished));
        device.extend(finished.device.frame_ms);
        for (list, pass) in together.iter_mut().zip(&finished.passes) {
            list.push(pass.ms);
        }
        for (pass, list) in passes.iter().zip(&mut alone) {
            list.push(ms(&stand.run(&[*pass])?));
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
        device_ms: median(&mut device),
        agrees,
    })
}

fn splat(u: f32, v: f32, z: f32) -> Splat {
    Splat {
        center: glam::Vec3::new(u, v, z),
        radius: crate::abi::SplatRadius::OF_FRAME,
        normal: [0, 0],
        color: [255; 4],
    }
}

/// A counter of the device beside what it had to say.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct CounterRow {
    /// Name of the counter: `samples` or one of [`PipelineStatistics::named`].
    pub name: &'static str,
    /// Counts that the draws of [`counter_test`] come to, one after the other.
    pub expected: [u64; 3],
    /// Counts of the device; `None` where it has no such counter.
    pub counted: Option<[u64; 3]>,
}

impl CounterRow {
    /// Tells whether the device counts this exactly.
    pub fn is_exact(&self) -> bool {
        self.counted == Some(self.expected)
    }
}

/// Proof of which counters of a device can be believed.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct CounterTest {
    /// Each counter.
    pub rows: Vec<CounterRow>,
}

impl CounterTest {
    /// Tells whether the counter of this name is exact on the device.
    pub fn is_exact(&self, name: &str) -> bool {
        self.rows.iter().any(|r| r.name == name && r.is_exact())
    }
}

/// Draws 64 x 64 splats of one pixel, then 64 x 64 squares of 4 x 4 pixels that touch, then 200,003 squares behind
/// them, and compares what the device counts. Fragments that the depth test drops may or may not have been shaded,
/// so those of the third draw are taken as they come.
///
/// # Errors
/// When memory runs out or the device is lost.
pub fn counter_test(gpu: &Arc<Gpu>) -> Result<CounterTest, Error> {
    const ROW: u32 = SIDE / 4;
    const COUNT: u32 = ROW * ROW;
    const PIXELS: u64 = SIDE as u64 * SIDE as u64;
    // Many, and no round number: a device that works in batches may count the seams.
    const HIDDEN: u32 = 200_003;
    // Position in pixels to the view's -1 to 1.
    let at = |px: f32| px / SIDE as f32 * 2.0 - 1.0;
    let grid = |offset_px: f32, z: f32| {
        (0..u32::MAX).map(move |i| {
            let [x, y] = [i % ROW, i / ROW % ROW].map(|i| 4.0 * i as f32 + offset_px);
            splat(at(x), at(y), z)
        })
    };
    // A center of a pixel; then corners between four.
    let splats: Vec<Splat> = grid(1.5, -1.5)
        .take(COUNT as usize)
        .chain(grid(2.0, -1.0).take(COUNT as usize))
        .chain(grid(2.0, -2.0).take(HIDDEN as usize))
        .collect();
    let measure = FrameMeasure {
        counters: true,
        ..FrameMeasure::default()
    };
    let mut stand = ProfileStand::new(gpu, &splats, measure)?;
    let pass = |name, first, count, size_px, load| TestPass {
        name,
        first,
        count,
        size_px,
        load,
    };
    let finished = stand.run(&[
        pass(
            "countertest.pixels",
            0,
            COUNT,
            1.0,
            TargetLoad::Clear([0.0; 4]),
        ),
        pass("countertest.squares", COUNT, COUNT, 4.0, TargetLoad::Keep),
        pass(
            "countertest.hidden",
            2 * COUNT,
            HIDDEN,
            4.0,
            TargetLoad::Keep,
        ),
    ])?;
    let column = |of: &dyn Fn(&PassCounters) -> Option<u64>| -> Option<[u64; 3]> {
        let values: Option<Vec<u64>> = finished.counters.iter().map(of).collect();
        values?.try_into().ok()
    };
    let count = u64::from(COUNT);
    let mut rows = vec![CounterRow {
        name: "samples",
        expected: [count, PIXELS, 0],
        counted: column(&|c| c.samples),
    }];
    for (index, (name, _)) in PipelineStatistics::default()
        .named()
        .into_iter()
        .enumerate()
    {
        let counted = column(&|c| Some(c.pipeline?.named()[index].1));
        let expected = if name == "fragment_invocations" {
            let hidden = counted.map_or(0, |c| c[2].min(16 * u64::from(HIDDEN)));
            [count, PIXELS, hidden]
        } else {
            [count, count, u64::from(HIDDEN)]
        };
        rows.push(CounterRow {
            name,
            expected,
            counted,
        });
    }
    Ok(CounterTest { rows })
}
